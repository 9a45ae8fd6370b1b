"""Strain of a beam element, its energy and its loss, for numbers, arrays and recorded numbers.

Between the cross-sections at the ends of an element of length L the relative pose d = exp(L ξ₀) q has the mean strain
ξ = log(d)/L. Two energies of it:

- order 2: the strain is the same everywhere, L/2 (ξ − ξ₀)ᵀ K (ξ − ξ₀).
- order 4: the stress obeys the balance of forces and moments between the ends to first order in L, so that it changes
  by ad_ξᵀ n on the way; the energy that is least for given ends is L/2 (ξ − ξ₀)ᵀ C⁻¹ (ξ − ξ₀) with the compliance
  C = K⁻¹ + ad_d K⁻¹ ad_dᵀ/12. Straight and in small motion this is the exact stiffness of Timoshenko's beam under
  loads at its ends (MacNeal's residual bending flexibility): 1/GA becomes 1/GA + L²/(12 EI).

Both depend on the relative pose alone and do not lock.
"""

from typing import Any

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.special import squared_turn, turn_curve, turn_curve_slope, turn_ratio
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import symmetric_eigen
from ephs.semantics.spaces.rotations import quaternion_to_matrix

ORDERS = (2, 4)
"""Orders in the length of the elements that rest converges by."""


def strain_energy(pose: Any, length: float, stiffness: Array, rest: Array, order: int = 2) -> Any:
    """Energy in J of a pose relative to the one without force: L/2 (ξ − ξ₀)ᵀ K (ξ − ξ₀), with C⁻¹ for K at order 4."""
    change = displacement(pose, length, rest)
    if order == 2:
        terms = zip(change, stiffness, strict=True)
        return _sum(0.5 * k / length * d * d for d, k in terms if k)
    lower, pivots = _factors(logarithm(moved(pose, length * rest)), stiffness)
    parts = zip(_eliminated(lower, change), pivots, strict=True)
    return 0.5 / length * _sum(d * d / pivot for d, pivot in parts)


def strain_resistance(pose: Any, length: float, stiffness: Array, rest: Array, damping: float, order: int = 2) -> Any:
    """(6, 6) resistance T⁻ᵀ τ K T⁻¹/L of a relative pose to its own twist, with C⁻¹ for K at order 4."""
    whole = moved(pose, length * rest)
    rate = logarithm_rate(whole)
    if order == 2:
        weights = np.sqrt(stiffness * damping / length)
        rows = [[w * entry for entry in row] for w, row in zip(weights, rate, strict=True) if w]
        return [[_sum(row[i] * row[j] for row in rows) for j in range(6)] for i in range(6)]
    lower, pivots = _factors(logarithm(whole), stiffness)
    columns = [_eliminated(lower, [row[j] for row in rate]) for j in range(6)]
    scale = damping / length
    return [
        [scale * _sum(a * b / pivot for a, b, pivot in zip(one, other, pivots, strict=True)) for other in columns]
        for one in columns
    ]


def turning_resistance(turn: Any, friction: Array) -> Any:
    """(3, 3) resistance T⁻ᵀ D T⁻¹ of a rotation to its angular velocity: D (3, 3) to the rate of its rotation vector,
    which is the same, but for its sign, from both sides.
    """
    sizes, axes = symmetric_eigen(friction)
    rate = [row[:3] for row in logarithm_rate([*(turn[i] for i in range(4)), 0.0, 0.0, 0.0])[:3]]
    weighed = np.sqrt(np.maximum(sizes, 0.0)) * axes
    rows = [[_sum(weighed[i, k] * rate[i][j] for i in range(3) if weighed[i, k]) for j in range(3)] for k in range(3)]
    return [[_sum(row[i] * row[j] for row in rows) for j in range(3)] for i in range(3)]


def stretching(pose: Any, length: float, rest: Array) -> list[Any]:
    """(6,) row of T⁻¹: w with L ξ̇₄ = w·u, an element's rate of lengthening by the twist u of its relative pose."""
    return logarithm_rate(moved(pose, length * rest))[3]


def mean_stress(pose: Any, length: float, stiffness: Array, rest: Array, order: int = 2) -> list[Any]:
    """(6,) moment in N m and force in N at the middle of an element, in its axes: K (ξ − ξ₀), C⁻¹ for K at order 4."""
    strain = [d / length for d in displacement(pose, length, rest)]
    if order == 2:
        return [k * d for k, d in zip(stiffness, strain, strict=True)]
    lower, pivots = _factors(logarithm(moved(pose, length * rest)), stiffness)
    out = [d / pivot for d, pivot in zip(_eliminated(lower, strain), pivots, strict=True)]
    for i in range(5, -1, -1):
        out[i] = out[i] - _sum(lower[j][i] * out[j] for j in range(i + 1, 6))
    return out


def _factors(whole: list[Any], stiffness: Array) -> tuple[list[list[Any]], list[Any]]:
    """Unit lower triangle (strictly below) and pivots of the compliance C at log d = ``whole``."""
    turning, moving = _skew(whole[:3]), _skew(whole[3:])
    none = [0.0, 0.0, 0.0]
    ad = [[*turning[i], *none] for i in range(3)] + [[*moving[i], *turning[i]] for i in range(3)]
    c = [
        [_sum(ad[i][m] * ad[j][m] / (12.0 * k) for m, k in enumerate(stiffness)) for j in range(i + 1)]
        for i in range(6)
    ]
    lower: list[list[Any]] = []
    pivots: list[Any] = []
    for i in range(6):
        row: list[Any] = []
        for j in range(i):
            row.append(c[i][j] - _sum(row[m] * lower[j][m] for m in range(j)))
        scaled = [entry / pivot for entry, pivot in zip(row, pivots, strict=True)]
        pivots.append(1.0 / stiffness[i] + c[i][i] - _sum(a * b for a, b in zip(row, scaled, strict=True)))
        lower.append(scaled)
    return lower, pivots


