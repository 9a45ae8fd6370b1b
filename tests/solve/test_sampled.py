"""Sampled inputs: discrete controllers by every method, against the exact sampled plant."""

from bisect import bisect_right

import numpy as np
import pytest
from scipy.linalg import expm

import ephs
from ephs.mechanics.methods.registry import METHODS
from ephs.solve.posing.errors import OptionError
from ephs.solve.running import journal
from tests.numerics import EPS, largest
from tests.written import scene_of_text

MASS, STIFFNESS, START = 2.0, 8.0, 0.3

PERIOD, UNTIL = 0.05, 1.0
GAINS = 60.0, 14.0
CART = f"""
format = 1
[bodies.cart]
mass = {MASS}
inertia = [0.1, 0.1, 0.1]
position = [{START}, 0.0, 0.0]
[joints.rail]
type = "prismatic"
bodies = ["ground", "cart"]
frame1 = {{ rotation = [0.7071067811865476, 0.0, 0.7071067811865476, 0.0] }}
frame2 = {{ rotation = [0.7071067811865476, 0.0, 0.7071067811865476, 0.0] }}
stiffness = {STIFFNESS}
"""
SECOND, STEERED = 1e-3, 1e-7
"""Methods of second order at h = 5 ms: (γ h)² v with the plant's damping γ = 7/s and speeds v below 1 m/s; the others
at rtol = 1e-10, over 20 samples of which each starts anew."""
PLAIN = ("natural", "natural4", "variational")
"""Methods that are run at constant steps."""


@pytest.fixture
def cart():
    return scene_of_text(CART)


def control(t, state):
    rail = state.joints.rail
    return -GAINS[0] * rail.coordinate - GAINS[1] * rail.rate


def exact(samples, *, delay=0, limit=np.inf, gain=0.0):
    """(samples + 1, 2) place and speed at the samples, (samples,) forces, by the matrix exponential of the plant.

    The gain is that of the sum of places.
    """
    plant = np.array([[0.0, 1.0, 0.0], [-STIFFNESS / MASS, 0.0, 1.0 / MASS], [0.0, 0.0, 0.0]])
    through = expm(plant * PERIOD)
    states, forces, total = [np.array([START, 0.0])], [], 0.0
    for k in range(samples):
        total += PERIOD * states[-1][0]
        wanted = -GAINS[0] * states[-1][0] - GAINS[1] * states[-1][1] - gain * total
        forces.append(float(np.clip(wanted, -limit, limit)))
        held = forces[k - delay] if k >= delay else 0.0
        states.append((through @ [*states[-1], held])[:2])
    return np.array(states), np.array(forces)


def run(cart, method="rk87", **changes):
    steps = {"step": 0.005} if method in PLAIN else {"rtol": 1e-10, "atol": 1e-12}
    sampled = ephs.Sampled(PERIOD, changes.pop("function", control), **changes)
    return ephs.simulate(cart, UNTIL, method=method, inputs={"joints.rail": sampled}, **steps)


def at_samples(sol):
    """(samples + 1, 2) place and speed."""
    where = [int(np.argmin(np.abs(sol.t - k * PERIOD))) for k in range(round(UNTIL / PERIOD) + 1)]
    assert largest(sol.t[where] - PERIOD * np.arange(len(where))) <= 1e-12  # steps end on samples
    rail = sol.joint("rail")
    return np.column_stack([rail.coordinate[where, 0], rail.rate[where, 0]])


def apart(sol, expected):
    return float(largest(at_samples(sol) - expected))


@pytest.mark.parametrize("method", sorted(METHODS))
def test_a_discrete_controller_is_the_exact_sampled_plant(cart, method):
    sol, (expected, forces) = run(cart, method), exact(round(UNTIL / PERIOD))
    tolerance = SECOND if METHODS[method].order <= 2 else STEERED
    assert apart(sol, expected) <= tolerance
    assert sol.audit.passed
    # the drive's work is force times distance, piece by piece
    work = float(forces @ np.diff(expected[:, 0]))
    assert abs(sol.work[-1] - work) <= tolerance * float(np.abs(forces) @ np.abs(np.diff(expected[:, 0]))) * 10.0


