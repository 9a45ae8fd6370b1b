"""The library of scalar physics: springs, masses, circuits, gases, friction, heat; chemistry, magnetics, hydraulics.

Parameters by keyword, SI units; flows into the component are positive. Each function makes one primitive, whose
matrices are the ones that are checked, simulated and shown. Sources: the component library of EPHS.jl for the sign
conventions; Lohmayer, Capobianco, Leyendecker for ``spring``, ``point_mass``, ``pkc``, ``friction``, ``environment``.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np

from ephs.operad import Directory, Interface, PortType, Quantity, quantity
from ephs.operad.messages import nearest_of
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.derive.linear import Linear
from ephs.semantics.library import chemistry as chemistry
from ephs.semantics.library import formulas
from ephs.semantics.library.chemistry import ideal_mixture, reaction
from ephs.semantics.library.hydraulics import conduit, inertance, laminar_leak, orifice, pipe_loss, tank
from ephs.semantics.library.made import finite, non_negative, positive
from ephs.semantics.library.magnetics import (
    coil,
    magnetic_series,
    reluctance,
    saturating_inductor,
    saturating_reluctance,
    winding,
)
from ephs.semantics.library.units import fmu as fmu
from ephs.semantics.primitives.forms import coupled, dissipated, stored
from ephs.semantics.primitives.primitives import Formula, Irreversible, Kernel, Reversible, Storage, power_ports
from ephs.semantics.primitives.structures import constant_structure, dissipation, exponential, quadratic

__all__ = [
    "capacitor",
    "coil",
    "conduit",
    "emc",
    "environment",
    "friction",
    "heat_transfer",
    "ideal_gas",
    "ideal_mixture",
    "inductor",
    "inertance",
    "laminar_leak",
    "lever",
    "magnetic_series",
    "mkc",
    "orifice",
    "pipe_loss",
    "piston",
    "pkc",
    "point_mass",
    "reaction",
    "reluctance",
    "resistor",
    "rigid_link",
    "rotational_friction",
    "rotor",
    "saturating_inductor",
    "saturating_reluctance",
    "series_springs",
    "spring",
    "tank",
    "thermal_capacity",
    "winding",
]


def __getattr__(name: str) -> Any:
    raise AttributeError(f"the library has no {name!r}{nearest_of(name, __all__)}")


Structure = tuple[Sequence[Sequence[Any]] | None, Sequence[Sequence[Any]] | None]
"""L and C, either of which may be left out."""


# ---- storage ---------------------------------------------------------------------------------------------------


def _scalar(name: str, port: str, of: Quantity, energy: Callable[..., object], **parameters: float) -> Storage:
    """E = ½ Q x² as a function of the state and the parameters, whose second difference is Q."""
    stiffness = float(energy(1.0, **parameters)) * 2.0  # pyright: ignore[reportArgumentType] - a number, of numbers
    formula = Formula(energy, tuple(parameters))
    matrix, ports = np.array([[stiffness]]), power_ports(**{port: of})
    return quadratic(name, ports, matrix, tuple(parameters.items()), formula, trusted=True)


def spring(*, k: float) -> Storage:
    """Spring of stiffness k in N/m; port q: E = k*q**2/2."""
    positive("spring", k=k)
    return _scalar("spring", "q", quantity.displacement, formulas.spring, k=k)


def point_mass(*, m: float) -> Storage:
    """Point mass of m kg; port p: E = p**2/(2*m)."""
    positive("point_mass", m=m)
    return _scalar("point_mass", "p", quantity.momentum, formulas.point_mass, m=m)


def rotor(*, j: float) -> Storage:
    """Rotor of inertia j in kg m²; port p, an angular momentum: E = p**2/(2*j)."""
    positive("rotor", j=j)
    return _scalar("rotor", "p", quantity.angular_momentum, formulas.rotor, j=j)


def capacitor(*, c: float) -> Storage:
    """Capacitor of c farad; port q, a charge: E = q**2/(2*c)."""
    positive("capacitor", c=c)
    return _scalar("capacitor", "q", quantity.charge, formulas.capacitor, c=c)


def inductor(*, l: float) -> Storage:  # noqa: E741 - the field's symbol
    """Inductor of l henry; port b, a flux linkage: E = b**2/(2*l)."""
    positive("inductor", l=l)
    return _scalar("inductor", "b", quantity.flux_linkage, formulas.inductor, l=l)


def thermal_capacity(
    *, c1: float | None = None, c2: float | None = None, capacity: float | None = None, temperature: float | None = None
) -> Storage:
    """Thermal capacity; port s: E = c1*exp(s/c2), temperature θ = E/c2; ledgers count energies from s = 0, E − c1.

    Either c1 in J and c2 in J/K, or ``capacity`` C in J/K and ``temperature`` θ₁ in K at s = 0: c1 = C θ₁, c2 = C.
    """
    if capacity is not None or temperature is not None:
        if c1 is not None or c2 is not None or capacity is None or temperature is None:
            found = ", ".join(
                key
                for key, x in zip(("c1", "c2", "capacity", "temperature"), (c1, c2, capacity, temperature), strict=True)
                if x is not None
            )
            expected = "c1 and c2, or capacity and temperature"
            raise StructureError("parameter", "thermal_capacity", key="names", found=found, expected=expected)
        positive("thermal_capacity", capacity=capacity, temperature=temperature)
        c1, c2 = capacity * temperature, capacity
    positive("thermal_capacity", c1=c1, c2=c2)
    assert c1 is not None
    assert c2 is not None
    formula = Formula(formulas.thermal_capacity, ("c1", "c2"), formulas.thermal_capacity_slope)
    return exponential("thermal_capacity", c1, c2, (("c1", c1), ("c2", c2)), formula)


def ideal_gas(*, c1: float, c2: float, v0: float, c: float) -> Storage:
    """Ideal gas; ports s, v: E = c1*(v0/v)**(1/c)*exp(s/c2), θ = ∂E/∂s, π = −∂E/∂v."""
    positive("ideal_gas", c1=c1, c2=c2, v0=v0, c=c)
    return stored(
        "ideal_gas",
        power_ports(s=quantity.entropy, v=quantity.volume),
        formulas.ideal_gas,
        {"c1": c1, "c2": c2, "v0": v0, "c": c},
        formula=Formula(formulas.ideal_gas, ("c1", "c2", "v0", "c"), formulas.ideal_gas_slope),
        trusted=True,
    )


@cache
def environment(**ports: Quantity) -> Storage:
    """The reference environment; port s: e = 0, and its entropy integrates the flow.

    Parameters
    ----------
    **ports
        Other ports in place of s: volumes of the atmosphere, species of an inexhaustible supply, at the environment's
        pressure and potentials.
    """
    return Storage(
        "environment",
        power_ports(**(ports or {"s": quantity.entropy})),
        energy=lambda x: 0.0,
        environment=True,
        kernel=Kernel("no_effort", Linear("no_effort")),
    )


# ---- reversible ------------------------------------------------------------------------------------------------


def _constant(name: str, interface: Interface, matrices: Callable[..., Structure], **parameters: float) -> Reversible:
    """A constant structure from its matrices as functions of the parameters: (L, C), either of which may be None."""
    n = sum(port.quantity.space.dim for port in interface.values())
    skew, constraint = matrices(**parameters)
    left = np.zeros((n, n)) if skew is None else np.array(skew, dtype=float)
    right = np.zeros((0, n)) if constraint is None else np.array(constraint, dtype=float)
    formula = Formula(matrices, tuple(parameters))
    return constant_structure(name, interface, left, right, tuple(parameters.items()), formula, trusted=True)


def pkc() -> Reversible:
    """Potential-kinetic coupling; ports q, p: q.f = −p.e, p.f = q.e.

    L = [[0, -1], [1, 0]].
    """
    return _constant("pkc", power_ports(q=quantity.displacement, p=quantity.momentum), formulas.pkc)


def emc() -> Reversible:
    """Electro-magnetic coupling; ports q, b: q.f = b.e, b.f = −q.e.

    L = [[0, 1], [-1, 0]].
    """
    return _constant("emc", power_ports(q=quantity.charge, b=quantity.flux_linkage), formulas.emc)


def mkc() -> Reversible:
    """Magneto-kinetic coupling of a DC shunt motor; ports b, p, state port bs: b.f = bs.x·p.e, p.f = −bs.x·b.e.

    L = [[0, bs], [-bs, 0]].
    """
    interface = Directory(
        {
            "b": PortType(quantity.flux_linkage, True),
            "p": PortType(quantity.angular_momentum, True),
            "bs": PortType(quantity.flux_linkage, False),
        }
    )
    return coupled("mkc", interface, formulas.mkc, trusted=True)


def lever(*, r: float) -> Reversible:
    """Lever of ratio r; ports q1, q2: q1.f = −r·q2.f, q2.e = r·q1.e.

    C = [[-r, 1]].
    """
    finite("lever", r=r)
    interface = power_ports(q1=quantity.displacement, q2=quantity.displacement)
    return _constant("lever", interface, formulas.lever, r=r)


def series_springs() -> Reversible:
    """Two springs in series; ports q, q2: q.f = λ, q2.f = −λ, 0 = q2.e − q.e.

    C = [[1, -1]].
    """
    interface = power_ports(q=quantity.displacement, q2=quantity.displacement)
    return _constant("series_springs", interface, formulas.equal)


def rigid_link() -> Reversible:
    """Two rigidly linked masses; ports p, p2: p.f = λ, p2.f = −λ, 0 = p2.e − p.e.

    C = [[1, -1]].
    """
    interface = power_ports(p=quantity.momentum, p2=quantity.momentum)
    return _constant("rigid_link", interface, formulas.equal)


def piston(*, a: float) -> Reversible:
    """Piston of area a in m²; ports v1, v2, p: v1.f = −a·p.e, v2.f = a·p.e, p.f = a·(v1.e − v2.e).

    L = [[0, 0, -a], [0, 0, a], [a, -a, 0]].
    """
    positive("piston", a=a)
    interface = power_ports(v1=quantity.volume, v2=quantity.volume, p=quantity.momentum)
    return _constant("piston", interface, formulas.piston, a=a)


# ---- irreversible ----------------------------------------------------------------------------------------------


def _resistive(name: str, port: str, of: Quantity, matrix: Callable[..., Any], **parameters: float) -> Irreversible:
    """Linear friction at a port, its heat at s."""
    non_negative(name, **parameters)
    ((_, coefficient),) = parameters.items()
    ports, formula = power_ports(**{port: of, "s": quantity.entropy}), Formula(matrix, tuple(parameters))
    return dissipation(
        name, ports, np.array([[coefficient]]), parameters=tuple(parameters.items()), formula=formula, trusted=True
    )


def friction(*, d: float) -> Irreversible:
    """Linear friction of d in N s/m; ports p, s: p.f = d·p.e, s.f = −d·p.e²/θ, θ = θ₀ + s.e.

    M = [[d*s, -d*p], [-d*p, d*p**2/s]], of the energy efforts: p the velocity, s the temperature.
    """
    return _resistive("friction", "p", quantity.momentum, formulas.friction, d=d)


def rotational_friction(*, d: float) -> Irreversible:
    """Linear friction of a rotation, d in N m s; ports p, s: p.f = d·p.e, s.f = −d·p.e²/θ.

    M = [[d*s, -d*p], [-d*p, d*p**2/s]], of the energy efforts: p the angular velocity, s the temperature.
    """
    return _resistive("rotational_friction", "p", quantity.angular_momentum, formulas.friction, d=d)


def resistor(*, r: float) -> Irreversible:
    """Resistor of r ohm; ports b, s: b.f = r·b.e, s.f = −r·b.e²/θ.

    M = [[r*s, -b*r], [-b*r, b**2*r/s]], of the energy efforts: b the current, s the temperature.
    """
    return _resistive("resistor", "b", quantity.flux_linkage, formulas.resistor, r=r)


def heat_transfer(*, h: float) -> Irreversible:
    """Heat transfer of h in W/K; ports s1, s2: s1.f = −h(θ₂−θ₁)/θ₁, s2.f = −h(θ₁−θ₂)/θ₂.

    M = [[h*s2/s1, -h], [-h, h*s1/s2]], of the temperatures.
    """
    non_negative("heat_transfer", h=h)
    ports = power_ports(s1=quantity.entropy, s2=quantity.entropy)
    return dissipated("heat_transfer", ports, formulas.heat_transfer, {"h": h}, trusted=True)
