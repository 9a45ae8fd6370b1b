"""Beam elements: a six-freedom joint between two cross-sections whose relative pose carries the strain energy.

An element of length L between the frames H₁ and H₂ has the strain ξ = log(H₁⁻¹H₂)/L: torsion and two curvatures, then
stretch (1 where there is none) and two shears, in axes whose first one is the tangent. Its energy is
L/2 (ξ − ξ₀)ᵀ K (ξ − ξ₀); Kelvin–Voigt damping resists ξ̇ = T⁻¹ u_r / L with τ K, which on u_r is the resistance
μ = T⁻ᵀ τ K T⁻¹ / L, T⁻¹ the derivative of the logarithm. Everything else is a joint's. Geometrically exact, unchanged
by rigid motions, free of locking in pure bending; with lumped nodes of order 2 in the length of the elements.
"""

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.mechanics.elements import components, notation
from ephs.mechanics.elements.joints import between_frames
from ephs.operad import Directory, Path, PortType, quantity
from ephs.semantics import structures
from ephs.semantics.bundle import Array
from ephs.semantics.checks import STATEMENTS
from ephs.semantics.errors import StructureError
from ephs.semantics.forms import stored
from ephs.semantics.primitives import Irreversible, Storage, power_ports
from ephs.semantics.spaces import SE3, pair
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.special import squared_turn, turn_curve, turn_curve_slope, turn_ratio
from ephs.semantics.system import System
from ephs.semantics.verdict import proved

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = [
    "beam_damper",
    "beam_element",
    "beam_spring",
    "displacement",
    "elastic",
    "element_force",
    "logarithm",
    "strain_energy",
    "strain_resistance",
]

RELATIVE = quantity.relative_pose("free")


def beam_element(
    frame1: "ArrayLike | None" = None,
    frame2: "ArrayLike | None" = None,
    *,
    length: float,
    stiffness: "ArrayLike",
    rest: "ArrayLike" = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0),
    damping: float = 0.0,
    heat: bool = False,
) -> System:
    """A geometrically exact beam element between two bodies: a free joint with the energy of a strain.

    Parameters
    ----------
    frame1, frame2
        (7,) poses of the cross-sections in bodies 1 and 2, axis 1 along the tangent; the body's own where None.
    length
        L in m, of the element without force.
    stiffness
        (6,) GJ, EI₂, EI₃ in N m², EA, GA₂, GA₃ in N.
    rest
        (6,) strain without force: torsion and curvatures in 1/m, stretch (1: none) and shears.
    damping
        Kelvin–Voigt time in s.
    heat
        As of a `joint`.

    Raises
    ------
    StructureError
        A parameter of a wrong shape or value.
    """
    k, zero = np.asarray(stiffness, dtype=float), np.asarray(rest, dtype=float)
    one, two = (SE3.identity() if frame is None else np.asarray(frame, dtype=float) for frame in (frame1, frame2))
    parts = elastic(length, k, zero, damping)
    return between_frames(SE3.compose(one, SE3.exp(length * zero)), two, *parts, heat=heat)


def elastic(length: float, stiffness: Array, rest: Array, damping: float) -> tuple[Storage, Irreversible]:
    """Energy and loss of an element; equal elements share them."""
    return _elastic(float(length), tuple(stiffness.tolist()), tuple(rest.tolist()), float(damping))


@lru_cache(maxsize=1024)
def _elastic(
    length: float, stiffness: tuple[float, ...], rest: tuple[float, ...], damping: float
) -> tuple[Storage, Irreversible]:
    k, zero = np.array(stiffness), np.array(rest)
    if damping:
        return beam_spring(length, k, zero), beam_damper(length, k, zero, damping)
    return beam_spring(length, k, zero), components.joint_friction(pair("free"), np.zeros((6, 6)))


def beam_spring(length: float, stiffness: Array, rest: Array) -> Storage:
    """L/2 (ξ − ξ₀)ᵀ K (ξ − ξ₀); port q_r of the free pair, the pose relative to exp(L ξ₀): 1 where there is no force.

    Parameters
    ----------
    length
        L in m.
    stiffness
        (6,) diagonal of K: GJ, EI₂, EI₃ in N m², EA, GA₂, GA₃ in N.
    rest
        (6,) ξ₀, the strain without force: 1/m, and numbers.

    Raises
    ------
    StructureError
        A number is not finite, the length not positive, or a stiffness negative.
    """
    k, zero = _checked(length, stiffness, rest)
    return stored(
        "beam_spring",
        power_ports(q_r=RELATIVE),
        lambda q_r: strain_energy(q_r, length, k, zero),
        {},
        (("length", float(length)), ("stiffness", tuple(k.tolist())), ("rest", tuple(zero.tolist()))),
        printed=False,
        proof=lambda: proved(
            "poses are even, and log reads q and −q alike; dE = L T⁻ᵀ K (ξ − ξ₀) / L", *STATEMENTS["storage"]
        ),
        trusted=True,
    )


