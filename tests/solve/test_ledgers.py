"""Ledgers of parts at every level, and what outer ports carried."""

import numpy as np
import pytest

import ephs
from ephs import Pattern, junction, library, quantity
from ephs.operad import Path
from ephs.show.plots.flows import exergy_bands
from examples import oscillator, physics
from examples.failing import pendulum
from tests.numerics import EPS, largest
from tests.scenes import shipped

START = {"stator.tc.s": 1.0, "rotor.tc.s": 1.0, "stator.coil.b": 0.3}


@pytest.fixture(scope="module")
def motor():
    drive = {"q": {"effort": np.sin}, "p": {"flow": -0.1}}
    return ephs.simulate(physics.motor, 4.0, initial=START, inputs=drive, step=0.02)


@pytest.fixture(scope="module")
def cylinder():
    return ephs.simulate(physics.cylinder, 5.0, initial=physics.CYLINDER_START, step=0.05)


def entries(entry):
    yield entry
    for part in entry.parts.values():
        yield from entries(part)


@pytest.mark.parametrize("name", ["motor", "cylinder"])
def test_ledgers_add_up_at_every_level_and_balance(name, request):
    sol = request.getfixturevalue(name)
    whole = sol.ledger()
    for entry in entries(whole):
        for book in ("energy", "exergy", "entropy", "volume", "momentum", "made", "destroyed"):
            if entry.parts:
                parts = np.sum([getattr(part, book) for part in entry.parts.values()], axis=0)
                assert np.array_equal(getattr(entry, book), parts) or np.allclose(
                    getattr(entry, book), parts, rtol=1e-14
                )
        assert np.array_equal(sol.ledger(entry.path).energy, entry.energy)
        assert np.all(np.diff(entry.made) >= -1e-15 * entry.made.max(initial=1e-300))
    # of the whole, what is supplied is what the run counted at the outer ports, in every step
    held = sum(largest(energy) for energy in sol.ledgers.storages.values())
    assert largest(whole.energy_supplied - sol.work) <= 1e-13 * held * np.sqrt(len(sol))
    scale = largest(whole.exergy) + largest(whole.destroyed)
    assert largest(whole.exergy_supplied - sol.ledgers.supplied) <= 1e-12 * scale


def test_volume_is_handed_from_gas_to_gas(cylinder):
    whole, first, second = cylinder.ledger(), cylinder.ledger("gas1"), cylinder.ledger("gas2")
    assert largest(whole.volume - whole.volume[0]) <= 1e-14 * whole.volume[0]
    assert np.ptp(first.volume) > 1e-3
    assert np.allclose(np.diff(first.volume), -np.diff(second.volume), atol=1e-15)
    assert largest(whole.energy_supplied) <= 1e-11 * largest(whole.energy)


def test_a_dissipating_part_is_supplied_what_it_destroys(motor):
    friction = motor.ledger("rotor.mf")
    assert np.array_equal(friction.exergy_supplied, friction.destroyed)
    assert not friction.energy.any()
    reference = 293.15
    assert np.allclose(friction.destroyed, reference * friction.made, rtol=1e-15)
    assert np.array_equal(friction.entropy_supplied, -friction.made)  # it stores none


def test_an_entry_prints_its_parts(motor):
    text = str(motor.ledger("rotor"))
    assert "exergy stored" in text
    assert [line.split()[0] for line in text.splitlines()[2:]] == ["rotor", *motor.ledger("rotor").parts]
    with pytest.raises(KeyError, match="no storage and no irreversible component there"):
        motor.ledger("rotor.mkc")


@pytest.mark.parametrize("path", [".", "rotor", "rotor.tc"])
def test_sources_and_sinks_of_exergy_balance(motor, path):
    bands = exergy_bands(motor, path)
    given, taken = (sum(band.amount for band in bands if band.source == side) for side in (True, False))
    assert given == pytest.approx(taken, rel=1e-9)
    assert all(band.amount > 0.0 for band in bands)


def test_ports_carry_the_work_of_the_run(motor):
    """The power at the ports, integrated over time, is what the run counted: the rest is of second order."""
    power = motor.port("q").power + motor.port("p").power
    assert np.trapezoid(power, motor.t) == pytest.approx(motor.work[-1], rel=1e-3)
    voltage, load = motor.port("q"), motor.port("p")
    assert np.allclose(voltage.effort[:, 0], np.sin(motor.t), atol=1e-12)
    assert np.allclose(load.flow, -0.1)
    # the current is that of the coils, the speed that of the rotor
    coils = motor["stator.coil.b"] / dict(physics.motor.leaves())[ephs.Path.of("stator.coil")].parameters[0][1]
    coils = coils + motor["rotor.coil.b"] / dict(physics.motor.leaves())[ephs.Path.of("rotor.coil")].parameters[0][1]
    assert np.allclose(voltage.flow[:, 0], coils, rtol=1e-9, atol=1e-12)
    assert np.array_equal(voltage.exergetic_power, voltage.power)  # neither entropy nor volume


