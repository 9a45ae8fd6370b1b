"""The primitives of rigid-body mechanics: what the boxes of bodies, joints and springs are filled with.

Each function makes one primitive, in the plain form that is checked and shown, and names its compiled kernel. Fibres
are left-trivialised; 6-vectors are (angular, linear). Equations of Lohmayer, Capobianco, Leyendecker, sections 4 and 5.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from ephs.mechanics import notation
from ephs.operad import Directory, Path, PortType, Quantity, quantity
from ephs.semantics import formulas, structures
from ephs.semantics.bundle import Array
from ephs.semantics.checks import STATEMENTS
from ephs.semantics.errors import StructureError
from ephs.semantics.primitives import Formula, Irreversible, Kernel, Point, Reversible, Storage, power_ports
from ephs.semantics.spaces import SE3, SO3, Pair, codes, manifold
from ephs.semantics.spaces.rotations import quaternion_to_matrix, rotation_dexp
from ephs.semantics.verdict import Condition, proved

__all__ = [
    "frame_change",
    "gravity",
    "ground",
    "holonomic",
    "joint_friction",
    "kinematic_coupling",
    "kinetic",
    "lie_poisson",
    "no_potential",
    "pair_spring",
    "potential",
    "thermal_node",
]

KERNELS = "ephs.mechanics.kernels"
HOLONOMIC = "ephs.mechanics.holonomic_kernels"
SPRINGS = "ephs.mechanics.spring_kernels"
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

    Its discrete gradient (0, (R⁰ V(v_ω))ᵀ w) is exact for r¹ = r⁰ + R⁰ V(v_ω) v_υ.

    Parameters
    ----------
    weight
        (3,) −m g in N, in world axes.
    """
    w = np.array(weight, dtype=float)
    q = Path.of("q")
    turning = group == "SE3"

    def gradient(x: Point) -> Array:
        force = quaternion_to_matrix(x[q][:4]).T @ w if turning else w
        return np.concatenate([np.zeros(3), force])

    def discrete_gradient(x0: Point, v: Array) -> Array:
        force = rotation_dexp(v[:3]).T @ (quaternion_to_matrix(x0[q][:4]).T @ w) if turning else w
        return np.concatenate([np.zeros(3), force])

    return Storage(
        "gravity",
        power_ports(q=POSES[group]),
        energy=lambda x: float(w @ x[q][4:]),
        gradient=gradient,
        discrete_gradient=discrete_gradient,
        parameters=(("weight", tuple(w.tolist())),),
        kernel=Kernel(KERNELS, "gravity" if turning else "direct_gravity", tuple(w.tolist())),
        proof=lambda: proved("a pose is even; E reads the position alone, dE = (0, Rᵀ w)", *STATEMENTS["storage"]),
        trusted=True,
    )


def potential(of: Quantity, port: str, energy: Callable[[Array], float], name: str = "potential") -> Storage:
    """Any potential, from a Python function of the coordinates: of a pose the 7-vector, of a joint its coordinates."""
    at = Path.of(port)
    read = Pair.from_space(of.space).coordinates if of.kind == "relative_pose" else np.array
    return Storage(
        name,
        power_ports(**{port: of}),
        energy=lambda x: float(energy(read(x[at]))),
        parameters=(("energy", getattr(energy, "__name__", "function")),),
    )


@cache
def no_potential(of: Quantity, port: str) -> Storage:
    """No energy, yet the state is kept; port as named."""
    n = of.space.dim
    return Storage(
        "no_potential",
        power_ports(**{port: of}),
        energy=lambda _x: 0.0,
        gradient=lambda _x: np.zeros(n),
        discrete_gradient=lambda _x, _v: np.zeros(n),
        kernel=Kernel(structures.KERNELS, "no_effort"),
        notation=notation.nothing,
        proof=lambda: proved("E = 0", *STATEMENTS["storage"]),
        trusted=True,
    )


