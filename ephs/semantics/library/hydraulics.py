"""Hydraulics of a liquid of constant density: tanks, pipes, orifices; losses become heat.

The volume of liquid is stored and conserved, its pressure above the environment's is the effort. The momentum per area
of what moves in a pipe, a pressure impulse, is stored with the volume flow as its effort.
"""

from typing import Any

import numpy as np

from ephs.operad import quantity
from ephs.semantics.library import formulas
from ephs.semantics.library.made import non_negative, positive
from ephs.semantics.primitives.forms import dissipated, stored
from ephs.semantics.primitives.primitives import Irreversible, Reversible, Storage, power_ports
from ephs.semantics.primitives.structures import constant_structure

__all__ = ["conduit", "inertance", "laminar_leak", "orifice", "pipe_loss", "tank"]

GRAVITY = 9.81
"""In m/s²."""


def _tank(v: Any, area: Any, density: Any, gravity: Any) -> Any:
    return density * gravity * v**2 / (2 * area)


def _inertance(g: Any, i: Any) -> Any:
    return formulas.point_mass(g, i)


def _exchange(v1: Any, v2: Any, s: Any, conductance: Any) -> Any:
    """M of a flow c (v1 − v2) from one volume to the other: c/θ n nᵀ with n = (θ, −θ, v2 − v1)."""
    normal = [s, -s, v2 - v1]
    return [[conductance / s * a * b for b in normal] for a in normal]


def _laminar(v1: Any, v2: Any, s: Any, c: Any) -> Any:
    return _exchange(v1, v2, s, c)


def _orifice(v1: Any, v2: Any, s: Any, c: Any, transition: Any) -> Any:
    return _exchange(v1, v2, s, c / ((v1 - v2) ** 2 + transition**2) ** 0.25)


def _pipe_loss(g: Any, s: Any, r: Any, k: Any) -> Any:
    return formulas.friction(g, s, r + k * abs(g))


def tank(*, area: float, density: float, gravity: float = GRAVITY) -> Storage:
    """Open upright tank; port v: E = density*gravity*v**2/(2*area), the pressure at the bottom is its effort.

    Parameters
    ----------
    area
        Of its section, in m².
    density
        Of the liquid, in kg/m³.
    """
    positive("tank", area=area, density=density, gravity=gravity)
    numbers = {"area": area, "density": density, "gravity": gravity}
    return stored("tank", power_ports(v=quantity.liquid), _tank, numbers)


def inertance(*, i: float) -> Storage:
    """Liquid that moves in a pipe, i = density·length/area in kg/m⁴; port g: E = g**2/(2*i), its effort is the flow."""
    positive("inertance", i=i)
    return stored("inertance", power_ports(g=quantity.pressure_impulse), _inertance, {"i": i})


def conduit() -> Reversible:
    """Pipe between two volumes; ports v1, v2, g: v1.f = −g.e, v2.f = g.e, g.f = v1.e − v2.e.

    L = [[0, 0, -1], [0, 0, 1], [1, -1, 0]].
    """
    ports = power_ports(v1=quantity.liquid, v2=quantity.liquid, g=quantity.pressure_impulse)
    skew = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [1.0, -1.0, 0.0]])
    return constant_structure("conduit", ports, skew, np.zeros((0, 3)))


def laminar_leak(*, c: float) -> Irreversible:
    """Flow of c·Δp through a narrow gap, c in m³/(s Pa); ports v1, v2, s: v1.f = c·(v1.e − v2.e) = −v2.f.

    Hagen and Poiseuille: c = π r⁴/(8 η l). The heat c·Δp² goes to s, θ = θ₀ + s.e.
    M = [[c*s, -c*s, c*(-v1 + v2)], [-c*s, c*s, -c*(-v1 + v2)], [c*(-v1 + v2), -c*(-v1 + v2), c*(-v1 + v2)**2/s]], of
    the energy efforts.
    """
    non_negative("laminar_leak", c=c)
    ports = power_ports(v1=quantity.liquid, v2=quantity.liquid, s=quantity.entropy)
    return dissipated("laminar_leak", ports, _laminar, {"c": c})


def orifice(*, c: float, transition: float) -> Irreversible:
    """Orifice; ports v1, v2, s: v1.f = c·Δp/(Δp² + transition²)^¼ = −v2.f, Δp = v1.e − v2.e.

    For pressures above the transition, in Pa, this is c·√Δp with c = C_d·A·√(2/density); below it is laminar.
    """
    non_negative("orifice", c=c)
    positive("orifice", transition=transition)
    ports = power_ports(v1=quantity.liquid, v2=quantity.liquid, s=quantity.entropy)
    return dissipated("orifice", ports, _orifice, {"c": c, "transition": transition})


def pipe_loss(*, r: float, k: float = 0.0) -> Irreversible:
    """Loss of pressure along a pipe; ports g, s: g.f = (r + k·abs(Q))·Q with the flow Q = g.e, heat at s.

    M = [[s*(k*Abs(g) + r), g*(-k*Abs(g) - r)], [g*(-k*Abs(g) - r), g**2*(k*Abs(g) + r)/s]], of the energy efforts.

    Parameters
    ----------
    r
        Laminar, in Pa s/m³.
    k
        Turbulent, in Pa s²/m⁶.
    """
    non_negative("pipe_loss", r=r, k=k)
    ports = power_ports(g=quantity.pressure_impulse, s=quantity.entropy)
    return dissipated("pipe_loss", ports, _pipe_loss, {"r": r, "k": k})