def test_a_prescribed_velocity_needs_the_force_of_newton():
    """p.e = sin t at a mass on a spring: the force is m cos t + k q."""
    parts = oscillator.oscillator(
        pe=ephs.library.spring(k=3.0), ke=ephs.library.point_mass(m=2.0), pkc=ephs.library.pkc()
    )
    sol = ephs.simulate(parts, 1.0, step=0.001, inputs={"p": {"effort": np.sin}})
    force = sol.port("p").flow[:, 0]
    assert np.allclose(force, 2.0 * np.cos(sol.t) + 3.0 * sol["pe.q"], atol=1e-6)
    with pytest.raises(KeyError, match="no such outer power port; the ports are p"):
        sol.port("q")


@pytest.mark.parametrize("method", ["radau", "natural4"])
@pytest.mark.parametrize("bend", [0.0, 2.0])
def test_efforts_that_only_balances_determine_are_read_with_their_power(bend, method):
    """A coil without inductance: a current goes through a magnet and a conductor of 3 (1 + bend u²) u A at u V."""
    current, constant = 5.0, 2.0
    ports = {"b": quantity.flux_linkage, "s": quantity.entropy}
    motor = Pattern.from_text("b: flux_linkage, exposed; p: momentum; s: entropy; g(b, p); r(b, s); ke(p); room(s)")(
        g=ephs.gyrator({"b": quantity.flux_linkage, "p": quantity.momentum},
                       [[0.0, -constant], [constant, 0.0]], external_field=True),
        r=ephs.irreversible(ports, lambda b, s: 3.0 * (1.0 + bend * b * b) * np.array([[s, -b], [-b, b * b / s]])),
        ke=library.point_mass(m=1.0), room=library.environment(),
    )  # fmt: skip
    sol = ephs.simulate(motor, 1.0, initial={"ke.p": 1.0}, inputs={"b": {"flow": current}}, method=method)
    effort, rate = sol.port("b").effort[:, 0], np.ravel(sol["ke.p"])
    conducted = 3.0 * (1.0 + bend * effort**2) * effort
    assert largest(conducted - (current + constant * rate)) <= 1e-11 * largest(conducted)
    assert np.array_equal(sol.port("b").power, effort * current)


def test_the_defect_of_steps_is_no_supply():
    """Nothing reaches a falling brake from outside; what steps that damp lose of its energy is their defect."""
    sol = ephs.simulate(pendulum(6.0, "friction = 2.0"), 1.0, method="variational", step=0.02)
    whole = sol.ledger()
    assert not sol.work.any()
    assert not whole.energy_supplied.any()
    assert largest(whole.exergy_supplied) <= 1e-15 * largest(whole.exergy)
    assert np.array_equal(whole.defect, sol.energy - sol.energy[0])
    assert largest(whole.defect) > 1e-9
    assert np.allclose(whole.exergy_defect, whole.defect, atol=1e-12)
    parts = np.sum([part.energy_supplied for part in whole.parts.values()], axis=0)
    assert np.allclose(parts, whole.energy_supplied + whole.defect, atol=1e-12)
    assert "defect" in str(whole)


def test_fields_of_permanent_magnets_are_not_kinetic():
    """A motor that starts from rest has no kinetic energy; its magnet's field, which stays, is potential."""
    sol = ephs.simulate(shipped("motor-four-bar"), 0.02, method="rk54")
    storages = sol.ledgers.storages
    field = storages[Path.of("motors.drive.field")]
    assert sol.kinetic[0] == 0.0 and field[0] > 0.0 and np.array_equal(field, np.full(len(sol), field[0]))
    moving = sum(values for path, values in storages.items() if {"ke", "coil", "rotor", "armatures"} & set(path))
    assert np.allclose(sol.kinetic, moving, rtol=4.0 * EPS, atol=0.0)
    assert sol.energy_error.max() < 1e-13


@pytest.mark.parametrize("exposed", [False, True])
@pytest.mark.parametrize("beside", [{}, {"load": library.resistor(r=1.0)}], ids=["alone", "with a load"])
def test_a_flux_that_something_acts_on_is_kinetic(beside, exposed):
    """The control; what stores momentum moves, even if nothing acts on it."""
    held = {
        "coil": (library.inductor(l=2.0), quantity.flux_linkage),
        "mass": (library.point_mass(m=2.0), quantity.momentum),
    }
    found = {}
    for name, (storage, kind) in held.items():
        loads = beside if name == "coil" else {}
        (port,) = storage.interface
        boxes = {name: {port: "j"}} | {load: {"b": "j", "s": "s"} for load in loads}
        outer = {"s": junction(quantity.entropy)} if loads else {}
        heat = {"env": library.environment()} if loads else {}
        boxes |= {env: {"s": "s"} for env in heat}
        pattern = Pattern({"j": junction(kind, exposed=exposed)} | outer, boxes)
        given = {"j": {"flow": 0.0}} if exposed else None
        system = pattern(**{name: storage}, **loads, **heat)
        sol = ephs.simulate(
            system, 0.1, step=0.05, initial={f"{name}.{port}": 2.0}, method="radau", audit="off", inputs=given
        )
        found[name] = sol.kinetic[0], sol.potential[0]
    assert found["mass"] == (1.0, 0.0)
    assert found["coil"] == ((1.0, 0.0) if beside or exposed else (0.0, 1.0))