def pair_spring(of: Pair, stiffness: Array, rest: Array) -> Storage:
    """Springs ½ k (coordinate − rest)² on the freedoms of a joint; port q_r.

    Raises
    ------
    StructureError
        A rotation vector whose stiffness is not isotropic, or whose rest is not zero.
    """
    k, zero = np.array(stiffness, dtype=float), np.array(rest, dtype=float)
    at = Path.of("q_r")
    if of.code in (codes.SO3, codes.SE3):
        if np.ptp(k[:3]):
            raise StructureError(
                "parameter", of.name, key="stiffness", found=k.tolist(), expected="equal for rotations"
            )
        if np.any(zero[:3]):
            raise StructureError("parameter", of.name, key="rest", found=zero.tolist(), expected="0 for rotations")

    def energy(x: Point) -> float:
        off = of.coordinates(x[at]) - zero
        return 0.5 * float(k @ (off * off))

    turning = 3 if of.code in (codes.SO3, codes.SE3) else 1 if of.code == codes.SE2 else of.dim

    def gradient(x: Point) -> Array:
        return discrete_gradient(x, np.zeros(of.dim))

    def discrete_gradient(x0: Point, v: Array) -> Array:
        start, end = x0[at], of.manifold.retract(x0[at], v)
        mean = 0.5 * (of.coordinates(start) + of.coordinates(end)) - zero
        pull = k * mean
        if of.code in (codes.SO3, codes.SE3):
            pull[:3] = k[0] * _rotation_mean(start[:4], v[:3])
        pull[turning:] = _mean_turn(of, start, v).T @ pull[turning:]
        return pull

    return Storage(
        "pair_spring",
        power_ports(q_r=_relative(of)),
        energy,
        gradient,
        discrete_gradient,
        (("stiffness", tuple(k.tolist())), ("rest", tuple(zero.tolist()))),
        kernel=Kernel(SPRINGS, "coordinate_spring", (float(of.code), *k.tolist(), *zero.tolist())),
        proof=lambda: proved(
            "poses are even, coordinates are of the rotation itself; d(½ k c²) = k c dc, and d(½ θ²) = θ n",
            *STATEMENTS["storage"],
        ),
        trusted=bool(np.all(np.isfinite(k)) and np.all(np.isfinite(zero))),
    )


def _mean_turn(of: Pair, start: Array, v: Array) -> Array:
    """The mean over a step of the rotation by which distances are trivialised: displacement = mean · v."""
    if of.code == codes.SE3:
        return quaternion_to_matrix(start[:4]) @ rotation_dexp(v[:3])
    if of.code == codes.SE2:
        half = 0.5 * float(v[0])
        c, s, mean = np.cos(start[0] + half), np.sin(start[0] + half), np.sinc(half / np.pi)
        return mean * np.array([[c, -s], [s, c]])
    return np.zeros((0, 0))


def _rotation_mean(start: Array, v: Array) -> Array:
    """The discrete gradient of ½ θ² of a rotation: ω at the middle, corrected along v without cancellation."""
    middle = SO3.retract(start, 0.5 * v)
    omega = SO3.log(middle)
    square = float(v @ v)
    if square == 0.0:
        return omega
    change = float(middle[1:] @ v) * 0.25 * np.sinc(0.25 * np.sqrt(square) / np.pi)  # half that of cos(θ/2)
    ends = [q if q @ middle >= 0.0 else -q for q in (start, SO3.retract(start, v))]  # on the sheet of the middle
    first, last = (2.0 * np.arctan2(np.linalg.norm(q[1:]), q[0]) for q in ends)
    if max(first, last) > np.pi:  # past half a turn it is shorter the other way
        first, last = min(first, 2.0 * np.pi - first), min(last, 2.0 * np.pi - last)
        rise = last - first
    else:
        between = np.sin(0.25 * (first + last))
        rise = 4.0 * np.arcsin(np.clip(change / between, -1.0, 1.0)) if between > 0.0 else 0.0
    return omega + (0.5 * (first + last) * rise - float(omega @ v)) / square * v


