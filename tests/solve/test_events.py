"""Events are located wherever functions cross zero, also twice within a step."""

import numpy as np
import pytest

import ephs
from tests.written import scene_of_text

PENDULUM = scene_of_text("""
    format = 1
    name = "pendulum"
    [bodies.rod]
    mass = 1.0
    inertia = [0.001, 0.0834, 0.0834]
    position = [0.5, 0.0, 0.0]
    [joints.pin]
    type = "revolute"
    bodies = ["ground", "rod"]
    at = [0.0, 0.0, 0.0]
    axis = [0.0, 1.0, 0.0]
    """)
STEPS = {
    "rk54": {}, "rk87": {}, "radau": {}, "natural4": {}, "natural": {"step": 0.05}, "semi": {"step": 0.05},
}  # fmt: skip
methods = pytest.mark.parametrize("method", STEPS)


def crossings(values):
    return int(np.sum(values[1:] * values[:-1] < 0.0))


@methods
@pytest.mark.parametrize("seed", range(4))
def test_every_zero_of_a_drawn_function_of_time_is_found(method, seed):
    """Sums of three harmonics, of up to about a period in the longest steps."""
    rng = np.random.default_rng(seed)
    sizes, rates, phases = rng.uniform(0.5, 1.0, 3), rng.uniform(5.0, 40.0, 3), rng.uniform(0.0, 6.0, 3)

    def value(t, state=None):
        return float(sizes @ np.sin(rates * t + phases)) + 0.1

    sol = ephs.simulate(PENDULUM, 2.0, method=method, events=[ephs.Event(value, "zero")], **STEPS[method])
    fine = np.linspace(0.0, 2.0, 20001)
    assert [each.t for each in sol.events] == sorted(each.t for each in sol.events)
    assert len(sol.events) == crossings(np.array([value(t) for t in fine]))
    assert max(abs(value(each.t)) for each in sol.events) < 1e-11


def test_instants_of_steps_say_less():
    """The control: between them a function of that kind may have crossed and come back."""
    sol = ephs.simulate(PENDULUM, 2.0, method="rk87")
    seen = [crossings(np.sin(rate * sol.t + 0.3)) / (rate * 2.0 / np.pi) for rate in range(5, 45, 5)]
    assert min(seen) < 0.6


@methods
def test_a_state_that_touches_a_bound_between_instants_is_found(method):
    """The rod's centre passes its lowest point in a hundredth of a second, three times down and three times up."""
    event = ephs.Event(lambda t, state: state.bodies.rod.position[2] + 0.49995, "below")
    sol = ephs.simulate(PENDULUM, 3.0, method=method, events=[event], **STEPS[method])
    assert len(sol.events) == 6
    unseen = ephs.simulate(PENDULUM, 3.0, method=method, **STEPS[method]).body("rod").position[:, 2] + 0.49995
    assert crossings(unseen) < 6  # the control
    down = ephs.Event(event.function, "below", direction=-1, stop=True)
    ended = ephs.simulate(PENDULUM, 3.0, method=method, events=[down], **STEPS[method])
    assert ended.t[-1] == pytest.approx(sol.events[0].t, abs=1e-12)
    assert ended.body("rod").position[-1, 2] == pytest.approx(-0.49995, abs=1e-12)


def test_a_function_that_rests_costs_a_bounded_number_of_calls():
    """Rounding of what is zero bends at all scales."""
    calls = []

    def noise(t, state):
        calls.append(t)
        return 1e-16 * np.sin(1e9 * t)

    sol = ephs.simulate(PENDULUM, 0.5, method="rk87", events=[ephs.Event(noise, "noise")])
    assert len(calls) <= 1 + 101 * sol.stats["steps"] + 60 * len(sol.events)