def test_the_same_function_at_every_moment_is_another_controller(cart):
    expected, _ = exact(round(UNTIL / PERIOD))
    free = ephs.simulate(cart, UNTIL, method="rk87", save_at=PERIOD * np.arange(21), inputs={"joints.rail": control})
    assert apart(free, expected) > 10.0 * SECOND


@pytest.mark.parametrize("method", ["rk54", "rk87", "radau"])
def test_a_sampled_input_is_a_function_of_time_with_declared_jumps(cart, method):
    """To rounding: held values need no evaluation of the function, and no states."""
    times, values = [], []

    def noted(t, state):
        times.append(t)
        values.append(control(t, state))
        return values[-1]

    steps = {"method": method, "step": 0.005}
    held = ephs.simulate(cart, UNTIL, inputs={"joints.rail": ephs.Sampled(PERIOD, noted)}, **steps)
    known = {"joints.rail": lambda t: values[bisect_right(times, t) - 1]}
    free = ephs.simulate(cart, UNTIL, inputs=known, jumps=times[1:], **steps)
    assert np.array_equal(held.t, free.t)
    for path, values_there in held.states.items():
        # corrections of the energy enlarge rounding where the cart nearly stands
        assert largest(values_there - free.states[path]) <= 64.0 * EPS * len(held)
    late = ephs.simulate(
        cart, UNTIL, inputs={"joints.rail": lambda t: values[bisect_right(times, t - 0.01) - 1]}, **steps
    )
    assert apart(late, at_samples(held)) > SECOND


def test_delay_limits_and_the_first_value_are_those_of_the_exact_plant(cart):
    for delay, limit in ((1, np.inf), (2, 5.0), (0, 5.0)):
        expected, _ = exact(round(UNTIL / PERIOD), delay=delay, limit=limit)
        changes = {"limits": (-limit, limit)} if limit < np.inf else {}
        assert apart(run(cart, delay=delay * PERIOD, **changes), expected) <= STEERED
        assert apart(run(cart), expected) > 10.0 * SECOND


def test_steps_end_where_a_delayed_value_takes_effect(cart):
    sol = run(cart, delay=0.4 * PERIOD, initial=2.5)
    for k in range(20):
        assert np.abs(sol.t - (k + 0.4) * PERIOD).min() <= 1e-12
    first = sol.t <= 0.4 * PERIOD
    w = np.sqrt(STIFFNESS / MASS)
    still = 2.5 / STIFFNESS
    under_the_first = still + (START - still) * np.cos(w * sol.t[first])
    assert largest(sol.joint("rail").coordinate[first, 0] - under_the_first) <= STEERED


def test_memory_goes_from_sample_to_sample(cart):
    """A sum of errors: an integrator in the controller, as the exact plant has it by hand."""

    def integral(t, state, total):
        total = total + PERIOD * float(state.joints.rail.coordinate[0])
        return -30.0 * total + control(t, state), total

    expected, _ = exact(20, gain=30.0)
    assert apart(run(cart, function=integral, memory=0.0), expected) <= STEERED


def test_noise_is_what_its_seed_says_and_is_as_large_as_it_is_said_to_be(cart):
    """Of one seed the same by any method and step; its mean and size those of a normal distribution."""

    def heard(**changes):
        seen = []

        def listen(t, state):
            seen.append(float(state.joints.rail.coordinate[0]))
            return 0.0

        steps = changes.pop("steps", {"rtol": 1e-9})
        sampled = ephs.Sampled(0.002, listen, **changes)
        sol = ephs.simulate(cart, 1.0, method="rk87", inputs={"joints.rail": sampled}, save_at=[1.0], **steps)
        assert sol.stats["jumps"]["samples"] == {"joints.rail": len(seen)}
        return np.array(seen)

    still = heard()
    noisy = heard(noise={"joints.rail.coordinate": 0.01}, seed=4)
    assert np.array_equal(noisy, heard(noise={"joints.rail.coordinate": 0.01}, seed=4))
    assert not np.array_equal(noisy, heard(noise={"joints.rail.coordinate": 0.01}, seed=5))
    other = heard(noise={"joints.rail.coordinate": 0.01}, seed=4, steps={"step": 0.001})
    assert largest(noisy - other) <= 1e-7
    off = (noisy - still) / 0.01
    assert abs(off.mean()) <= 5.0 / np.sqrt(off.size)
    assert abs(off.std() - 1.0) <= 5.0 / np.sqrt(2.0 * off.size)