@cache
def kinematic_coupling(q: Quantity, p: Quantity, q_port: str, p_port: str) -> Reversible:
    """q.f = −p.e, p.f = q.e, trivialised; ports as named."""
    return structures.coupling("pkc", power_ports(**{q_port: q, p_port: p}), trusted=True)


@cache
def lie_poisson(group: str = "SE3") -> Reversible:
    """Gyroscopic forces p.f = −ad*_{p.e} p.x; port p, whose state it reads."""
    p = Path.of("p")
    space = manifold(POSES[group].space)

    def structure(x: Point) -> tuple[Array, Array]:
        columns = [-space.ad(unit).T @ x[p] for unit in np.eye(6)]
        return np.array(columns).T, np.zeros((0, 6))

    name = "lie_poisson" if group == "SE3" else "direct_lie_poisson"
    kernel = Kernel(KERNELS, name)
    ports = power_ports(p=MOMENTA[group])

    def proof() -> tuple[Condition, ...]:
        from ephs.semantics.symbols.proofs import conditions_of

        formula = Formula(lambda **x: structure({p: x["p"]}))
        return conditions_of(Reversible("lie_poisson", ports, structure, reads=(p,), formula=formula, trusted=True))

    return Reversible(
        "lie_poisson", ports, structure, reads=(p,), kernel=kernel, notation=notation.lie_poisson, proof=proof,
        trusted=True,
    )  # fmt: skip


def frame_change(offset: Array, inner: str, outer: str) -> Reversible:
    """Momentum carried from a body's frame (port ``outer``) to a joint frame (port ``inner``) at a constant offset o.

    inner.e = Ad_{o⁻¹} outer.e, outer.f = −Ad*_{o⁻¹} inner.f.
    """
    carried = SE3.adjoint(SE3.inverse(np.asarray(offset, dtype=float)))
    interface = power_ports(**{outer: quantity.body_momentum, inner: quantity.body_momentum})
    parameters = (("offset", tuple(np.asarray(offset, dtype=float).tolist())),)
    constraint = np.hstack([-carried, np.eye(6)])
    made = structures.constant_structure(
        "frame_change", interface, np.zeros((12, 12)), constraint, parameters, trusted=True
    )
    return replace(made, notation=notation.frame_change)


@cache
def holonomic(of: Pair) -> Reversible:
    """The joint's relation: f = C*λ, 0 = C e, C = [Ad_{I(q_r)⁻¹}, −1, B]; ports p_j1, p_j2, p_r, state port q_r.

    λ is the wrench of body 1 on body 2 in the frame C2, p_r.e the twist of C2 relative to C1 in the axes of C2. Over a
    step it holds on the group: q_1 o_1 I(q_r) = q_2 o_2 stays true exactly.
    """
    q_r = Path.of("q_r")
    n, d = 12 + of.dim, of.dim
    interface = Directory(
        {
            "p_j1": PortType(quantity.body_momentum, True),
            "p_j2": PortType(quantity.body_momentum, True),
            "p_r": PortType(_joint_momentum(of), True),
            "q_r": PortType(_relative(of), False),
        }
    )

    def constraint(pose: Array) -> Array:
        return np.hstack([SE3.adjoint(SE3.inverse(pose)), -np.eye(6), of.basis])

    def structure(x: Point) -> tuple[Array, Array]:
        return np.zeros((n, n)), constraint(of.include(x[q_r]))

    def discrete(h: float, x0: Point, v: Point, e: Array) -> tuple[Array, Array]:
        middle = constraint(of.include(of.manifold.retract(x0[q_r], 0.5 * v[q_r])))
        along = [-0.5 * h * e[6:12], 0.5 * h * of.basis @ e[12:], h * middle[:, :6] @ e[:6]]
        if any(w[:3] @ w[:3] >= np.pi**2 for w in along):
            raise StructureError("rotation", of.name)
        side, half, inner = (SE3.exp(w) for w in along)
        around = side
        for factor in (half, inner, half, side):
            around = SE3.compose(around, factor)
        residual = SE3.log(around) / h
        square = float(e @ e)
        if square <= 1e-280:  # only to keep the quotient from overflowing
            return middle, residual
        return middle + np.outer(residual - middle @ e, e) / square, residual

    kernel = Kernel(HOLONOMIC, "holonomic", (float(of.code), *of.basis.reshape(6, d).ravel().tolist()))
    parameters = (("pair", of.name), *of.parameters)
    return Reversible(
        "holonomic",
        interface,
        structure,
        (q_r,),
        discrete,
        parameters,
        6,
        kernel,
        notation=notation.holonomic,
        proof=lambda: proved(
            "L = 0, all efforts are odd, q_r is even, and C is made of Ad of a pose, which is even in its quaternion",
            *STATEMENTS["reversible"],
        ),
        trusted=True,
    )


