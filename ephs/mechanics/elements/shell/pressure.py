"""Pressure on the surface of a shell: each element is the bilinear surface of its four nodes.

The virtual work of a pressure p is p ∫ δx·n dA, so that a node has the force p ∫ N n dA with its shape N, along the
normal of the surface as it is. As n dA = x_ξ × x_η dξ dη, this is a sum of products x_a × x_b with constants ∫ N ∂_ξN_a
∂_ηN_b, which 2 × 2 points integrate exactly. Forces on closed surfaces have neither sum nor moment; their power is
p dV/dt.
"""

import numpy as np

from ephs.mechanics.elements.shell.mesh import Indices
from ephs.semantics.bundles.bundle import Array

_XI, _ETA = np.array([-1.0, 1.0, 1.0, -1.0]), np.array([-1.0, -1.0, 1.0, 1.0])
_AT = 3**-0.5 * np.array([_XI, _ETA])
_ALONG, _ACROSS = 1.0 + np.outer(_AT[0], _XI), 1.0 + np.outer(_AT[1], _ETA)
_FORMS = np.einsum("pi,pa,pb->iab", _ALONG * _ACROSS, _XI * _ACROSS, _ETA * _ALONG) / 64.0
"""(4, 4, 4) ∫ N_i ∂_ξN_a ∂_ηN_b dξ dη."""


def node_areas(places: Array, cells: Indices) -> Array:
    """(m, 3) ∫ N n dA of nodes at places (m, 3), m²: their forces by a unit of pressure."""
    corner, out = places[cells], np.zeros_like(places)
    cross = np.cross(corner[:, :, None], corner[:, None])
    np.add.at(out, cells, np.einsum("iab,nabk->nik", _FORMS, cross))
    return out


def area_slopes(places: Array, cells: Indices, moved: Array) -> Array:
    """(m, 3, k) exact derivatives of `node_areas` along motions (m, 3, k) of the nodes."""
    corner, out = places[cells], np.zeros_like(moved)
    arms = np.einsum("iab,nak->nibk", _FORMS - _FORMS.transpose(0, 2, 1), corner)
    np.add.at(out, cells, np.einsum("nibjk,nbkl->nijl", _hats(arms), moved[cells]))
    return out


def _hats(vectors: Array) -> Array:
    """(…, 3, 3) matrices of cross products with vectors (…, 3)."""
    return np.cross(vectors[..., None, :], np.eye(3)).swapaxes(-1, -2)


def volume(places: Array, cells: Indices) -> float:
    """Volume of the cones from the origin to a surface with nodes at places (m, 3), m³: of a closed one its own."""
    return float(np.sum(node_areas(places, cells) * places)) / 3.0