@pytest.mark.parametrize(
    "options",
    [{"method": "rk87", "step": PERIOD}, {"method": "natural4", "step": PERIOD}, {"method": "rk87", "rtol": 1e-10}],
    ids=str,
)
def test_a_run_that_stops_on_a_sample_takes_it_once(cart, tmp_path, monkeypatch, options):
    """And goes on from its journal with what was held, and what the controller remembers."""
    monkeypatch.setattr(journal, "EVERY", -1.0)
    taken, stop = [], [np.inf]

    def function(t, state, before):
        taken.append(t)
        return control(t, state) - before, 0.1 * float(state.joints.rail.coordinate[0])

    def progress(t, until, stats):
        if t > stop[0]:
            raise KeyboardInterrupt

    def go(**more):
        taken.clear()
        inputs = {"joints.rail": ephs.Sampled(PERIOD, function, memory=0.0)}
        return ephs.simulate(cart, UNTIL, inputs=inputs, progress=progress, **options, **more)

    whole, times = go(), taken[1:]
    stop[0] = 0.12
    monkeypatch.setattr("ephs.solve.running.loop.RESPONSE", -1.0)  # every step is told
    file = tmp_path / "run.journal"
    with pytest.raises(ephs.Interrupted):
        go(journal=file)
    before, stop[0] = taken[1:], np.inf
    sol = go(journal=file)
    assert sorted({*before, *taken[1:]}) == times
    assert all(np.array_equal(sol.states[path], whole.states[path]) for path in whole.states)


@pytest.mark.parametrize("method", ["natural4", "radau"])
def test_a_system_by_hand_takes_a_sampled_input(driven, method):
    """A mass on a spring of 1.5 N/m, at rest, pushed by what its place at the samples says."""
    sampled = ephs.Sampled(0.25, lambda t, state: 1.0 - 0.8 * state["pe.q"])
    steps = {"step": 0.01} if method == "natural4" else {"rtol": 1e-9, "atol": 1e-11}
    sol = ephs.simulate(driven, 2.0, method=method, inputs={"p": {"flow": sampled}}, **steps)
    through, x = expm(np.array([[0.0, 1.0, 0.0], [-1.5, 0.0, 1.0], [0.0, 0.0, 0.0]]) * 0.25), np.zeros(2)
    for k in range(9):
        assert abs(sol["pe.q"][int(np.argmin(np.abs(sol.t - 0.25 * k)))] - x[0]) <= 1e-7
        x = (through @ [*x, 1.0 - 0.8 * x[0]])[:2]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"period": 0.0}, "Sampled.period is 0.0"),
        ({"period": float("nan")}, "Sampled.period is nan"),
        ({"period": 1e-15}, "at least"),
        ({"delay": -1.0}, "delay"),
        ({"limits": (1.0, -1.0)}, "limits"),
        ({"function": 3.0}, "function"),
        ({"noise": {"joints.rail.rate": -1.0}}, "noise"),
        ({"noise": {"joints.roil.rate": 1.0}}, "did you mean 'rail'"),
    ],
)
def test_what_no_controller_can_be_is_refused(cart, change, text):
    given = {"period": PERIOD, "function": control} | change
    with pytest.raises((OptionError, ephs.SimulationError), match=text):
        ephs.simulate(cart, 1.0, inputs={"joints.rail": ephs.Sampled(**given)})


def test_samples_below_the_least_step_and_backward_in_time_are_refused(cart):
    inputs = {"joints.rail": ephs.Sampled(PERIOD, control)}
    with pytest.raises(OptionError, match="at most the period of"):
        ephs.simulate(cart, 1.0, inputs=inputs, min_step=0.1)
    with pytest.raises(OptionError, match="forward in time"):
        ephs.simulate(cart, -1.0, inputs=inputs)
    with pytest.raises(ephs.SimulationError, match=r"t = 0.1 s.*ZeroDivisionError"):
        ephs.simulate(
            cart, 1.0, inputs={"joints.rail": ephs.Sampled(PERIOD, lambda t, state: 1.0 / 0.0 if t > 0.09 else 0.0)}
        )