def joint_friction(
    of: Pair, mu: Array | Callable[[Array, Array, float], Array], name: str = "joint_friction"
) -> Irreversible:
    """Friction p_r.f = μ u_r of a joint, s.f = −μ(u_r, u_r)/θ; ports p_r, s.

    Parameters
    ----------
    mu
        (d, d) symmetric and non-negative, or a Python function of (coordinates, u_r, θ), which reads q_r.
    """
    ports = {"p_r": PortType(_joint_momentum(of), True), "s": PortType(quantity.entropy, True)}
    if not callable(mu):
        matrix = np.array(mu, dtype=float).reshape(of.dim, of.dim)
        entries = (("mu", tuple(matrix.ravel().tolist())),)
        sound = bool(np.all(np.isfinite(matrix))) and _dissipates(matrix)
        made = structures.dissipation(name, Directory(ports), matrix, parameters=entries, trusted=sound)
        return replace(made, notation=notation.friction)
    q_r = Path.of("q_r")
    resistance = mu
    ports["q_r"] = PortType(_relative(of), False)
    made = structures.dissipation(
        name,
        Directory(ports),
        lambda x, u, theta: np.asarray(resistance(of.coordinates(x[q_r]), u, theta), dtype=float).reshape(
            of.dim, of.dim
        ),
        reads=(q_r,),
        parameters=(("mu", getattr(mu, "__name__", "function")),),
    )
    return replace(made, notation=notation.friction)


def _dissipates(mu: Array) -> bool:
    """Whether μ is exactly symmetric and certainly non-negative."""
    return not mu.any() or (np.array_equal(mu, mu.T) and float(np.linalg.eigvalsh(mu)[0]) >= 0.0)


@cache
def ground(of: Quantity = quantity.body_momentum) -> Reversible:
    """A frame that stands still: e = 0, f = λ; port p."""
    n = of.space.dim
    return structures.constant_structure("ground", power_ports(p=of), np.zeros((n, n)), np.eye(n))


def thermal_node(capacity: float, temperature: float) -> Storage:
    """Heat capacity C from temperature T₀ at s = 0: E = C T₀ (exp(s/C) − 1); port s. C in J/K, T₀ in K."""
    entries = (("capacity", float(capacity)), ("temperature", float(temperature)))
    formula = Formula(formulas.thermal_node, ("capacity", "temperature"), formulas.thermal_node_slope)
    return structures.exponential("thermal_node", capacity * temperature, capacity, entries, formula)


def _relative(of: Pair) -> Quantity:
    return quantity.relative_pose(of.name, **dict(of.parameters))


def _joint_momentum(of: Pair) -> Quantity:
    return quantity.joint_momentum(of.name, **dict(of.parameters))
