"""The constant matrix K of elements: E = ½ Δᵀ K Δ, with Δ (24,) the changes of the logarithms of their four edges.

Strains at a point are linear in Δ (Γ = [F_ξ F_η] J⁻¹ of interpolated edges), so all integration is done once. Membrane
strains and curvatures enter by assumed stresses (Hellinger and Reissner; five of each: Pian and Sumihara 1984), the
transverse shear as tied at the edges (MITC4, Dvorkin and Bathe 1984) with a part of MacNeal's residual flexibility
ℓ²/12D. In membrane strains each edge turns with the mean of the four, and bulges as its ends turn (Allman 1984).
"""

from typing import Final

import numpy as np

from ephs.mechanics.elements.shell.section import ShellSection
from ephs.semantics.bundles.bundle import Array

EDGES: Final = ((0, 1), (3, 2), (0, 3), (1, 2))
"""Corners that edges go from and to: along ξ at η = −1 and 1, along η at ξ = −1 and 1."""
DRILL: Final = 0.2
"""Stiffness of the turn about the normal, in parts of the mean of membrane shear; below 0.03 soft, above 1 stiff."""
RESIDUAL: Final = 0.1
"""Part of the residual flexibility of bending in that of transverse shear."""
_SENSES = np.array([1.0, -1.0, -1.0, 1.0])
"""Whether an edge runs counter-clockwise."""
_SIDES = np.array([-1.0, 1.0, -1.0, 1.0])
_GAUSS = np.array([(x, y) for x in (-(3**-0.5), 3**-0.5) for y in (-(3**-0.5), 3**-0.5)])
_SHARE = np.eye(24).reshape(4, 6, 24)
_WEIGHTS = np.zeros((4, 2, 4))
"""Of the edges in F_ξ and F_η at the points."""
_WEIGHTS[:, 0, :2] = 0.25 * (1.0 + np.outer(_GAUSS[:, 1], _SIDES[:2]))
_WEIGHTS[:, 1, 2:] = 0.25 * (1.0 + np.outer(_GAUSS[:, 0], _SIDES[2:]))


def jacobians(rest: Array) -> Array:
    """(n, 4, 2, 2) tangents along ξ and η, in columns, at 2 × 2 points of edges at rest (n, 4, 6); m."""
    return np.einsum("pae,nei->npia", _WEIGHTS, rest[:, :, 3:5])


def stiffness(rest: Array, section: ShellSection) -> tuple[Array, Array]:
    """K (n, 24, 24) of elements with logarithms ``rest`` (n, 4, 6) of their edges, and resultants (n, 8, 24).

    Resultants are rows of Δ: membrane forces 11, 22, 12 in N/m, moments alike in N, transverse forces 1, 2 in N/m, in
    the middle of the element.
    """
    tangents = jacobians(rest)
    inverse, weights = np.linalg.inv(tangents).astype(float), np.linalg.det(tangents)
    centre, area = tangents.mean(axis=1), weights.sum(axis=1)
    gamma = np.einsum("piaj,npab->npibj", np.einsum("pae,eij->piaj", _WEIGHTS, _SHARE), inverse)
    (w1, w2), (v1, v2, v3) = (gamma[:, :, i] for i in (0, 1)), (gamma[:, :, i] for i in (3, 4, 5))
    bent = np.stack([w2[:, :, 0], -w1[:, :, 1], w2[:, :, 1] - w1[:, :, 0]], axis=2)
    rows = np.concatenate([_membrane(rest, inverse, area), bent], axis=2)
    work, flexible = _assumed(rows, centre, weights, section.plane)
    fitted, slip = np.linalg.solve(flexible, work).astype(float), _transverse(centre, section)
    k = np.swapaxes(work, 1, 2) @ fitted
    k += np.einsum("np,npai,nab,npbj->nij", weights, v3, slip, v3, optimize=True)
    drill = DRILL * section.sheared
    spin = v2[:, :, 0] - v1[:, :, 1]
    k += drill * np.einsum("np,npi,npj->nij", weights, spin, spin, optimize=True)
    twist = 0.25 * (_SHARE[1, 2] - _SHARE[0, 2] + _SHARE[3, 2] - _SHARE[2, 2])
    k += (drill / 9.0 * area)[:, None, None] * np.outer(twist, twist)
    sheared = np.einsum("np,nab,npbj->naj", weights / area[:, None], slip, v3, optimize=True)
    resultants = np.concatenate([fitted[:, [0, 1, 2, 5, 6, 7]], sheared], axis=1)
    whole: Array = 0.5 * (k + np.swapaxes(k, 1, 2))
    return whole, resultants.astype(float)


def _membrane(rest: Array, inverse: Array, area: Array) -> Array:
    """(n, 4, 3, 24) membrane strains at the points."""
    x, y = rest[:, :, 3], rest[:, :, 4]
    turned = 0.25 * _SIDES[:, None] * np.repeat([_SHARE[2, 2] + _SHARE[3, 2], _SHARE[0, 2] + _SHARE[1, 2]], 2, axis=0)
    moves = _SHARE[:, 3:5] + np.stack([-y, x], axis=2)[..., None] * turned[:, None]
    gamma = np.einsum("pae,neij,npab->npibj", _WEIGHTS, moves, inverse, optimize=True)
    strains = np.stack([gamma[:, :, 0, 0], gamma[:, :, 1, 1], gamma[:, :, 0, 1] + gamma[:, :, 1, 0]], axis=2)
    squares = np.stack([y * y, x * x, -2.0 * x * y], axis=2) / 12.0
    bulges = np.einsum("nek,e,ej->nkj", squares, _SENSES, _SHARE[:, 2]) / area[:, None, None]
    return strains + bulges[:, None]


def _assumed(rows: Array, centre: Array, weights: Array, plane: Array) -> tuple[Array, Array]:
    """(n, 10, 24) work of assumed forces and moments on Δ, and their flexibility (n, 10, 10).

    They are five of each: constant ones, and a_ξa_ξᵀ η, a_ηa_ηᵀ ξ of the centre's tangents.
    """
    modes = np.zeros((*weights.shape, 3, 5))
    modes[..., :3] = np.eye(3)
    x, y = centre[:, 0] / np.linalg.norm(centre, axis=1), centre[:, 1] / np.linalg.norm(centre, axis=1)
    squares = np.stack([x * x, y * y, x * y], axis=1)
    modes[..., 3:] = np.einsum("pk,nik->npik", _GAUSS[:, ::-1], squares)
    both = np.zeros((*weights.shape, 6, 10))
    both[..., :3, :5], both[..., 3:, 5:] = modes, modes
    work = np.einsum("np,npka,npki->nai", weights, both, rows, optimize=True)
    flexible = np.einsum("np,npka,kl,nplb->nab", weights, both, np.linalg.inv(plane), both, optimize=True)
    return work, flexible


def _transverse(centre: Array, section: ShellSection) -> Array:
    """(n, 2, 2) stiffness of transverse shear of elements with tangents (n, 2, 2) in their centre."""
    sides = 2.0 * np.swapaxes(centre, 1, 2)
    flexible = np.einsum("nai,naj,na->nij", sides, sides, 1.0 / section.bending(sides)) / 12.0
    return np.linalg.inv(np.linalg.inv(section.shear) + RESIDUAL * flexible)
