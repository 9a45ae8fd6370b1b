"""Primitives of rigid-body mechanics: components of bodies, joints and springs.

Each function makes one primitive from the one function that says what it is. Fibres are left-trivialised; 6-vectors are
(angular, linear). Equations of Lohmayer, Capobianco, Leyendecker, sections 4 and 5.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any

import numpy as np

from ephs.mechanics.elements import notation
from ephs.mechanics.shapes.dry import Dry
from ephs.operad import Directory, Path, PortType, Quantity, quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.derive.holonomic import Holonomic
from ephs.semantics.derive.linear import Linear
from ephs.semantics.library import formulas
from ephs.semantics.primitives import structures
from ephs.semantics.primitives.forms import coupled, stored
from ephs.semantics.primitives.primitives import Formula, Irreversible, Kernel, Point, Reversible, Storage, power_ports
from ephs.semantics.primitives.special import squared_turn, turn_ratio
from ephs.semantics.spaces import SE3, Pair, codes, manifold
from ephs.semantics.spaces.decompositions import symmetric_eigenvalues
from ephs.semantics.spaces.rank import TINY
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.verdict import proved

POSES = {"SE3": quantity.pose, "SO3xR3": quantity.direct_pose}
MOMENTA = {"SE3": quantity.body_momentum, "SO3xR3": quantity.direct_momentum}


def kinetic(mass: float, inertia: Array, group: str = "SE3") -> Storage:
    """Kinetic energy ½⟨p|𝕀⁻¹p⟩ of a rigid body about its centre of mass; port p, its effort is the twist.

    Parameters
    ----------
    mass, inertia
        In kg; (3, 3) in kg m².
    """
    whole = np.zeros((6, 6))
    whole[:3, :3] = inertia
    whole[3:, 3:] = mass * np.eye(3)
    inverse = np.linalg.inv(whole)
    inverse = 0.5 * (inverse + inverse.T)
    entries = (("mass", float(mass)), ("inertia", tuple(np.asarray(inertia, dtype=float).ravel().tolist())))
    made = structures.quadratic("kinetic", power_ports(p=MOMENTA[group]), inverse, entries, trusted=True)
    return replace(made, notation=notation.kinetic)


def gravity(weight: Array, group: str = "SE3") -> Storage:
    """Potential ⟨w|r⟩ of a constant force −w on the centre of mass; port q.

    Parameters
    ----------
    weight
        (3,) −m g in N, in world axes.
    """
    w = np.array(weight, dtype=float)
    return stored(
        "gravity",
        power_ports(q=POSES[group]),
        lambda q, weight: weight @ q[4:],
        {"weight": w},
        (("weight", tuple(w.tolist())),),
        printed=False,
        proof=lambda: proved("a pose is even; E reads the position alone, dE = (0, Rᵀ w)", *STATEMENTS["storage"]),
        trusted=True,
    )


def potential(of: Quantity, port: str, energy: Callable[[Array], float], name: str = "potential") -> Storage:
    """Any potential, from a Python function of the coordinates: of a pose the 7-vector, of a joint its coordinates."""
    read = Pair.from_space(of.space).coordinates if of.kind == "relative_pose" else np.array
    return stored(
        name,
        power_ports(**{port: of}),
        lambda **x: energy(read(np.atleast_1d(x[port]))),
        {},
        (("energy", getattr(energy, "__name__", "function")),),
        printed=False,
    )


@cache
def no_potential(of: Quantity, port: str) -> Storage:
    """A storage without energy that records a state; port as named."""
    n = of.space.dim
    return Storage(
        "no_potential",
        power_ports(**{port: of}),
        energy=lambda _x: 0.0,
        gradient=lambda _x: np.zeros(n),
        discrete_gradient=lambda _x, _v: np.zeros(n),
        kernel=Kernel("no_effort", Linear("no_effort")),
        notation=notation.nothing,
        proof=lambda: proved("E = 0", *STATEMENTS["storage"]),
        trusted=True,
    )


def pair_spring(of: Pair, stiffness: Array, rest: Array) -> Storage:
    """Springs ½ k (coordinate − rest)² on the degrees of freedom of a joint; port q_r.

    Raises
    ------
    StructureError
        A rotation vector whose rest is not zero.
    """
    k, zero = np.array(stiffness, dtype=float), np.array(rest, dtype=float)
    if of.code in (codes.SO3, codes.SE3) and np.any(zero[:3]):
        raise StructureError("parameter", of.name, key="rest", found=zero.tolist(), expected="0 for rotations")

    return stored(
        "pair_spring",
        power_ports(q_r=relative(of)),
        lambda q_r: coordinate_energy(of, q_r, k, zero),
        {},
        (("stiffness", tuple(k.tolist())), ("rest", tuple(zero.tolist()))),
        printed=False,
        proof=lambda: proved(
            "poses are even, coordinates are of the rotation itself; d(½ k c²) = k c dc, and d(½ θ²) = θ n",
            *STATEMENTS["storage"],
        ),
        trusted=bool(np.all(np.isfinite(k)) and np.all(np.isfinite(zero))),
    )


def coordinate_energy(of: Pair, q: Any, stiffness: Array, rest: Array) -> Any:
    """½ k (coordinate − rest)² of an element of a joint's group; of a rotation vector ½ k θ², or ½ Σ k_i θ_i²."""
    turns = of.code in (codes.SO3, codes.SE3)
    rotation: Any = 0.0
    if turns and np.ptp(stiffness[:3]):
        ratio = turn_ratio(squared_turn(q[:4]))  # θ_i = ±2 ratio q_i: the sign is squared away
        rotation = 2.0 * ratio * ratio * sum((stiffness[i] * q[1 + i] * q[1 + i] for i in range(3)), 0.0)
    elif turns:
        rotation = 0.5 * stiffness[0] * squared_turn(q[:4])
    first, numbers = (3, q[4:]) if turns else (0, np.atleast_1d(q))
    off = numbers - rest[first:]
    return rotation + 0.5 * sum((k * each * each for k, each in zip(stiffness[first:], off, strict=True)), 0.0)


