"""Rows of four-bars through configurations in which their constraints lose rank, against the equation of a pendulum."""

import numpy as np
import pytest

import ephs
from benchmarks.families import scene
from benchmarks.hard.loops import angles
from ephs.mechanics.methods.registry import METHODS, Setting
from ephs.mechanics.methods.stages import Stages
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.runs.simulate import control_of
from ephs.solve.posing.errors import Outcome, SolveError
from tests.numerics import largest

TIMES = np.linspace(0.0, 10.0, 41)
"""Cranks pass through alignment with the ground many times."""


@pytest.mark.parametrize("windows", [1, 3])
@pytest.mark.parametrize(
    ("method", "rtol"),
    [(method, rtol) for method in ("rk54", "rk87", "auto", "radau") for rtol in (1e-6, 1e-8)] + [("radau", 1e-10)],
)
def test_errors_follow_the_tolerance_through_alignment(windows, method, rtol):
    """To a hundred tolerances, as everywhere; what the closing takes out near a change of rank has to count."""
    made = scene("four-bar-windows", windows)
    sol = ephs.simulate(made, TIMES[-1], method=method, rtol=rtol, save_at=TIMES)
    angle = angles(windows, tuple(TIMES.tolist()))
    for crank in range(windows + 1):
        exact = np.column_stack([crank + 0.5 * np.cos(angle), 0.5 * np.sin(angle)])
        assert largest(sol.body(f"crank{crank}").position[:, :2] - exact) <= 100.0 * rtol


@pytest.mark.parametrize("windows", [2, 3])
@pytest.mark.parametrize("rtol", [1.013e-8, 1.026e-8, 1.05e-8, 3e-8])
def test_steps_of_many_stages_that_have_no_solution_there_are_taken_with_three(windows, rtol):
    """Seven stages alone were refused in 9 of 24 runs about 1e-8: what they are off by is less than rounding."""
    test_errors_follow_the_tolerance_through_alignment(windows, "radau", rtol)


def test_steps_with_three_stages_go_on_to_the_bit(monkeypatch):
    """From a snapshot in a method that was made anew, where those of more stages have no solution."""
    problem = problem_of_scene(scene("four-bar-windows", 3))
    control = control_of(problem, 13, 1e-8, 1e-8, None, None, None, None)

    def made():
        method, _ = METHODS["radau"].make(Setting(problem, 0.0, control, {}))
        assert method.scheme.nodes.size == 7
        return method, method.start(0.0, 1e-3)

    method, state = made()
    state = method.step(state, 1e-3).end
    assert method.snapshot(state)["own"]["fewer"] is None, "the control"
    solve = Stages.solve

    def few(stages, *given):
        if stages.scheme.nodes.size == 7:
            raise SolveError(Outcome.DIVERGED, "", "its rate")
        return solve(stages, *given)

    monkeypatch.setattr(Stages, "solve", few)
    state = method.step(state, 1e-3).end
    other, _ = made()
    other.restore(method.snapshot(state), state)
    one, two = (each.step(state, 1e-3).end for each in (method, other))
    assert np.array_equal(one.q, two.q) and np.array_equal(one.r, two.r)