def beam_damper(length: float, stiffness: Array, rest: Array, damping: float) -> Irreversible:
    """Kelvin–Voigt damping μ(q_r) = T⁻ᵀ τ K T⁻¹ / L; ports p_r, s, reads q_r as `beam_spring` does; τ in s.

    Raises
    ------
    StructureError
        As `beam_spring`, or the damping is negative.
    """
    k, zero = _checked(length, stiffness, rest)
    if not 0.0 <= damping < np.inf:
        raise StructureError("parameter", "beam", key="damping", found=damping, expected="a number ≥ 0")
    q_r = Path.of("q_r")
    ports = Directory(
        {
            "p_r": PortType(quantity.joint_momentum("free"), True),
            "s": PortType(quantity.entropy, True),
            "q_r": PortType(RELATIVE, False),
        }
    )
    made = structures.dissipation(
        "beam_damper",
        ports,
        lambda x, _u, _theta: strain_resistance(x[q_r], length, k, zero, damping),
        parameters=(
            ("length", float(length)),
            ("stiffness", tuple(k.tolist())),
            ("rest", tuple(zero.tolist())),
            ("damping", float(damping)),
        ),
        shown=lambda: structures.dissipation_proof(ports, None),
        trusted=True,
    )
    return replace(made, notation=notation.friction)


def strain_energy(pose: Any, length: float, stiffness: Array, rest: Array) -> Any:
    """L/2 (ξ − ξ₀)ᵀ K (ξ − ξ₀) of a pose relative to the one without force, of numbers or what is recorded."""
    terms = zip(displacement(pose, length, rest), stiffness, strict=True)
    return sum((0.5 * k / length * d * d for d, k in terms if k), 0.0)


def strain_resistance(pose: Any, length: float, stiffness: Array, rest: Array, damping: float) -> Any:
    """(6, 6) resistance of a relative pose to its own twist, of numbers or what is recorded."""
    rate = _logarithm_rate(_whole(pose, length * rest))
    weights = np.sqrt(stiffness * damping / length)
    rows = [[w * entry for entry in row] for w, row in zip(weights, rate, strict=True) if w]
    return [[_sum(row[i] * row[j] for row in rows) for j in range(6)] for i in range(6)]


def displacement(pose: Any, length: float, rest: Array) -> list[Any]:
    """(6,) L (ξ − ξ₀) = log(d₀ q) − log d₀, d₀ = exp(L ξ₀), of a pose q, without a difference of large numbers.

    With log d = (ω, r − ½ ω × r + c ω × (ω × r)), r = r₀ + R₀ x, every term below is small where q is near 1. Stiff
    rods need that: what rounding leaves of a strain counts with EA.
    """
    base = length * np.asarray(rest, dtype=float)
    turn, start = base[:3], SE3.exp(base)
    whole = _whole(pose, base)
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


def element_force(length: float, stiffness: Array, rest: Array, damping: float, poses: Array, rates: Array) -> Array:
    """(n, 6) what an element does on u_r, at relative poses (n, 7) and rates (n, 6): −dE − μ u_r."""
    rows = np.asarray(poses, dtype=float).T
    rate = _logarithm_rate(_whole(rows, length * rest))
    speed = [_sum(row[j] * u for j, u in enumerate(rates.T)) for row in rate]
    stress = [
        k / length * (d + damping * v)
        for k, d, v in zip(stiffness, displacement(rows, length, rest), speed, strict=True)
    ]
    out = [-_sum(rate[i][j] * stress[i] for i in range(6)) for j in range(6)]
    return np.column_stack([np.broadcast_to(x, len(poses)) for x in out])


def logarithm(pose: Any) -> list[Any]:
    """(6,) log of a pose (7,), angular part first, up to half a turn; of numbers or what is recorded."""
    square = squared_turn(pose[:4])
    w = _rotation_vector(pose, square)
    r = list(pose[4:])
    side = _cross(w, r)
    far = _cross(w, side)
    c = turn_curve(square)
    return [*w, *(r[i] - 0.5 * side[i] + c * far[i] for i in range(3))]


def _whole(pose: Any, base: Array) -> list[Any]:
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


def _logarithm_rate(pose: Any) -> list[list[Any]]:
    """(6, 6) T⁻¹: what a left-trivialised change of a pose does to its logarithm.

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


def _checked(length: float, stiffness: Array, rest: Array) -> tuple[Array, Array]:
    k, zero = np.array(stiffness, dtype=float), np.array(rest, dtype=float)
    for key, found, sound, expected in (
        ("length", length, 0.0 < length < np.inf, "a number > 0"),
        ("stiffness", k.tolist(), k.shape == (6,) and bool(np.all((k >= 0.0) & (k < np.inf))), "6 numbers ≥ 0"),
        ("rest", zero.tolist(), zero.shape == (6,) and bool(np.all(np.isfinite(zero))), "6 finite numbers"),
    ):
        if not sound:
            raise StructureError("parameter", "beam", key=key, found=found, expected=expected)
    return k, zero
