"""Units and exchanges that cannot be: one clear error each."""

import pytest

import ephs
from tests.solve.exchange.units import changed

PORT = {"effort": "force", "flow": "speed"}


def exchange(*names, file, period=0.01, wires=None, initial=None, **options):
    units = {name: ephs.library.fmu(file, **options) for name in names}
    return ephs.Exchange(units, period, wires or {}, initial or {})


def test_a_file_that_is_no_unit(tmp_path):
    (tmp_path / "a.fmu").write_bytes(b"nothing")
    for name in ("a.fmu", "none.fmu"):
        with pytest.raises(ephs.ExchangeError, match=name) as caught:
            ephs.library.fmu(tmp_path / name)
        assert caught.value.fault == "file"


@pytest.mark.parametrize(
    ("texts", "fault"),
    [
        ({'<CoSimulation modelIdentifier="spring" canHandleVariableCommunicationStepSize="true" '
          'canGetAndSetFMUstate="true"\n    canSerializeFMUstate="true"/>': '<ModelExchange modelIdentifier="spring"/>',
          'variability="continuous"': 'variability="continuous"'}, "kind"),
        ({'fmiVersion="2.0"': 'fmiVersion="7.0"'}, "file"),
    ],
)  # fmt: skip
def test_a_unit_of_another_kind(springs, tmp_path, texts, fault):
    with pytest.raises(ephs.ExchangeError) as caught:
        ephs.library.fmu(changed(springs, tmp_path, texts=texts))
    assert caught.value.fault == fault


@pytest.mark.parametrize(
    ("options", "fault", "text"),
    [
        ({"ports": {"end": {"effort": "forse", "flow": "speed"}}}, "variable", "did you mean 'force'"),
        ({"ports": {"end": {"effort": "force"}}}, "variable", "a variable named as its flow"),
        ({"ports": {"end": {"effort": "force", "flow": "impulse"}}}, "causal", "'impulse' are outputs of the unit"),
        ({"ports": {"end": {"effort": "impulse", "flow": "speed"}}}, "power", "impulse in N.s times speed in m/s"),
        ({"ports": {"end": {**PORT, "integral": "force"}}}, "integral", "force in N is not an integral"),
        ({"ports": {"end": {"effort": "stiffness", "flow": "speed"}}}, "causality", "'stiffness' is parameter"),
        ({"start": {"stifness": 1.0}}, "variable", "did you mean 'stiffness'"),
        ({"start": {"force": 1.0}}, "causality", "'force' is output"),
    ],
)
def test_ports_and_starts(springs, options, fault, text):
    with pytest.raises(ephs.ExchangeError, match=text) as caught:
        ephs.library.fmu(springs, **options)
    assert caught.value.fault == fault


@pytest.mark.parametrize(
    ("options", "fault", "text"),
    [
        ({"wires": {"a.speed": "b.forse"}}, "variable", "did you mean 'force'"),
        ({"wires": {"c.speed": 1.0}}, "unit", "'c': expected one of a, b"),
        ({"wires": {"a.force": 1.0}}, "causality", "expected input"),
        ({"wires": {"a.speed": [1.0, 2.0]}}, "source", "found"),
        ({"wires": {"a.speed": "b.force"}}, "units", "in m/s: b.force is in N"),
        ({"wires": {"a.speed": 1.0}, "ports": {"end": PORT}}, "taken", "a.speed"),
        ({"period": 0.0}, "period", "> 0"),
    ],
)
def test_wires_and_periods(springs, options, fault, text):
    with pytest.raises(ephs.ExchangeError, match=text) as caught:
        exchange("a", "b", file=springs, **options)
    assert caught.value.fault == fault


def test_a_loop_of_what_depends_on_the_same_instant_is_refused_unless_it_is_cut(springs, tmp_path):
    texts = {'<Unknown index="2" dependencies=""/>': '<Unknown index="2" dependencies="1"/>', ' unit="N"': ""}
    file = changed(springs, tmp_path, texts=texts)
    around = {"a.speed": "b.force", "b.speed": "a.force"}
    with pytest.raises(ephs.ExchangeError) as caught:
        exchange("a", "b", file=file, wires=around)
    assert str(caught.value).startswith("algebraic loop between units: a.speed <- b.force <- b.speed <- a.force")
    exchange("a", "b", file=file, wires=around, initial={"a.force": 0.0})
    exchange("a", "b", file=file, wires={"a.speed": "b.force"})
    (folder := tmp_path / "free").mkdir()
    exchange("a", "b", file=changed(springs, folder, texts={' unit="N"': ""}), wires=around)


def test_a_period_below_the_step_of_a_unit_or_of_the_run(carts, cart, springs, tmp_path):
    texts = {'canSerializeFMUState="true"': 'canSerializeFMUState="true" fixedInternalStepSize="0.01"'}
    file = changed(carts, tmp_path, texts=texts)
    exchange("a", file=file, period=0.03)
    for period in (0.001, 0.015):
        with pytest.raises(ephs.ExchangeError, match=r"multiple of the step of unit .a., 0\.01 s"):
            exchange("a", file=file, period=period)
    coupling = exchange("a", file=springs, ports={"end": PORT}).couple({"joints.rail": "a.end"})
    with pytest.raises(ephs.OptionError, match="at most the period"):
        ephs.simulate(cart, 1.0, inputs=coupling.inputs, min_step=0.1, method="rk87")


@pytest.mark.parametrize(
    ("targets", "fault"),
    [
        ({"joints.rail": "a.ends"}, "target"),
        ({"bodies.cart": "a.end"}, "outer"),
        ({"joints.rail": ephs.Bond("a.force", lambda t, state: 0.0)}, "target"),
        ({"joints.rail": "a.end", "joints.other": "a.end"}, "twice"),
    ],
)
def test_what_a_system_is_given(springs, targets, fault):
    with pytest.raises(ephs.ExchangeError) as caught:
        exchange("a", file=springs, ports={"end": PORT}).couple(targets)
    assert caught.value.fault == fault


def test_a_unit_that_fails_ends_the_run_where_it_does(cart, springs):
    """The spring refuses lengths beyond 1 km."""
    wires = {"a.speed": lambda t, state: 1e5 * t}
    with pytest.raises(ephs.ExchangeError, match=r"unit a at t = 0\.2 s: fmi2DoStep failed"):
        exchange("a", file=springs, wires=wires, period=0.05).run(1.0)
    with pytest.raises(ephs.ExchangeError, match="whole periods"):
        exchange("a", file=springs, wires=wires, period=0.05).run(0.12)
    coupling = exchange("a", file=springs, wires=wires, period=0.05).couple({"joints.rail": "a.force"})
    with pytest.raises(ephs.SimulationError, match=r"unit a at t = 0\.2 s") as caught:
        ephs.simulate(cart, 1.0, inputs=coupling.inputs, method="rk87")
    assert caught.value.partial is not None
