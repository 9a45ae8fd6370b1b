"""Components in larger systems, against closed forms."""

import re

import numpy as np
import pytest

import ephs
from ephs import Pattern
from tests.numerics import largest
from tests.scenes import ROOT


def assembled(text, **components):
    """The system; it begins as its components do."""
    return Pattern.from_text(text)(**{name: each.system for name, each in components.items()})


def test_a_capacitor_discharges_into_heat(parts):
    """3 V on 0.5 F through 2 Ω: e to the minus t, and all of the energy warms the body of 20 J/K from 320 K."""
    system = assembled(
        "a: charge; g: charge; h: entropy\nr(p=a, n=g, heat=h); c(p=a, n=g); ground(p=g); body(port=h)",
        r=parts.read("Parts.Resistor", R=2.0),
        c=parts.read("Parts.Capacitor"),
        ground=parts.read("Parts.Ground"),
        body=parts.read("Parts.Capacity"),
    )
    sol = ephs.simulate(system, 2.0, method="natural", step=0.005)
    charge, entropy = np.asarray(sol["c.stored.v"]), np.asarray(sol["body.stored.s"])
    assert charge[-1] == pytest.approx(1.5 * np.exp(-2.0), rel=1e-5)  # of second order
    warmth = 20.0 * 320.0 * np.expm1(entropy / 20.0)
    assert largest(charge**2 + warmth - 2.25) <= 1e-9
    assert np.all(np.diff(entropy) > 0.0)


def test_a_magnet_couples_a_coil_to_a_wheel(parts):
    """J dw/dt = −k i and L di/dt = k w: the wheel swings with ω² = k²/(J L)."""
    k, coil, inertia = 0.3, 0.25, 0.7
    system = assembled(
        "a: charge; g: charge; s: angular_momentum; free: angular_momentum\n"
        "c(p=a, n=g); ground(p=g); m(p=a, n=g, a=s); wheel(a=s, b=free)",
        c=parts.read("Parts.Inductor", L=coil),
        ground=parts.read("Parts.Ground"),
        m=parts.read("Parts.Machine", k=k),
        wheel=parts.read("Parts.Inertia", J=inertia),
    )
    sol = ephs.simulate(system, 5.0, method="natural", step=0.02)
    swing = inertia * np.cos(k / np.sqrt(inertia * coil) * sol.t)
    assert largest(np.asarray(sol["wheel.stored.w"]) - swing) <= 1e-4  # of second order
    assert np.allclose(sol["m.field.b"], 1.0, rtol=1e-14)


def test_the_page_of_the_documentation_runs():
    page = (ROOT / "docs/modelica.md").read_text()
    *cells, refused = re.findall(r"```\{code-cell\} python\n(.*?)```", page, flags=re.DOTALL)
    names: dict[str, object] = {}
    for cell in cells:
        exec(cell, names)
    with pytest.raises(ephs.ModelicaError, match="makes energy"):
        exec(refused.removeprefix(":tags: [raises-exception]\n"), names)
