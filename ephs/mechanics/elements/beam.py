"""Beam elements: a six-degree-of-freedom joint between two cross-sections whose relative pose carries the strain
energy.

An element of length L between the frames H₁ and H₂ has the mean strain ξ = log(H₁⁻¹H₂)/L: torsion and two curvatures,
then stretch (1 where there is none) and two shears, in axes whose first one is the tangent. `strain` has its energy.
Kelvin–Voigt damping resists ξ̇ = T⁻¹ u_r / L with τ times the stiffness, T⁻¹ the derivative of the logarithm.
Everything else is a joint's. Geometrically exact, unchanged by rigid motions, free of locking.

An element that expands with heat has its heat and part of its energy in a storage of its lengthening e and its entropy
s, `thermoelastic`: where θ is its temperature, its axial force is EA (ξ₄ − 1) − κ (θ − θ₀), κ = EA α.
"""

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.mechanics.elements import components, notation
from ephs.mechanics.elements.joints import between_frames
from ephs.mechanics.elements.strain import ORDERS, strain_energy, strain_resistance, stretching, turning_resistance
from ephs.operad import Directory, Path, PortType, quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.library import formulas
from ephs.semantics.primitives import structures
from ephs.semantics.primitives.forms import coupled, stored
from ephs.semantics.primitives.primitives import Irreversible, Reversible, Storage, power_ports
from ephs.semantics.spaces import SE3, pair
from ephs.semantics.systems.system import System
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.verdict import proved

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

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
    order: int = 2,
    expands: bool = False,
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
    order
        2, or 4: the energy of `strain` by which rest converges with shorter elements.
    expands
        Its lengthening leaves through the port e, for a `thermoelastic` storage that takes its heat, too.

    Raises
    ------
    StructureError
        A parameter of a wrong shape or value.
    """
    k, zero = np.asarray(stiffness, dtype=float), np.asarray(rest, dtype=float)
    one, two = (SE3.identity() if frame is None else np.asarray(frame, dtype=float) for frame in (frame1, frame2))
    parts = elastic(length, k, zero, damping, order)
    stretch = beam_stretch(float(length), tuple(zero.tolist())) if expands else None
    return between_frames(SE3.compose(one, SE3.exp(length * zero)), two, *parts, heat=heat, stretch=stretch)


def elastic(
    length: float, stiffness: Array, rest: Array, damping: float, order: int = 2
) -> tuple[Storage, Irreversible]:
    """Energy and loss of an element; equal elements share them."""
    return _elastic(float(length), tuple(stiffness.tolist()), tuple(rest.tolist()), float(damping), order)


@lru_cache(maxsize=1024)
def _elastic(
    length: float, stiffness: tuple[float, ...], rest: tuple[float, ...], damping: float, order: int
) -> tuple[Storage, Irreversible]:
    k, zero = np.array(stiffness), np.array(rest)
    if damping:
        return beam_spring(length, k, zero, order), beam_damper(length, k, zero, damping, order)
    return beam_spring(length, k, zero, order), components.joint_friction(pair("free"), np.zeros((6, 6)))


def beam_spring(length: float, stiffness: Array, rest: Array, order: int = 2) -> Storage:
    """Strain energy; port q_r of the free pair, the pose relative to exp(L ξ₀): 1 where there is no force.

    Parameters
    ----------
    length
        L in m.
    stiffness
        (6,) diagonal of K: GJ, EI₂, EI₃ in N m², EA, GA₂, GA₃ in N.
    rest
        (6,) ξ₀, the strain without force: 1/m, and numbers.
    order
        2 or 4, as of `strain`.

    Raises
    ------
    StructureError
        A number is not finite, the length not positive, a stiffness negative, or zero at order 4.
    """
    k, zero = _checked(length, stiffness, rest, order)
    return stored(
        "beam_spring",
        power_ports(q_r=RELATIVE),
        lambda q_r: strain_energy(q_r, length, k, zero, order),
        {},
        _numbers(length, k, zero, order),
        printed=False,
        proof=lambda: proved(
            "poses are even, and log reads q and −q alike; dE = L T⁻ᵀ K (ξ − ξ₀) / L", *STATEMENTS["storage"]
        ),
        trusted=True,
    )


def beam_damper(length: float, stiffness: Array, rest: Array, damping: float, order: int = 2) -> Irreversible:
    """Kelvin–Voigt damping μ(q_r) = T⁻ᵀ τ K T⁻¹ / L; ports p_r, s, reads q_r as `beam_spring` does; τ in s.

    Raises
    ------
    StructureError
        As `beam_spring`, or the damping is negative.
    """
    k, zero = _checked(length, stiffness, rest, order)
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
        lambda x, _u, _theta: strain_resistance(x[q_r], length, k, zero, damping, order),
        parameters=(*_numbers(length, k, zero, order), ("damping", float(damping))),
        shown=lambda: structures.dissipation_proof(ports, None),
        trusted=True,
    )
    return replace(made, notation=notation.friction)


def hinge_damper(friction: Array) -> Irreversible:
    """Friction D (3, 3) of a spherical joint on the rate of its rotation vector; ports p_r, s, reads q_r.

    With a multiple of the stiffness it is the Kelvin–Voigt damping of a rod whose pieces meet there. On the angular
    velocity, in the axes of one body, it would depend on which body is named first where D differs by axis.
    """
    d, q_r, of = np.asarray(friction, dtype=float).reshape(3, 3), Path.of("q_r"), "spherical"
    ports = Directory(
        {
            "p_r": PortType(quantity.joint_momentum(of), True),
            "s": PortType(quantity.entropy, True),
            "q_r": PortType(quantity.relative_pose(of), False),
        }
    )
    made = structures.dissipation(
        "hinge_damper", ports, lambda x, _u, _theta: turning_resistance(x[q_r], d),
        parameters=(("mu", tuple(d.ravel().tolist())),), shown=lambda: structures.dissipation_proof(ports, None),
        trusted=True,
    )  # fmt: skip
    return replace(made, notation=notation.friction)


@lru_cache(maxsize=1024)
def beam_stretch(length: float, rest: tuple[float, ...]) -> Reversible:
    """Lengthening of an element at the rate L ξ̇₄ = w·u_r: e.f = −w p_r.e, p_r.f = w e.e; reads q_r as `beam_spring`.

    Parameters
    ----------
    length, rest
        L in m, (6,) ξ₀, as of a `beam_spring`.
    """
    zero = np.array(rest)

    def structure(q_r: Any) -> Any:
        row = stretching(q_r, length, zero)
        return [*([0.0] * 6 + [w] for w in row), [*(-w for w in row), 0.0]], None

    ports = Directory(
        {
            "p_r": PortType(quantity.joint_momentum("free"), True),
            "e": PortType(quantity.displacement, True),
            "q_r": PortType(RELATIVE, False),
        }
    )
    return coupled(
        "beam_stretch",
        ports,
        structure,
        parameters=(("length", length), ("rest", rest)),
        notation=notation.lengthening,
        proof=lambda: proved(
            "L = [[0, w], [−wᵀ, 0]], w even in q_r, which reads q and −q alike", *STATEMENTS["reversible"]
        ),
        trusted=True,
    )


def thermoelastic(capacity: float, temperature: float, pull: float, reference: float) -> Storage:
    """Heat of a solid that expands: E = κ θ₀ e + C θ₁ (exp((s − κ e)/C) − 1), so e.e = κ (θ₀ − θ); ports e, s.

    Parameters
    ----------
    capacity
        C in J/K at constant length.
    temperature
        θ₁ in K at e = 0, s = 0.
    pull
        κ in N/K: modulus × section × coefficient of expansion.
    reference
        θ₀ in K, at which it exerts no force.

    Raises
    ------
    StructureError
        A number is not finite, or one but the pull not positive.
    """
    numbers = {"capacity": capacity, "temperature": temperature, "pull": pull, "reference": reference}
    for key, found in numbers.items():
        if not (np.isfinite(found) and (key == "pull" or found > 0.0)):
            expected = "a finite number" if key == "pull" else "a number > 0"
            raise StructureError("parameter", "thermoelastic", key=key, found=found, expected=expected)
    ports = power_ports(e=quantity.displacement, s=quantity.entropy)
    return stored("thermoelastic", ports, formulas.thermoelastic, {key: float(x) for key, x in numbers.items()})


def _numbers(length: float, stiffness: Array, rest: Array, order: int) -> tuple[tuple[str, object], ...]:
    """The parameters of a part, as documents have them."""
    strain = (("length", float(length)), ("stiffness", tuple(stiffness.tolist())), ("rest", tuple(rest.tolist())))
    return (*strain, ("order", order))


def _checked(length: float, stiffness: Array, rest: Array, order: int) -> tuple[Array, Array]:
    k, zero = np.array(stiffness, dtype=float), np.array(rest, dtype=float)
    for key, found, sound, expected in (
        ("length", length, 0.0 < length < np.inf, "a number > 0"),
        ("stiffness", k.tolist(), k.shape == (6,) and bool(np.all((k >= 0.0) & (k < np.inf))), "6 numbers ≥ 0"),
        ("order", order, order in ORDERS, "2 or 4"),
        ("stiffness", k.tolist(), order == 2 or bool(np.all(k > 0.0)), "6 numbers > 0 at order 4"),
        ("rest", zero.tolist(), zero.shape == (6,) and bool(np.all(np.isfinite(zero))), "6 finite numbers"),
    ):
        if not sound:
            raise StructureError("parameter", "beam", key=key, found=found, expected=expected)
    return k, zero