@cache
def kinematic_coupling(q: Quantity, p: Quantity, q_port: str, p_port: str) -> Reversible:
    """q.f = −p.e, p.f = q.e, trivialised; ports as named."""
    return structures.coupling("pkc", power_ports(**{q_port: q, p_port: p}), trusted=True)


@lru_cache(maxsize=256)
def pair_coupling(of: Pair) -> Reversible:
    """The same of a joint's relative pose and momentum; ports q_r, p_r."""
    return kinematic_coupling(relative(of), joint_momentum(of), "q_r", "p_r")


@cache
def lie_poisson(group: str = "SE3") -> Reversible:
    """Gyroscopic forces p.f = −ad*_{p.e} p.x; port p, whose state it reads."""
    space = manifold(POSES[group].space)
    units = [space.ad(unit) for unit in np.eye(6)]

    def structure(p: Any) -> Any:
        columns = [[-_product(column, p) for column in unit.T] for unit in units]
        return np.array(columns).T, None

    return coupled(
        "lie_poisson",
        power_ports(p=MOMENTA[group]),
        structure,
        reads=(Path.of("p"),),
        label="lie_poisson" if group == "SE3" else "direct_lie_poisson",
        notation=notation.lie_poisson,
        trusted=True,
    )


def _product(row: Array, x: Any) -> Any:
    """Σ rowᵢ xᵢ over the entries that are not zero."""
    return sum((float(a) * b for a, b in zip(row, x, strict=True) if a), 0.0)


@cache
def holonomic(of: Pair, *, on_group: bool = True) -> Reversible:
    """The joint's relation: f = C*λ, 0 = C e, C = [Ad_{I(q_r)⁻¹}, −1, B]; ports p_j1, p_j2, p_r, state port q_r.

    λ is the wrench of body 1 on body 2 in the frame C2, p_r.e the twist of C2 relative to C1 in the axes of C2.

    Parameters
    ----------
    on_group
        Over a step it holds on the group: q_1 o_1 I(q_r) = q_2 o_2 stays true exactly. Else C e = 0 in its middle,
        from which positions drift.
    """
    q_r = Path.of("q_r")
    n = 12 + of.dim
    interface = Directory(
        {
            "p_j1": PortType(quantity.body_momentum, True),
            "p_j2": PortType(quantity.body_momentum, True),
            "p_r": PortType(joint_momentum(of), True),
            "q_r": PortType(relative(of), False),
        }
    )

    def structure(x: Point) -> tuple[Array, Array]:
        return np.zeros((n, n)), joint_matrix(of, x[q_r])

    def discrete(h: float, x0: Point, v: Point, e: Array) -> tuple[Array, Array]:
        middle = joint_matrix(of, of.manifold.retract(x0[q_r], 0.5 * v[q_r]))
        residual = gap_over(of, h, middle, e)
        square = float(e @ e)
        if square <= TINY:  # against overflow of the quotient
            return middle, residual
        return middle + np.outer(residual - middle @ e, e) / square, residual

    basis = columns_of(of)
    parameters = (("pair", of.name), *of.parameters)
    name = "holonomic" if on_group else "velocity_relation"
    return Reversible(
        name,
        interface,
        structure,
        (q_r,),
        discrete if on_group else None,
        parameters,
        6,
        Kernel("holonomic", Holonomic(of.code, of.size, basis, on_group=on_group)),
        notation=notation.holonomic,
        proof=lambda: proved(
            "L = 0, all efforts are odd, q_r is even, and C is made of Ad of a pose, which is even in its quaternion",
            *STATEMENTS["reversible"],
        ),
        trusted=True,
    )


def columns_of(of: Pair) -> tuple[tuple[float, ...], ...]:
    """B of a pair, column by column."""
    return tuple(tuple(column) for column in of.basis.reshape(6, of.dim).T.tolist())


def joint_matrix(of: Pair, x: Array) -> Array:
    """C (6, 12 + d) of a joint at an element x of its group."""
    return np.hstack([SE3.adjoint(SE3.inverse(of.include(x))), -np.eye(6), of.basis])


