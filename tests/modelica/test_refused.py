"""Components that are not taken: one clear error each, with the equation."""

import pytest

import ephs

REFUSED = {
    "Amplifier": ("power", "makes energy, .* W at .*p2.v = "),
    "Battery": ("source", "the environment of a system: .* = 12"),
    "Cold": ("heat", "heat.Q_flow = 0"),
    "Pump": ("second", "cold to hot: a.Q_flow = "),
    "Fountain": ("first", r"takes 2\*a.T - 2\*b.T W"),
    "Diode": ("branch", "switches on v > 0"),
    "Lamp": ("nonlinear", r"v = i\^3"),
    "Rheostat": ("signal", "reads the signal R"),
    "Loose": ("count", "1 equations .* expected 2"),
    "Negative": ("unstable", "states v is not positive"),
    "Bare": ("ports", "nothing to compose"),
    "Many": ("array", "p.v is an array"),
    "Clock": ("time", "a function of time"),
    "Thermostat": ("source", "port.T = 300"),
    "Heater": ("source", "port.Q_flow = -50"),
    "Sampler": ("branch", "when v > 0"),
    "Stepwise": ("algorithm", "expected equations"),
    "Settled": ("initial", r"the value of one state: der\(v\) = 0"),
    "Assigned": ("algorithm", "expected equations"),
    "Alias": ("initial", "the value of one state: v = 3"),
    "Placed": ("initial", "the value of one state: phi = 1"),
    "Risen": ("initial", "the value of one state: rise = 5"),
    "Doubled": ("expression", r"the function Parts.exp\(1\)"),
    "Unsaid": ("value", "R=…"),
    "Reversed": ("connector", "connector p of m, N.m, expected one of V, A"),
    "Nothing": ("flat", "cannot be flattened"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_it_is_refused_with_the_reason(parts, name):
    fault, text = REFUSED[name]
    with pytest.raises(ephs.ModelicaError, match=f"Parts.{name}: .*{text}") as caught:
        parts.read(f"Parts.{name}")
    assert caught.value.fault == fault


@pytest.mark.parametrize(
    ("name", "parameters", "fault"),
    [
        ("Resistor", {"R": -1.0}, "power"),
        ("Gyrator", {"G2": 3.0}, "power"),
        ("Spring", {"c": -1.0}, "unstable"),
        ("Spring", {"d": -0.1}, "power"),
        ("Coils", {"M": 4.0}, "unstable"),
        ("Conductor", {"G": -1.0}, "second"),
        ("Capacity", {"C": -1.0}, "thermal"),
        ("Resistor", {"Ohm": 1.0}, "parameter"),
    ],
)
def test_numbers_can_make_it_unlawful(parts, name, parameters, fault):
    parts.read(f"Parts.{name}")
    with pytest.raises(ephs.ModelicaError) as caught:
        parts.read(f"Parts.{name}", **parameters)
    assert caught.value.fault == fault


def test_files_that_are_none(tmp_path):
    for text, fault in (("model A end B", "text"), (None, "file")):
        file = tmp_path / f"{fault}.mo"
        if text:
            file.write_text(text)
        with pytest.raises(ephs.ModelicaError, match=fault) as caught:
            ephs.ModelicaLibrary(file)
        assert caught.value.fault == fault


def test_every_part_is_tested(parts):
    from tests.modelica.test_laws import TAKEN

    tested = {case.split(",")[0] for case in TAKEN} | REFUSED.keys()
    assert {name.removeprefix("Parts.") for name in parts.models("Parts")} == tested - {"Nothing"}
