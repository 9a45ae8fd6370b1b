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


def node_area(node: int, cells: Indices) -> tuple[list[int], Array]:
    """The nodes (k,) on which the area of a node depends, and the form (k, k) of it: see `area_of`."""
    own = cells[(cells == node).any(axis=1)]
    near = np.unique(own)
    form = np.zeros((near.size, near.size))
    for cell in own:
        at = np.searchsorted(near, cell)
        form[np.ix_(at, at)] += _FORMS[int(np.flatnonzero(cell == node)[0])]
    return near.tolist(), form


def area_of(form: Array, places: Array) -> Array:
    """(3,) Σ form_ab x_a × x_b of places (k, 3): of a node ∫ N n dA, its force by a unit of pressure, m²."""
    g = places.T @ form @ places
    return np.array([g[1, 2] - g[2, 1], g[2, 0] - g[0, 2], g[0, 1] - g[1, 0]])


def volume(places: Array, cells: Indices) -> float:
    """Volume of the cones from the origin to a surface with nodes at places (m, 3), m³: of a closed one its own."""
    corner = places[cells]
    cross = np.cross(corner[:, :, None], corner[:, None])
    return float(np.einsum("iab,nabk,nik->", _FORMS, cross, corner, optimize=True)) / 3.0
