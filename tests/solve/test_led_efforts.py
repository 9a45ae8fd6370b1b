"""Efforts that a function of time or of states leads: motion, heat and what flows at their ports, by closed forms."""

import numpy as np
import pytest

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs.solve.methods import radau
from ephs.solve.result import ports
from tests.numerics import largest
from tests.written import scene_of_text

ROUNDED = 1e-9
COIL = Pattern.from_text("b: flux_linkage, exposed; s: entropy; coil(b); wire(b, s); room(s)")
ARM = """
format = 1
name = "arm"
[bodies.arm]
mass = 2.0
inertia = [0.1, 0.2, 0.3]
position = [0.5, 0.0, 0.0]
[joints.pin]
type = "revolute"
bodies = ["ground", "arm"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
motion = { amplitude = 0.7, frequency = 0.5 }
"""


def led(coil, current, until, **options):
    """A coil with a wire of 1 Ω under a current that a function of time leads."""
    system = COIL(coil=coil, wire=lib.resistor(r=1.0), room=lib.environment())
    return ephs.simulate(system, until, inputs={"b": {"effort": current}}, method="radau", **options)


@pytest.mark.parametrize("every", ["steps", "instants"])
@pytest.mark.parametrize("omega", [1.0, 10.0, 100.0])
def test_a_led_current_has_its_linkage_heat_and_voltage_whatever_its_frequency(omega, every):
    rtol = 1e-6
    save_at = None if every == "steps" else np.linspace(0.0, 5.0, 38)
    sol = led(lib.inductor(l=2.0), lambda t: np.sin(omega * t), 5.0, rtol=rtol, save_at=save_at)
    t, here = sol.t, sol.port("b")
    heat = 0.5 * (t - np.sin(2.0 * omega * t) / (2.0 * omega))
    assert np.allclose(sol["coil.b"].ravel(), 2.0 * np.sin(omega * t), atol=ROUNDED)
    assert np.allclose(sol.heat, heat, rtol=rtol, atol=rtol * heat[-1])
    assert np.allclose(sol.work, heat + 2.0 * 0.5 * np.sin(omega * t) ** 2, rtol=rtol, atol=rtol * heat[-1])
    voltage = 2.0 * omega * np.cos(omega * t) + np.sin(omega * t)
    assert np.allclose(here.flow[:, 0], voltage, atol=ports.DOUBTED * largest(voltage))
    assert np.allclose(here.power, voltage * np.sin(omega * t), atol=ports.DOUBTED * largest(voltage))


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("inductance", [1e-3, 2.0, 1e3])
def test_a_short_run_has_its_work_whatever_is_stored(inductance, rtol, monkeypatch):
    """Its voltage is a difference of linkages, which a step of a microsecond has to few digits."""
    sol = led(lib.inductor(l=inductance), lambda t: np.cos(3.0 * t), 1e-3, rtol=rtol, initial={"coil.b": inductance})
    heat = 0.5 * (sol.t + np.sin(6.0 * sol.t) / 6.0)
    stored = -0.5 * inductance * np.sin(3.0 * sol.t) ** 2
    rounded = len(sol) * radau.ROUNDING * inductance
    assert largest(sol.work - (heat + stored)) <= 10.0 * (rtol * largest(sol.work) + rounded)
    if inductance == 1e3:
        monkeypatch.setattr(radau, "ROUNDING", 0.0)
        with pytest.raises(ephs.SimulationError, match="below the smallest"):
            led(lib.inductor(l=inductance), np.cos, 1e-3, rtol=1e-12, initial={"coil.b": inductance})


def voltage_error(knee):
    """Error of the voltage of a coil that saturates at a linkage, relative; the current reaches it."""
    rtol, most = 1e-8, 0.5 * knee
    sol = led(lib.saturating_inductor(l=2.0, knee=knee), lambda t: most * np.sin(t), 3.0, rtol=rtol, atol=1e-10 * knee)
    current, linkage = most * np.sin(sol.t), knee * np.arcsinh(np.sin(sol.t))
    exact = most * np.cos(sol.t) * 2.0 / np.cosh(linkage / knee) + current
    return largest(sol.port("b").flow[:, 0] - exact) / largest(exact)


@pytest.mark.parametrize("knee", [1e2, 1.0, 1e-2, 1e-4])
def test_the_voltage_of_a_coil_that_saturates_is_right_at_every_size(knee):
    assert voltage_error(knee) < 1e-6


def test_another_curvature_of_its_energy_would_show(monkeypatch):
    from ephs.solve.equations import instant

    exact = instant.curvature
    monkeypatch.setattr(instant, "curvature", lambda *given: 1.01 * exact(*given))
    assert voltage_error(1.0) > 1e-3


def test_an_effort_that_reads_states_rises_with_them():
    """The current of one coil leads that of another: b₁ = e^{−t/2}, b₂ = 3 b₁²."""
    pattern = Pattern.from_text(
        "a: flux_linkage; b: flux_linkage, exposed; s: entropy; one(b=a); wire(b=a, s); two(b); room(s)"
    )
    system = pattern(one=lib.inductor(l=2.0), wire=lib.resistor(r=1.0), two=lib.inductor(l=3.0), room=lib.environment())
    sol = ephs.simulate(
        system, 2.0, initial={"one.b": 1.0, "two.b": 3.0}, method="radau", rtol=1e-9, atol=1e-9,
        inputs={"b": {"effort": lambda t, state: state["one.b"] ** 2}},
    )  # fmt: skip
    assert np.allclose(sol["two.b"].ravel(), 3.0 * np.exp(-sol.t), atol=1e-8)
    assert np.allclose(sol.port("b").flow[:, 0], -3.0 * np.exp(-sol.t), atol=1e-6)


def test_only_what_depends_on_a_lost_derivative_is_lost():
    """Of two coils that nothing ties the one whose current turns has no voltage there, the other has."""
    pattern = Pattern.from_text("a: flux_linkage, exposed; b: flux_linkage, exposed; one(b=a); two(b)")
    system = pattern(one=lib.inductor(l=2.0), two=lib.inductor(l=3.0))
    sol = ephs.simulate(
        system, 1.0, initial={"one.b": 1.0}, method="radau", save_at=[0.0, 0.5, 1.0], jumps=[0.5],
        inputs={"a": {"effort": lambda t: abs(t - 0.5)}, "b": {"effort": np.sin}},
    )  # fmt: skip
    assert np.array_equal(np.isnan(sol.port("a").flow[:, 0]), [False, True, False])
    assert np.allclose(sol.port("b").flow[:, 0], 3.0 * np.cos(sol.t), atol=1e-6)


def test_a_joint_that_a_function_leads_has_the_rates_and_wrenches_of_its_law():
    scene = scene_of_text(ARM)
    law, inertia = scene.joint("pin").motion, 0.3 + 2.0 * 0.5**2
    errors = []
    for step in (0.02, 0.01):
        given = {"drives.pin": {"effort": lambda t: [law.rate(t)]}}
        sol = ephs.simulate(scene.system(), 2.0, method="natural", step=step, inputs=given)
        joint = sol.joint("joints.pin")
        rate, moment = np.array([[law.rate(t), inertia * law.acceleration(t)] for t in sol.t]).T
        errors.append(largest(joint.rate[:, 0] - rate))
        assert np.allclose(joint.wrench[:, 2], moment, atol=ports.DOUBTED * largest(moment))
    assert errors[1] < 0.3 * errors[0] < 0.01  # of order two
