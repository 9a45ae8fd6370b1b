"""The formulas of the scalar library: functions of port variables and parameters, for numbers and symbols alike.

Energies are functions of states, (L, C) of the states that are read, M of energy efforts: velocities, currents,
absolute temperatures. Kernels, checks, printed equations and the library's docstrings are held against these.
"""

from typing import Any

import numpy as np


def spring(q: Any, k: Any) -> Any:
    """E = ½ k q²."""
    return k * q**2 / 2


def point_mass(p: Any, m: Any) -> Any:
    """E = p²/(2m)."""
    return p**2 / (2 * m)


def rotor(p: Any, j: Any) -> Any:
    """E = p²/(2j)."""
    return point_mass(p, j)


def capacitor(q: Any, c: Any) -> Any:
    """E = q²/(2c)."""
    return point_mass(q, c)


def inductor(b: Any, l: Any) -> Any:  # noqa: E741 - the field's symbol
    """E = b²/(2l)."""
    return point_mass(b, l)


def thermal_capacity(s: Any, c1: Any, c2: Any) -> Any:
    """E = c1 exp(s/c2)."""
    return c1 * np.exp(s / c2)


def thermal_capacity_slope(s: Any, c1: Any, c2: Any) -> Any:
    """θ = c1/c2 exp(s/c2)."""
    return [c1 / c2 * np.exp(s / c2)]


def thermal_node(s: Any, capacity: Any, temperature: Any) -> Any:
    """E = C T₀ exp(s/C)."""
    return capacity * temperature * np.exp(s / capacity)


def thermal_node_slope(s: Any, capacity: Any, temperature: Any) -> Any:
    """θ = T₀ exp(s/C)."""
    return [temperature * np.exp(s / capacity)]


def thermoelastic(e: Any, s: Any, capacity: Any, temperature: Any, pull: Any, reference: Any) -> Any:
    """E = κ θ₀ e + C θ₁ (exp((s − κ e)/C) − 1)."""
    return pull * reference * e + capacity * temperature * np.expm1((s - pull * e) / capacity)


def ideal_gas(s: Any, v: Any, c1: Any, c2: Any, v0: Any, c: Any) -> Any:
    """E = c1 exp(s/c2) (v0/v)^(1/c)."""
    return c1 * np.exp(s / c2) * (v0 / v) ** (1 / c)


def ideal_gas_slope(s: Any, v: Any, c1: Any, c2: Any, v0: Any, c: Any) -> Any:
    """θ = E/c2, −π = −E/(c v)."""
    energy = ideal_gas(s, v, c1, c2, v0, c)
    return [energy / c2, -energy / (c * v)]


def pkc() -> Any:
    """q.f = −p.e, p.f = q.e."""
    return [[0, -1], [1, 0]], None


def emc() -> Any:
    """q.f = b.e, b.f = −q.e."""
    return [[0, 1], [-1, 0]], None


def mkc(bs: Any) -> Any:
    """b.f = bs p.e, p.f = −bs b.e."""
    return [[0, bs], [-bs, 0]], None


def piston(a: Any) -> Any:
    """v1.f = −a p.e, v2.f = a p.e, p.f = a (v1.e − v2.e)."""
    return [[0, 0, -a], [0, 0, a], [a, -a, 0]], None


def lever(r: Any) -> Any:
    """q2.e = r q1.e."""
    return None, [[-r, 1]]


def equal() -> Any:
    """Equal efforts of two ports."""
    return None, [[1, -1]]


def friction(p: Any, s: Any, d: Any) -> Any:
    """p.f = d p.e, s.f = −d p.e²/θ."""
    return [[d * s, -d * p], [-d * p, d * p**2 / s]]


def resistor(b: Any, s: Any, r: Any) -> Any:
    """b.f = r b.e, s.f = −r b.e²/θ."""
    return friction(b, s, r)


def heat_transfer(s1: Any, s2: Any, h: Any) -> Any:
    """s1.f = −h (θ₂ − θ₁)/θ₁, s2.f = −h (θ₁ − θ₂)/θ₂."""
    return [[h * s2 / s1, -h], [-h, h * s1 / s2]]
