"""The time loop: its grid, what it keeps, how it fails, and that it is the method and nothing else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs import quantity as Q
from ephs.semantics import Reference
from ephs.semantics.meaning.step import step as oracle_step
from ephs.solve.equations.model import compile_model
from ephs.solve.methods.natural import Natural
from ephs.solve.running.control import Grid
from tests.numerics import largest
from tests.oscillator import free_oscillator

START = {"osc.pe.q": 1.0}


@given(st.floats(1e-3, 20.0), st.floats(1e-3, 30.0))
def test_the_grid_ends_on_until_and_its_steps_are_no_longer_than_the_step(span, h):
    grid = Grid(span, h)
    assert grid.whole * h <= span * (1.0 + 1e-8)
    assert grid.last <= h * (1.0 + 1e-8)
    assert grid.whole * h + grid.last == pytest.approx(span, rel=1e-8)


def test_times_are_multiples_of_the_step_and_the_end(damped):
    sol = ephs.simulate(damped, 1.005, initial=START, step=0.01)
    assert sol.t[-1] == 1.005
    assert np.array_equal(sol.t[:-1], 0.01 * np.arange(101))


def test_the_compiled_loop_takes_the_steps_of_the_plain_method(damped):
    flat = damped.flatten()
    state = flat.state(START)
    for _ in range(5):
        state, _ = oracle_step(flat, state, 0.05, Reference())
    sol = ephs.simulate(damped, 0.25, initial=START, step=0.05)
    for path, value in state.items():
        assert np.allclose(sol[path][-1], value, rtol=1e-12, atol=1e-15)


def test_a_step_is_pure_and_a_chunk_is_so_many_steps(damped):
    descriptor = damped.descriptor()
    method = Natural(compile_model(descriptor, Reference(), {}))
    start = method.init(descriptor.pack(damped.state(START)))
    once, again = method.step(start, 0.1), method.step(start, 0.1)
    assert np.array_equal(once.x, again.x)
    many, chunk = method.advance(start, 0.1, 3)
    single = method.step(method.step(once, 0.1), 0.1)
    assert np.array_equal(many.x, single.x)
    assert np.array_equal(chunk.rows.x[-1], many.x)
    assert np.array_equal(start.x, descriptor.pack(damped.state(START)))


def test_a_step_back_undoes_a_step():
    """The method is symmetric, without friction also in time."""
    system = free_oscillator(pe=ephs.storage({"q": Q.displacement}, lambda q: 0.25 * q**4))
    descriptor = system.descriptor()
    method = Natural(compile_model(descriptor, Reference(), {}))
    x0 = descriptor.pack(system.state({"pe.q": 1.0, "ke.p": 0.3}))
    there = method.step(method.init(x0), 0.1)
    back = method.step(method.init(there.x), -0.1)
    assert largest(back.x - x0) <= 1e-13


def test_dense_output_meets_the_times_asked_for(damped):
    every = ephs.simulate(damped, 1.0, initial=START, step=0.01)
    some = ephs.simulate(damped, 1.0, initial=START, step=0.01, save_at=[0.0, 0.25, 0.5, 0.503, 1.0])
    assert np.array_equal(some.t, [0.0, 0.25, 0.5, 0.503, 1.0])
    assert np.array_equal(some["osc.pe.q"][[0, 1, 2, 4]], every["osc.pe.q"][[0, 25, 50, 100]])
    shorter = ephs.simulate(damped, 0.503, initial=START, step=0.01)  # between steps a shorter one is taken
    assert some["osc.pe.q"][3] == pytest.approx(shorter["osc.pe.q"][-1], abs=1e-14)
    assert some.energy_error.max() <= 1e-13
    assert some.stats["steps"] == every.stats["steps"] == 100


@pytest.mark.parametrize(
    ("inputs", "names"),
    [(None, ("p", "open")), ({"p": 1.0}, ("p", "flow")), ({"p": {"force": 1.0}}, ("p", "effort")),
     ({"p": {"flow": [1.0, 2.0]}}, ("p", "1 finite number"))],
)  # fmt: skip
def test_open_ports_want_their_inputs(driven, inputs, names):
    with pytest.raises(ephs.AssemblyError) as caught:
        ephs.simulate(driven, 1.0, inputs=inputs)
    assert all(name in str(caught.value) for name in names)


@pytest.mark.parametrize(
    "force", [0.7, lambda t: 0.7, lambda t, state: 0.7], ids=["constant", "of t", "of t and state"]
)
def test_a_force_works_and_its_work_is_in_the_balance(driven, force):
    """From rest under a constant force: q = F/k (1 − cos ωt)."""
    sol = ephs.simulate(driven, 2.0, step=0.01, inputs={"p": {"flow": force}})
    exact = 0.7 / 1.5 * (1.0 - np.cos(np.sqrt(1.5) * sol.t))
    assert largest(sol["pe.q"] - exact) < 1e-4
    assert largest(sol.work - 0.7 * sol["pe.q"]) <= 1e-13
    assert sol.energy_error.max() < 1e-13


def test_inputs_of_time_enter_at_order_two(driven):
    """Resonance-free forcing: q = F/(k − Ω²) (cos Ωt − cos ωt)."""
    k, forced = 1.5, 2.0

    def exact(t):
        return (np.cos(forced * t) - np.cos(np.sqrt(k) * t)) / (k - forced**2)

    errors = []
    for h in (0.04, 0.02, 0.01):
        sol = ephs.simulate(driven, 4.0, step=h, inputs={"p": {"flow": lambda t: np.cos(forced * t)}})
        errors.append(largest(sol["pe.q"] - exact(sol.t)))
    assert np.allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.05)


def test_a_prescribed_effort_holds_and_its_work_is_in_the_balance(driven):
    sol = ephs.simulate(driven, 1.0, step=0.01, initial={"ke.p": 0.5}, inputs={"p": {"effort": 0.5}})
    assert largest(sol["pe.q"] - 0.5 * sol.t) <= 1e-13
    assert largest(sol.work - 0.75 * sol["pe.q"] ** 2) <= 1e-13


def test_progress_is_told_and_the_times_ascend(damped):
    seen = []
    ephs.simulate(
        damped,
        2.0,
        initial=START,
        step=0.001,
        progress=lambda t, until, stats: seen.append((t, until, stats["steps"])),
    )
    assert seen[-1][:2] == (2.0, 2.0)
    assert [t for t, _, _ in seen] == sorted(t for t, _, _ in seen)


def test_a_volume_wants_an_initial_value():
    from examples import physics

    start = dict(physics.CYLINDER_START)
    start.pop("gas1.v")
    with pytest.raises(ephs.SemanticsError, match=r"gas1\.v: the initial volume is 0\.0, expected a number > 0"):
        ephs.simulate(physics.cylinder, 1.0, initial=start, step=0.1)


def test_an_energy_that_is_not_smooth_where_the_run_begins_is_named():
    root = ephs.storage({"q": Q.displacement}, lambda q: np.sqrt(abs(q)))
    with pytest.raises(ephs.SimulationError, match=r"t = 0 s at pe: an energy or a flow that is not a finite"):
        ephs.simulate(free_oscillator(pe=root), 1.0, step=0.1)


@pytest.mark.parametrize("method", ["natural", "natural4"])
def test_a_time_within_rounding_of_a_step_is_that_step(damped, method):
    """A step of 1e-17 s has rates that are differences of equal numbers."""
    every = ephs.simulate(damped, 0.2, initial=START, method=method, step=0.01)
    beside = [float(np.nextafter(t, 1.0)) for t in every.t[:-1]]
    some = ephs.simulate(damped, 0.2, initial=START, method=method, step=0.01, save_at=[*beside, 0.2])
    for path, values in every.states.items():
        assert np.array_equal(some.states[path], values)
