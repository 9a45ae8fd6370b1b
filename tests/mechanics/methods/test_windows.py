"""Rows of four-bars through configurations in which their constraints lose rank, against the equation of a pendulum."""

import numpy as np
import pytest

import ephs
from benchmarks.families import scene
from benchmarks.hard.loops import angles

TIMES = np.linspace(0.0, 10.0, 41)
"""Cranks pass through alignment with the ground many times."""


@pytest.mark.parametrize("windows", [1, 2, 3])
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
        assert np.abs(sol.body(f"crank{crank}").position[:, :2] - exact).max() <= 100.0 * rtol


@pytest.mark.parametrize("windows", [2, 3])
@pytest.mark.parametrize("rtol", [1.013e-8, 1.026e-8, 1.05e-8, 3e-8])
def test_steps_of_many_stages_that_have_no_solution_there_are_taken_with_three(windows, rtol):
    """Seven stages alone were refused in 9 of 24 runs about 1e-8: what they are off by is less than rounding."""
    test_errors_follow_the_tolerance_through_alignment(windows, "radau", rtol)
