"""Magnetic and hydraulic parts against closed forms; the equations of the library in any units."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs import Pattern, Reference, simulate
from ephs import library as lib
from ephs.operad.units import dimension, effort_unit, flow_unit
from ephs.semantics.library import chemistry
from tests.numerics import EPS, largest
from tests.semantics.test_primitives import ARGUMENTS


@given(st.floats(-4.0, 4.0))
def test_saturation_is_linear_at_first_and_steep_beyond_the_knee(share):
    core = lib.saturating_reluctance(r=5.0, knee=0.2)
    coil = lib.saturating_inductor(l=0.5, knee=0.2)
    for part, slope in ((core, 5.0), (coil, 2.0)):
        (port,) = part.bundle.ports
        x = {port: np.array([0.2 * share])}
        assert part.energy_gradient(x)[0] == pytest.approx(slope * 0.2 * math.sinh(share), rel=32 * EPS, abs=1e-300)
        half = math.sinh(0.5 * share)
        assert part.energy(x) == pytest.approx(2.0 * slope * 0.04 * half * half, rel=32 * EPS, abs=1e-300)


TANKS = Pattern.from_text("a: liquid; b: liquid; s: entropy; tank1(v=a); tank2(v=b); valve(v1=a, v2=b, s); room(s)")


def tanks(valve):
    one, two = lib.tank(area=2.0, density=1e3), lib.tank(area=1.0, density=1e3)
    return TANKS(tank1=one, tank2=two, valve=valve, room=lib.environment())


@given(st.floats(1e-3, 1e3), st.booleans())
def test_an_orifice_is_a_root_above_its_transition(ratio, back):
    drop = (-1.0 if back else 1.0) * 50.0 * ratio
    orifice = lib.orifice(c=0.3, transition=50.0)
    f = orifice.flow({}, np.array([drop, 0.0, 0.0]), Reference())
    exact = 0.3 * drop / (drop * drop + 2500.0) ** 0.25
    assert f[0] == pytest.approx(exact, rel=64 * EPS) and f[1] == pytest.approx(-exact, rel=64 * EPS)
    assert f[2] * 293.15 == pytest.approx(-exact * drop, rel=64 * EPS)
    if ratio > 100.0:
        assert abs(f[0]) == pytest.approx(0.3 * math.sqrt(abs(drop)), rel=0.3 / ratio**2)


def test_a_pipe_swings_between_tanks_and_loses_to_heat():
    pattern = Pattern.from_text(
        "a: liquid; b: liquid; g: pressure_impulse; s: entropy;"
        "tank1(v=a); tank2(v=b); pipe(g); join(v1=a, v2=b, g); loss(g, s); room(s)"
    )
    one, two = (lib.tank(area=area, density=1e3) for area in (2.0, 1.0))
    parts = {"tank1": one, "tank2": two, "pipe": lib.inertance(i=1e5), "join": lib.conduit(), "room": lib.environment()}
    start = {"tank1.v": 3.0, "tank2.v": 0.5}
    free, slow = (
        simulate(pattern(**parts, loss=lib.pipe_loss(r=r, k=k)), 20.0, initial=start, method="natural", step=0.02)
        for r, k in ((0.0, 0.0), (2e3, 5e3))
    )
    omega = math.sqrt(1e3 * 9.81 * 1.5 / 1e5)
    angle = 2.0 * math.atan(0.01 * omega)
    level = 3.5 / 3.0
    expected = 2.0 * level + (3.0 - 2.0 * level) * np.cos(angle * np.arange(len(free)))
    assert np.allclose(free["tank1.v"], expected, rtol=1e-10)
    for sol in (free, slow):
        assert largest(sol["tank1.v"] + sol["tank2.v"] - 3.5) <= 1e-12
        assert largest(sol.energy - sol.energy[0]) <= 1e-11 * sol.energy[0]
    assert np.diff(slow["room.s"]).min() > 0.0 and slow.exergy[-1] < slow.exergy[0]
    assert tanks(lib.orifice(c=1e-3, transition=10.0)).check(state={"tank1.v": 3.0, "tank2.v": 0.5}).ok


# ---- units -----------------------------------------------------------------------------------------------------
# Scales of base units with R = 8.3 J/(mol K) in each: mol follows from kg, m, s, K.
UNITS = {
    "capacitor": {"c": "F"}, "coil": {"turns": "1"}, "conduit": {}, "emc": {}, "environment": {},
    "friction": {"d": "N s/m"}, "winding": {"turns": "1"},
    "heat_transfer": {"h": "W/K"}, "ideal_gas": {"c1": "J", "c2": "J/K", "v0": "m³", "c": "1"},
    "ideal_mixture": {"species": ""}, "inductor": {"l": "H"}, "inertance": {"i": "kg/m^4"},
    "laminar_leak": {"c": "m³/(s Pa)"}, "lever": {"r": "1"}, "magnetic_series": {}, "mkc": {},
    "orifice": {"c": "m³/s", "transition": "Pa"}, "pipe_loss": {"r": "Pa s/m³", "k": "Pa s²/m^6"},
    "piston": {"a": "m²"},
    "pkc": {}, "point_mass": {"m": "kg"}, "reaction": {"k": "m³/(mol s)", "species": "", "equation": ""},
    "reluctance": {"r": "1/H"}, "resistor": {"r": "Ω"}, "rigid_link": {}, "rotational_friction": {"d": "N m s"},
    "rotor": {"j": "kg m²"}, "saturating_inductor": {"l": "H", "knee": "Wb"},
    "saturating_reluctance": {"r": "1/H", "knee": "Wb"}, "series_springs": {}, "spring": {"k": "N/m"},
    "tank": {"area": "m²", "density": "kg/m³", "gravity": "m/s²"}, "thermal_capacity": {"c1": "J", "c2": "J/K"},
}  # fmt: skip


def scale(unit, scales):
    return math.prod(scales[base] ** power for base, power in dimension(unit))


def rescaled(name, units, scales):
    """The part in other units."""
    given = ({"gravity": 9.81} if name == "tank" else {}) | ARGUMENTS[name]
    changed = {key: value if units[key] == "" else value * scale(units[key], scales) for key, value in given.items()}
    if name == "orifice":  # c carries the root of a pressure
        changed["c"] = given["c"] * scale("m³/s", scales) / math.sqrt(scale("Pa", scales))
    if "species" in changed:
        changed["species"] = tuple(
            chemistry.Species(
                one.name, one.elements, one.energy * scale("J/mol", scales), one.entropy * scale("J/(mol K)", scales),
                one.capacity * scale("J/(mol K)", scales), one.temperature * scale("K", scales),
                one.pressure * scale("Pa", scales),
            )
            for one in given["species"]
        )  # fmt: skip
    return getattr(lib, name)(**given), getattr(lib, name)(**changed)


def defect(name, units, scales, seed):
    """How far energies and flows in other units are from the same energies and flows."""
    rng = np.random.default_rng(seed)
    one, other = rescaled(name, units, scales)
    here = Reference(300.0, 2.0)
    there = Reference(300.0 * scale("K", scales), 2.0 * scale("Pa", scales))
    states = {p: t.quantity.unit for p, t in one.interface.items()}
    bundle = one.bundle
    x = {p: np.exp(0.2 * rng.standard_normal(1)) for p in one.interface}
    x_there = {p: value * scale(states[p], scales) for p, value in x.items()}
    e = rng.standard_normal(bundle.size)
    efforts = np.array([scale(effort_unit(states[p]), scales) for p in bundle.ports])
    flows = np.array([scale(flow_unit(states[p]), scales) for p in bundle.ports])
    if one.kind in ("storage", "environment"):
        pairs = [(np.array([one.energy(x)]) * scale("J", scales), np.array([other.energy(x_there)]))]
        pairs += [(one.effort(x, here) * efforts, other.effort(x_there, there))]
    elif one.kind == "irreversible":
        pairs = [(one.flow(x, e, here) * flows, other.flow(x_there, e * efforts, there))]
    else:
        skew, rows = one.structure(x)
        skew_there, rows_there = other.structure(x_there)
        pairs = [(skew @ e * flows, skew_there @ (e * efforts))]
        for row, row_there in zip(rows, rows_there, strict=True):  # a condition may be in any unit
            found, expected = row_there * efforts, row
            k = int(np.argmax(np.abs(expected)))
            pairs.append((expected * (found[k] / expected[k]), found))
    size = max([1e-300, *(float(largest(a, initial=0.0)) for a, _ in pairs)])
    return (
        max(
            float(largest(a - b, initial=0.0)) / max(float(largest(a, initial=0.0)), 1e-300) for a, b in pairs if a.size
        )
        if size > 1e-300
        else 0.0
    )


def all_scales(drawn):
    kg, m, s, ampere, kelvin = drawn
    return {"kg": kg, "m": m, "s": s, "A": ampere, "K": kelvin, "mol": kg * m * m / (s * s * kelvin)}


def test_units_of_all_parameters_are_said():
    assert {name: set(units) - {"gravity"} for name, units in UNITS.items()} == {
        n: set(given) for n, given in ARGUMENTS.items()
    }


@pytest.mark.parametrize("name", UNITS)
@pytest.mark.parametrize("drawn", [(2.0, 0.5, 8.0, 0.25, 2.0), (0.25, 8.0, 0.5, 2.0, 0.5)], ids=str)
def test_the_equations_hold_in_any_units(name, drawn):
    assert defect(name, UNITS[name], all_scales(drawn), 7) <= 1e-10


@pytest.mark.parametrize(
    ("name", "wrong"), [("spring", {"k": "N"}), ("tank", UNITS["tank"] | {"density": "kg"}), ("friction", {"d": "N"})]
)
def test_a_wrong_unit_is_seen(name, wrong):
    scales = {"kg": 2.0, "m": 3.0, "s": 5.0, "A": 7.0, "K": 11.0, "mol": 18.0 / 275.0}
    assert defect(name, wrong, scales, 1) > 0.1 > 1e-10 > defect(name, UNITS[name], scales, 1)