def _eliminated(lower: list[list[Any]], right: list[Any]) -> list[Any]:
    """The solution of a unit lower triangle."""
    out: list[Any] = []
    for row, value in zip(lower, right, strict=True):
        out.append(value - _sum(a * b for a, b in zip(row, out, strict=True)))
    return out


def displacement(pose: Any, length: float, rest: Array) -> list[Any]:
    """(6,) L (ξ − ξ₀) = log(d₀ q) − log d₀, d₀ = exp(L ξ₀), of a pose q, without a difference of large numbers.

    With log d = (ω, r − ½ ω × r + c ω × (ω × r)), r = r₀ + R₀ x, every term below is small where q is near 1. Stiff
    rods need that: what rounding leaves of a strain counts with EA.
    """
    base = length * np.asarray(rest, dtype=float)
    turn, start = base[:3], SE3.exp(base)
    whole = moved(pose, base)
    square = squared_turn(whole[:4])
    w, c = _rotation_vector(whole, square), turn_curve(square)
    x = _turned(start, pose[4:])
    r = start[4:]
    side = _cross(w, x)
    far = _cross(w, side)
    change = [w[i] - turn[i] for i in range(3)] if turn.any() else w
    more = _cross(change, r)
    further = _cross(change, _cross(w, r))
    out = [x[i] - 0.5 * (side[i] + more[i]) + c * (far[i] + further[i]) for i in range(3)]
    if turn.any():
        across, old = _cross(turn, more), np.cross(turn, np.cross(turn, r))
        bent = c - turn_curve(float(turn @ turn))
        out = [out[i] + c * across[i] + bent * old[i] for i in range(3)]
    return [*change, *out]


def logarithm(pose: Any) -> list[Any]:
    """(6,) log of a pose (7,), angular part first, up to half a turn; for numbers and recorded numbers."""
    square = squared_turn(pose[:4])
    w = _rotation_vector(pose, square)
    r = list(pose[4:])
    side = _cross(w, r)
    far = _cross(w, side)
    c = turn_curve(square)
    return [*w, *(r[i] - 0.5 * side[i] + c * far[i] for i in range(3))]


def moved(pose: Any, base: Array) -> list[Any]:
    """d₀ q with d₀ = exp(base), of a recorded pose too."""
    start = SE3.exp(base)
    moved = [start[4 + i] + x for i, x in enumerate(_turned(start, pose[4:]))]
    if not base[:3].any():
        return [*pose[:4], *moved]
    a, u = start[0], start[1:4]
    b, v = pose[0], list(pose[1:4])
    side = _cross(u, v)
    return [a * b - _sum(u[i] * v[i] for i in range(3)), *(a * v[i] + u[i] * b + side[i] for i in range(3)), *moved]


def _turned(start: Array, x: Any) -> list[Any]:
    if not start[1:4].any():
        return list(x)
    rotation = quaternion_to_matrix(start[:4])
    return [_sum(rotation[i, j] * x[j] for j in range(3)) for i in range(3)]


def _rotation_vector(pose: Any, square: Any) -> list[Any]:
    sign = pose[0] / abs(pose[0])
    ratio = 2.0 * sign * turn_ratio(square)
    return [ratio * pose[i] for i in (1, 2, 3)]


def logarithm_rate(pose: Any) -> list[list[Any]]:
    """(6, 6) T⁻¹: derivative of the logarithm by a left-trivialised change of the pose.

    Its blocks are [[A, 0], [A′, A]] with A = 1 + ½ω̃ + c ω̃² and A′ the derivative of A along υ.
    """
    square, whole = squared_turn(pose[:4]), logarithm(pose)
    w, v = whole[:3], whole[3:]
    c, slope = turn_curve(square), turn_curve_slope(square)
    turning, moving = _skew(w), _skew(v)
    twice, there, back = _product(turning, turning), _product(turning, moving), _product(moving, turning)
    twist = 2.0 * slope * _sum(w[i] * v[i] for i in range(3))
    at = [(i, j) for i in range(3) for j in range(3)]
    block = {(i, j): float(i == j) + 0.5 * turning[i][j] + c * twice[i][j] for i, j in at}
    change = {
        (i, j): 0.5 * moving[i][j] + c * (there[i][j] + back[i][j]) + twist * twice[i][j] for i, j in at
    }  # fmt: skip
    upper = [[*(block[i, j] for j in range(3)), 0.0, 0.0, 0.0] for i in range(3)]
    return upper + [[*(change[i, j] for j in range(3)), *(block[i, j] for j in range(3))] for i in range(3)]


def _skew(w: Any) -> list[list[Any]]:
    x, y, z = w
    return [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]


def _product(a: list[list[Any]], b: list[list[Any]]) -> list[list[Any]]:
    return [[_sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def _cross(a: Any, b: Any) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _sum(terms: Any) -> Any:
    return sum(terms, 0.0)
