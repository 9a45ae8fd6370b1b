"""Brakes by the natural methods: small heat capacities and what stops within a step, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import ephs
from ephs.solve.running.control import Symmetric
from examples.failing import scene
from tests.numerics import EPS
from tests.oscillator import rubbed_oscillator
from tests.semantics.zoo import drag

RATE, ENERGY, WARM = 100.0, 5000.0, 300.0


def brake(friction, capacity=None):
    """A disc of 1 kg m² at 100 rad/s; its friction warms a pad from 300 K."""
    heat = 'heat = "pad"' if capacity else ""
    pad = f"[thermal.pad]\ncapacity = {capacity!r}\ntemperature = {WARM}" if capacity else ""
    return scene(
        f"""
        [bodies.disc]
        mass = 1.0
        inertia = [0.5, 0.5, 1.0]
        angular_velocity = [0.0, 0.0, {RATE}]
        [joints.pin]
        type = "revolute"
        bodies = ["ground", "disc"]
        at = [0.0, 0.0, 0.0]
        axis = [0.0, 0.0, 1.0]
        friction = {friction!r}
        {heat}
        {pad}
        """,
        "[world]\ngravity = [0.0, 0.0, 0.0]\n",
    )


@settings(max_examples=12)
@given(
    method=st.sampled_from(["natural", "natural4"]),
    friction=st.sampled_from([20.0, 1e3, 1e6]),
    capacity=st.sampled_from([1e-3, 1e-2, 0.1, 10.0]),
    step=st.sampled_from([0.002, 0.05]),
)
def test_a_small_capacity_takes_what_the_disc_lost(method, friction, capacity, step):
    """s = C log(1 + Q/Cθ⁰), whatever the step: rounding by the ratio of temperatures, and of Q."""
    sol = ephs.simulate(brake(friction, capacity), 10.0 * step, method=method, step=step, audit="off")
    lost = ENERGY - 0.5 * sol.joint("pin").rate[-1].item() ** 2
    exact = capacity * math.log1p(lost / (capacity * WARM))
    condition = 1.0 + lost / (capacity * WARM)
    assert sol.stats["cut_steps"] <= 1
    assert abs(float(np.ravel(sol["thermal.pad.s"][-1])[0]) - exact) <= 10.0 * EPS * (
        condition * exact + ENERGY / (condition * WARM)
    )
    assert sol.energy_error.max() <= 10.0 * condition * EPS


@pytest.mark.parametrize("capacity", [None, 1.0, 1e-3])
def test_chosen_steps_of_order_4_stop_a_stiff_brake(capacity):
    """All that the disc had is heat after 1 s; rates are wanted to 1e-7 rad/s."""
    sol = ephs.simulate(brake(1e6, capacity), 1.0, method="natural4", rtol=1e-6)
    assert abs(sol.joint("pin").rate[-1].item()) <= 1e-6
    assert sol.stats["steps"] <= 100


@pytest.mark.parametrize("friction", [1e5, 1e6, 1e8])
def test_chosen_steps_of_order_2_are_refused_by_state_step_and_method(friction):
    """The step that is named falls with the friction; the control is a brake that steps of 1 ms resolve."""
    with pytest.raises(ephs.SimulationError) as caught:
        ephs.simulate(brake(friction), 1.0, method="natural")
    error = caught.value
    assert error.outcome is ephs.Outcome.TINY and error.time == 0.0
    assert error.path == "joints.pin.env.s"
    named = float(error.equation.split("about ")[1].split(" s")[0])
    assert named * friction <= 1e-6
    assert "radau" in error.advice
    sol = ephs.simulate(brake(1.0), 1.0, method="natural", rtol=1e-3, atol=1e-3)
    assert abs(sol.joint("pin").rate[-1].item() - RATE * math.exp(-1.0)) <= 1e-3 * RATE


@given(power=st.floats(1.5, 7.0), size=st.floats(1e-6, 1e6), span=st.floats(0.1, 1e3))
def test_the_step_that_is_named_would_do(power, size, span):
    """An error of ``size`` at 1 s falls with a power of the step, to what is aimed at."""
    policy = Symmetric(power)
    h = policy.wanted(1.0, size, span)
    error = size * h**power * span / h
    assert error == pytest.approx(Symmetric.AIM, rel=1e-9) or size * span < 1e-12


@pytest.mark.parametrize("method", ["natural4", "radau", "rk87", "auto"])
@pytest.mark.parametrize("power", [0.25, 0.5])
def test_friction_that_grows_as_a_power_below_one_starts_from_rest(power, method):
    """q″ = −q − |q′|^a q′ from rest at 1; with a < 0 there is no force at rest, and the component is named."""

    def system(power):
        return rubbed_oscillator(mf=drag(lambda p, s: abs(p) ** power)())

    options = {"step": 5e-3} if method == "natural4" else {"rtol": 1e-9}
    options["initial"] = {"pe.q": 1.0}
    sol = ephs.simulate(system(power), 1.0, method=method, **options)
    found = solve_ivp(
        lambda t, y: [y[1], -y[0] - abs(y[1]) ** power * y[1]], (0.0, 1.0), [1.0, 0.0], rtol=1e-11, atol=1e-12
    )
    assert sol["ke.p"][-1] == pytest.approx(found.y[1, -1], rel=1e-7)
    with pytest.raises(ephs.SimulationError, match=r"at mf: .* a flow that is not a finite number"):
        ephs.simulate(system(-0.5), 1.0, method=method, **options)
