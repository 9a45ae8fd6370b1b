"""Components of the library mean the equations that are written of them: flows go into the component."""

import numpy as np
import pytest
from hypothesis import given

from ephs import Pattern, Reference, junction, library
from tests.numerics import largest, seeds

TEMPERATURE = 310.0


def damped(port, loss=lambda e: 0.7 * e):
    """A loss of power at a temperature θ by a flow at an effort e; it is 0.7 e."""
    return lambda z: [
        z[f"{port}.f"] - loss(z[f"{port}.e"]),
        z["s.f"] + loss(z[f"{port}.e"]) * z[f"{port}.e"] / (TEMPERATURE + z["s.e"]),
    ]


def leaking(z):
    apart = z["v1.e"] - z["v2.e"]
    heat = 0.7 * apart**2 / (TEMPERATURE + z["s.e"])
    return [z["v1.f"] - 0.7 * apart, z["v2.f"] + 0.7 * apart, z["s.f"] + heat]


def conducting(z):
    one, two = TEMPERATURE + z["s1.e"], TEMPERATURE + z["s2.e"]
    return [z["s1.f"] + 0.7 * (two - one) / one, z["s2.f"] + 0.7 * (one - two) / two]


EQUATIONS = {
    "pkc": ({}, lambda z: [z["q.f"] + z["p.e"], z["p.f"] - z["q.e"]]),
    "emc": ({}, lambda z: [z["q.f"] - z["b.e"], z["b.f"] + z["q.e"]]),
    "mkc": ({}, lambda z: [z["b.f"] - z["bs.x"] * z["p.e"], z["p.f"] + z["bs.x"] * z["b.e"]]),
    "lever": ({"r": 2.5}, lambda z: [z["q1.f"] + 2.5 * z["q2.f"], z["q2.e"] - 2.5 * z["q1.e"]]),
    "series_springs": ({}, lambda z: [z["q.f"] + z["q2.f"], z["q2.e"] - z["q.e"]]),
    "rigid_link": ({}, lambda z: [z["p.f"] + z["p2.f"], z["p2.e"] - z["p.e"]]),
    "piston": (
        {"a": 0.3},
        lambda z: [
            z["v1.f"] + 0.3 * z["p.e"], z["v2.f"] - 0.3 * z["p.e"], z["p.f"] - 0.3 * (z["v1.e"] - z["v2.e"])
        ],
    ),
    "friction": ({"d": 0.7}, damped("p")),
    "rotational_friction": ({"d": 0.7}, damped("p")),
    "resistor": ({"r": 0.7}, damped("b")),
    "heat_transfer": ({"h": 0.7}, conducting),
    "laminar_leak": ({"c": 0.7}, leaking),
    "pipe_loss": ({"r": 2.0, "k": 3.0}, damped("g", lambda e: (2.0 + 3.0 * abs(e)) * e)),
    "coil": ({"turns": 4.0}, lambda z: [z["q.f"] - z["m.e"] / 4.0, z["m.f"] + z["q.e"] / 4.0]),
    "winding": ({"turns": 30.0}, lambda z: [z["m.e"] - 30.0 * z["b.e"], z["b.f"] + 30.0 * z["m.f"]]),
    "magnetic_series": (
        {}, lambda z: [z["m.e"] - z["m1.e"] - z["m2.e"], z["m1.f"] + z["m.f"], z["m2.f"] + z["m.f"]]
    ),
    "conduit": ({}, lambda z: [z["v1.f"] + z["g.e"], z["v2.f"] - z["g.e"], z["g.f"] - z["v1.e"] + z["v2.e"]]),
}  # fmt: skip


@pytest.mark.parametrize("name", list(EQUATIONS))
@given(seed=seeds)
def test_a_component_means_its_equations(name, seed):
    rng, (arguments, residual) = np.random.default_rng(seed), EQUATIONS[name]
    part = getattr(library, name)(**arguments)
    ports = {str(port): of for port, of in part.interface.items()}
    shown = {port: junction(of.quantity, exposed=True, power=of.power) for port, of in ports.items()}
    system = Pattern(shown, {"c": {port: port if of.power else f"~{port}" for port, of in ports.items()}})(c=part)
    read = {port: rng.standard_normal() for port, of in ports.items() if not of.power}
    e = {f"{port}.e": rng.standard_normal() for port, of in ports.items() if of.power}
    at = system.relation(reference=Reference(TEMPERATURE)).at(
        {f"c.{port}": x for port, x in read.items()},
        efforts={"c": [*e.values()]} if part.kind == "irreversible" else None,
    )
    values, vectors = np.linalg.eigh(at.projector)
    span = vectors[:, values > 0.5]
    names = ["one" if v.kind == "one" else f"{v.port}.{v.kind[0]}" for v in at.order]
    free = [k for k, v in enumerate(at.order) if v.kind != "flow"]
    wanted = np.array([e.get(names[k], 1.0) for k in free])
    found = dict(zip(names, span @ np.linalg.lstsq(span[free], wanted, rcond=None)[0], strict=True))
    z = {name: value / found["one"] for name, value in found.items()} | {f"{k}.x": x for k, x in read.items()}
    if part.kind == "irreversible":
        assert all(abs(z[name] - value) < 1e-12 for name, value in e.items())
    assert largest(residual(z)) < 1e-12
    for flow in (name for name in z if name.endswith(".f")):
        assert largest(residual(z | {flow: z[flow] + 1.0})) > 0.1, "the control: each flow is in an equation"