def gap_over(of: Pair, h: float, middle: Array, e: Array) -> Array:
    """F = log[exp(−½ h u₂) exp(½ h b) exp(h a) exp(½ h b) exp(−½ h u₂)] / h, (6,): how far a joint opens in a step.

    Parameters
    ----------
    middle
        C in the middle of the step.
    e
        (12 + d,) velocities u₁, u₂ of the joint's frames and u_r: a = C₁ u₁, b = B u_r.

    Raises
    ------
    StructureError
        One of the factors turns by half a turn or more.
    """
    along = [-0.5 * h * e[6:12], 0.5 * h * of.basis @ e[12:], h * middle[:, :6] @ e[:6]]
    if any(w[:3] @ w[:3] >= np.pi**2 for w in along):
        raise StructureError("rotation", of.name)
    side, half, inner = (SE3.exp(w) for w in along)
    around = side
    for factor in (half, inner, half, side):
        around = SE3.compose(around, factor)
    return SE3.log(around) / h


def joint_friction(
    of: Pair, mu: Array | Callable[[Array, Array, float], Array], name: str = "joint_friction"
) -> Irreversible:
    """Friction p_r.f = μ u_r of a joint, s.f = −μ(u_r, u_r)/θ; ports p_r, s.

    Parameters
    ----------
    mu
        (d, d) symmetric and non-negative, or a Python function of (coordinates, u_r, θ), which reads q_r.
    """
    if not callable(mu):
        return _linear_friction(of, tuple(np.asarray(mu, dtype=float).ravel().tolist()), name)
    q_r = Path.of("q_r")
    resistance = mu
    ports = {
        "p_r": PortType(joint_momentum(of), True),
        "s": PortType(quantity.entropy, True),
        "q_r": PortType(relative(of), False),
    }
    made = structures.dissipation(
        name,
        Directory(ports),
        lambda x, u, theta: np.asarray(resistance(of.coordinates(x[q_r]), u, theta)).reshape(of.dim, of.dim),
        parameters=(("mu", getattr(mu, "__name__", "function")),),
    )
    return replace(made, notation=notation.friction)


@lru_cache(maxsize=256)
def _linear_friction(of: Pair, mu: tuple[float, ...], name: str) -> Irreversible:
    """The same with a constant μ, row by row; many joints of a mechanism have the same."""
    matrix = np.array(mu).reshape(of.dim, of.dim)
    sound = bool(np.all(np.isfinite(matrix))) and _dissipates(matrix)
    ports = power_ports(p_r=joint_momentum(of), s=quantity.entropy)
    made = structures.dissipation(name, ports, matrix, parameters=(("mu", mu),), trusted=sound)
    return replace(made, notation=notation.friction)


def dry_friction(of: Pair, mu: float, dry: Dry) -> Irreversible:
    """Friction μ of a joint with one degree of freedom, in N m s or N s/m, and dry friction; ports p_r, s.

    Raises
    ------
    StructureError
        The joint has not one degree of freedom.
    """
    if of.dim != 1:
        found = f"dry friction of a joint with {of.dim} degrees of freedom"
        raise StructureError("parameter", of.name, key="dry", found=found, expected="one degree of freedom")
    ports = Directory({"p_r": PortType(joint_momentum(of), True), "s": PortType(quantity.entropy, True)})

    def resistance(_x: Any, u: Any, _theta: Any) -> Any:
        return [[mu + dry.resistance(u[0])]]

    made = structures.dissipation(
        "dry_friction",
        ports,
        resistance,
        parameters=(("viscous", mu), *dry.numbers),
        shown=lambda: structures.dissipation_proof(ports, None),
        trusted=True,
    )
    return replace(made, notation=notation.friction)


def _dissipates(mu: Array) -> bool:
    """Whether μ is exactly symmetric and certainly non-negative."""
    return not mu.any() or (np.array_equal(mu, mu.T) and float(symmetric_eigenvalues(mu)[0]) >= 0.0)


@cache
def ground(of: Quantity = quantity.body_momentum) -> Reversible:
    """Fixed frame: e = 0, f = λ; port p."""
    n = of.space.dim
    return structures.constant_structure("ground", power_ports(p=of), np.zeros((n, n)), np.eye(n))


def thermal_node(capacity: float, temperature: float) -> Storage:
    """Heat capacity C from temperature T₀ at s = 0: E = C T₀ (exp(s/C) − 1); port s. C in J/K, T₀ in K."""
    entries = (("capacity", float(capacity)), ("temperature", float(temperature)))
    formula = Formula(formulas.thermal_node, ("capacity", "temperature"), formulas.thermal_node_slope)
    return structures.exponential("thermal_node", capacity * temperature, capacity, entries, formula)


@lru_cache(maxsize=256)
def relative(of: Pair) -> Quantity:
    """The quantity of a joint's q_r."""
    return quantity.relative_pose(of.name, **dict(of.parameters))


@lru_cache(maxsize=256)
def joint_momentum(of: Pair) -> Quantity:
    """The quantity of a joint's p_r."""
    return quantity.joint_momentum(of.name, **dict(of.parameters))
