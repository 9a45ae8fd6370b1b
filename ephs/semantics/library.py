"""The library of scalar physics: springs, masses, circuits, gases, friction, heat.

Parameters by keyword, SI units; flows into the component are positive. Each function makes one primitive, whose
matrices are the ones that are checked, simulated and shown. Sources: the component library of EPHS.jl for the sign
conventions; Lohmayer, Capobianco, Leyendecker for ``spring``, ``point_mass``, ``pkc``, ``friction``, ``environment``.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from ephs.operad import Directory, Interface, Path, PortType, Quantity, quantity
from ephs.semantics.bundle import Array, Reference
from ephs.semantics.errors import StructureError
from ephs.semantics.primitives import Irreversible, Kernel, Point, Reversible, Storage, power_ports

__all__ = [
    "capacitor",
    "emc",
    "environment",
    "friction",
    "heat_transfer",
    "ideal_gas",
    "inductor",
    "lever",
    "mkc",
    "piston",
    "pkc",
    "point_mass",
    "resistor",
    "rigid_link",
    "rotational_friction",
    "rotor",
    "series_springs",
    "spring",
    "thermal_capacity",
]

KERNELS = "ephs.semantics.kernels"


def _positive(path: str, **parameters: float) -> None:
    for key, value in parameters.items():
        if not (math.isfinite(value) and value > 0.0):
            raise StructureError("parameter", path, key=key, found=value, expected="a number > 0")


def _exp(x: float) -> float:
    """The exponential, infinite where it overflows: iterates of a solver may go there."""
    return math.exp(x) if x < 709.0 else math.inf


def _expm1(x: float) -> float:
    return math.expm1(x) if x < 709.0 else math.inf


def _finite(path: str, **parameters: float) -> None:
    for key, value in parameters.items():
        if not math.isfinite(value):
            raise StructureError("parameter", path, key=key, found=value, expected="a finite number")


def _non_negative(path: str, **parameters: float) -> None:
    for key, value in parameters.items():
        if not (math.isfinite(value) and value >= 0.0):
            raise StructureError("parameter", path, key=key, found=value, expected="a number ≥ 0")


# ---- storage ---------------------------------------------------------------------------------------------------


def quadratic(name: str, interface: Interface, matrix: Array, parameters: tuple[tuple[str, object], ...]) -> Storage:
    """E = ½ xᵀ Q x on vector spaces; Q (n, n) symmetric. Its discrete gradient Q (x⁰ + v/2) is exact."""

    def vector(x: Point) -> Array:
        return np.concatenate([x[p] for p in ports])

    ports = tuple(interface)
    q = np.array(matrix, dtype=float)
    return Storage(
        name,
        interface,
        energy=lambda x: 0.5 * float(vector(x) @ q @ vector(x)),
        gradient=lambda x: q @ vector(x),
        discrete_gradient=lambda x0, v: q @ (vector(x0) + 0.5 * v),
        parameters=parameters,
        kernel=Kernel(KERNELS, "quadratic", tuple(q.ravel())),
    )


def _scalar(name: str, port: str, of: Quantity, stiffness: float, **parameters: float) -> Storage:
    return quadratic(name, power_ports(**{port: of}), np.array([[stiffness]]), tuple(parameters.items()))


def spring(*, k: float) -> Storage:
    """Spring of stiffness k in N/m; port q: E = ½ k q²."""
    _positive("spring", k=k)
    return _scalar("spring", "q", quantity.displacement, k, k=k)


def point_mass(*, m: float) -> Storage:
    """Point mass of m kg; port p: E = p²/(2m)."""
    _positive("point_mass", m=m)
    return _scalar("point_mass", "p", quantity.momentum, 1.0 / m, m=m)


def rotor(*, j: float) -> Storage:
    """Rotor of inertia j in kg m²; port p, an angular momentum: E = p²/(2j)."""
    _positive("rotor", j=j)
    return _scalar("rotor", "p", quantity.angular_momentum, 1.0 / j, j=j)


def capacitor(*, c: float) -> Storage:
    """Capacitor of c farad; port q, a charge: E = q²/(2c)."""
    _positive("capacitor", c=c)
    return _scalar("capacitor", "q", quantity.charge, 1.0 / c, c=c)


def inductor(*, l: float) -> Storage:  # noqa: E741 - the field's symbol
    """Inductor of l henry; port b, a flux linkage: E = b²/(2l)."""
    _positive("inductor", l=l)
    return _scalar("inductor", "b", quantity.flux_linkage, 1.0 / l, l=l)


def thermal_capacity(*, c1: float, c2: float) -> Storage:
    """Thermal capacity; port s: E = c1·exp(s/c2), temperature θ = E/c2."""
    _positive("thermal_capacity", c1=c1, c2=c2)
    return exponential("thermal_capacity", c1, c2, (("c1", c1), ("c2", c2)))


def exponential(name: str, c1: float, c2: float, parameters: tuple[tuple[str, object], ...]) -> Storage:
    """E = c1·(exp(s/c2) − 1): energies count from s = 0, so that small heats are not lost beside a large E."""
    port = Path.of("s")

    def gradient(x: Point) -> Array:
        return np.array([c1 / c2 * _exp(float(x[port][0]) / c2)])

    def discrete_gradient(x0: Point, v: Array) -> Array:
        rise = float(v[0]) / c2
        mean = _expm1(rise) / rise if rise != 0.0 else 1.0
        return gradient(x0) * mean

    return Storage(
        name,
        power_ports(s=quantity.entropy),
        energy=lambda x: c1 * _expm1(float(x[port][0]) / c2),
        gradient=gradient,
        discrete_gradient=discrete_gradient,
        parameters=parameters,
        kernel=Kernel(KERNELS, "exponential", (c1, c2)),
    )


def ideal_gas(*, c1: float, c2: float, v0: float, c: float) -> Storage:
    """Ideal gas; ports s, v: E = c1·exp(s/c2)·(v0/v)^(1/c), θ = ∂E/∂s, π = −∂E/∂v."""
    _positive("ideal_gas", c1=c1, c2=c2, v0=v0, c=c)
    s, v = Path.of("s"), Path.of("v")

    def energy(x: Point) -> float:
        volume = float(x[v][0])
        return c1 * _exp(float(x[s][0]) / c2) * (v0 / volume) ** (1.0 / c) if volume > 0.0 else math.nan

    def gradient(x: Point) -> Array:
        e = energy(x)
        return np.array([e / c2, -e / (c * float(x[v][0]))])

    def discrete_gradient(x0: Point, step: Array) -> Array:
        """E = a(s) b(v): the difference quotient of one factor times the mean of the other."""
        volume = float(x0[v][0])
        heat, growth = float(step[0]) / c2, float(step[1]) / volume
        if not (volume > 0.0 and growth > -1.0):  # an iterate of a solver may lie where no gas is
            return np.full(2, math.nan)
        a = c1 * _exp(float(x0[s][0]) / c2)
        b = (v0 / volume) ** (1.0 / c)
        rise, fall = _expm1(heat), _expm1(-math.log1p(growth) / c)
        by_s = a / c2 * (rise / heat if heat != 0.0 else 1.0)
        by_v = b / volume * (fall / growth if growth != 0.0 else -1.0 / c)
        return np.array([by_s * b * (1.0 + 0.5 * fall), by_v * a * (1.0 + 0.5 * rise)])

    parameters = (("c1", c1), ("c2", c2), ("v0", v0), ("c", c))
    interface = power_ports(s=quantity.entropy, v=quantity.volume)
    kernel = Kernel(KERNELS, "ideal_gas", (c1, c2, v0, c))
    return Storage("ideal_gas", interface, energy, gradient, discrete_gradient, parameters=parameters, kernel=kernel)


def environment() -> Storage:
    """The reference environment; port s: e = 0, and its entropy integrates the flow."""
    return Storage(
        "environment",
        power_ports(s=quantity.entropy),
        energy=lambda x: 0.0,
        environment=True,
        kernel=Kernel(KERNELS, "no_effort"),
    )


# ---- reversible ------------------------------------------------------------------------------------------------


def constant_structure(
    name: str,
    interface: Interface,
    skew: Array,
    constraint: Array,
    parameters: tuple[tuple[str, object], ...] = (),
) -> Reversible:
    """A Dirac structure that does not depend on states: L (n, n), C (k, n)."""
    n, k = skew.shape[0], constraint.shape[0]
    return Reversible(
        name,
        interface,
        structure=lambda _x: (skew, constraint),
        parameters=parameters,
        multipliers=k,
        kernel=Kernel(KERNELS, "constant_structure", (*skew.ravel(), *constraint.reshape(k, n).ravel())),
    )


def _gyrator(name: str, interface: Interface, matrix: Sequence[Sequence[float]], **parameters: float) -> Reversible:
    skew = np.array(matrix, dtype=float)
    return constant_structure(name, interface, skew, np.zeros((0, skew.shape[0])), tuple(parameters.items()))


def coupling(name: str, interface: Interface) -> Reversible:
    """q.f = −p.e, p.f = q.e, on ports q and p of equal dimension: L = [[0, −1], [1, 0]]."""
    n = next(iter(interface.values())).quantity.space.dim
    eye, zero = np.eye(n), np.zeros((n, n))
    return constant_structure(name, interface, np.block([[zero, -eye], [eye, zero]]), np.zeros((0, 2 * n)))


def pkc() -> Reversible:
    """Potential-kinetic coupling; ports q, p: q.f = −p.e, p.f = q.e."""
    return coupling("pkc", power_ports(q=quantity.displacement, p=quantity.momentum))


def emc() -> Reversible:
    """Electro-magnetic coupling; ports q, b: q.f = b.e, b.f = −q.e."""
    return _gyrator("emc", power_ports(q=quantity.charge, b=quantity.flux_linkage), [[0.0, 1.0], [-1.0, 0.0]])


def mkc() -> Reversible:
    """Magneto-kinetic coupling of a DC shunt motor; ports b, p, state port bs: b.f = bs.x·p.e, p.f = −bs.x·b.e."""
    stator = Path.of("bs")
    interface = Directory(
        {
            "b": PortType(quantity.flux_linkage, True),
            "p": PortType(quantity.angular_momentum, True),
            "bs": PortType(quantity.flux_linkage, False),
        }
    )

    def structure(x: Point) -> tuple[Array, Array]:
        flux = float(x[stator][0])
        return np.array([[0.0, flux], [-flux, 0.0]]), np.zeros((0, 2))

    return Reversible("mkc", interface, structure, reads=(stator,))


def lever(*, r: float) -> Reversible:
    """Lever of ratio r; ports q1, q2: q1.f = −r·q2.f, q2.e = r·q1.e."""
    _finite("lever", r=r)
    interface = power_ports(q1=quantity.displacement, q2=quantity.displacement)
    return constant_structure("lever", interface, np.zeros((2, 2)), np.array([[-r, 1.0]]), (("r", r),))


def series_springs() -> Reversible:
    """Two springs in series; ports q, q2: q.f = λ, q2.f = −λ, 0 = q2.e − q.e."""
    interface = power_ports(q=quantity.displacement, q2=quantity.displacement)
    return constant_structure("series_springs", interface, np.zeros((2, 2)), np.array([[1.0, -1.0]]))


def rigid_link() -> Reversible:
    """Two rigidly linked masses; ports p, p2: p.f = λ, p2.f = −λ, 0 = p2.e − p.e."""
    interface = power_ports(p=quantity.momentum, p2=quantity.momentum)
    return constant_structure("rigid_link", interface, np.zeros((2, 2)), np.array([[1.0, -1.0]]))


def piston(*, a: float) -> Reversible:
    """Piston of area a in m²; ports v1, v2, p: v1.f = −a·p.e, v2.f = a·p.e, p.f = a·(v1.e − v2.e)."""
    _positive("piston", a=a)
    interface = power_ports(v1=quantity.volume, v2=quantity.volume, p=quantity.momentum)
    return _gyrator("piston", interface, [[0.0, 0.0, -a], [0.0, 0.0, a], [a, -a, 0.0]], a=a)


# ---- irreversible ----------------------------------------------------------------------------------------------


def dissipation(
    name: str,
    interface: Interface,
    resistance: Array | Callable[[Point, Array, float], Array],
    *,
    reads: tuple[Path, ...] = (),
    kernel: Kernel | None = None,
    parameters: tuple[tuple[str, object], ...] = (),
) -> Irreversible:
    """Dissipation of a port's power into heat: p.f = μ u, s.f = −⟨u|μ u⟩/θ, with u = p.e and θ = θ₀ + s.e.

    M = [[θ μ, −μ u], [−(μ u)ᵀ, ⟨u|μ u⟩/θ]].

    Parameters
    ----------
    interface
        The dissipating power port, then the entropy port, then state ports that are read.
    resistance
        μ (d, d), symmetric and non-negative; or a function of (states read, u, θ).
    """
    d = next(iter(interface.values())).quantity.space.dim

    def matrix(x: Point, e: Array, reference: Reference) -> Array:
        u, theta = e[:d], reference.temperature + float(e[d])
        mu = resistance(x, u, theta) if callable(resistance) else resistance
        drag = mu @ u
        out = np.empty((d + 1, d + 1))
        out[:d, :d] = theta * mu
        out[:d, d] = out[d, :d] = -drag
        out[d, d] = float(u @ drag) / theta
        return out

    if not callable(resistance):
        kernel = Kernel(KERNELS, "dissipation", tuple(np.asarray(resistance, dtype=float).ravel()))
    return Irreversible(name, interface, matrix, reads, parameters, kernel)


def friction(*, d: float) -> Irreversible:
    """Linear friction of d in N s/m; ports p, s: p.f = d·p.e, s.f = −d·p.e²/θ, θ = θ₀ + s.e."""
    _non_negative("friction", d=d)
    ports = power_ports(p=quantity.momentum, s=quantity.entropy)
    return dissipation("friction", ports, np.array([[d]]), parameters=(("d", d),))


def rotational_friction(*, d: float) -> Irreversible:
    """Linear friction of a rotation, d in N m s; ports p, s: p.f = d·p.e, s.f = −d·p.e²/θ."""
    _non_negative("rotational_friction", d=d)
    ports = power_ports(p=quantity.angular_momentum, s=quantity.entropy)
    return dissipation("rotational_friction", ports, np.array([[d]]), parameters=(("d", d),))


def resistor(*, r: float) -> Irreversible:
    """Resistor of r ohm; ports b, s: b.f = r·b.e, s.f = −r·b.e²/θ."""
    _non_negative("resistor", r=r)
    ports = power_ports(b=quantity.flux_linkage, s=quantity.entropy)
    return dissipation("resistor", ports, np.array([[r]]), parameters=(("r", r),))


def heat_transfer(*, h: float) -> Irreversible:
    """Heat transfer of h in W/K; ports s1, s2: s1.f = −h(θ₂−θ₁)/θ₁, s2.f = −h(θ₁−θ₂)/θ₂.

    M = h [[θ₂/θ₁, −1], [−1, θ₁/θ₂]].
    """
    _non_negative("heat_transfer", h=h)

    def matrix(_x: Point, e: Array, reference: Reference) -> Array:
        first, second = reference.temperature + e
        return h * np.array([[second / first, -1.0], [-1.0, first / second]])

    ports = power_ports(s1=quantity.entropy, s2=quantity.entropy)
    return Irreversible("heat_transfer", ports, matrix, (), (("h", h),), Kernel(KERNELS, "heat_transfer", (h,)))
