"""Loops of links whose masses differ by orders of magnitude: rank is one of kinematics, not of masses."""

import numpy as np
import pytest

import ephs
from benchmarks.hard import CASES
from tests.numerics import EPS


@pytest.mark.parametrize("heavy", ["crank", "coupler", "rocker"])
@pytest.mark.parametrize("method", ["auto", "rk87", "radau"])
def test_a_heavy_link_leaves_the_rank_of_the_loop_alone(method, heavy):
    """Against the equation of the one freedom, whose differences are good for 1e-9; methods for 100 tolerances."""
    case = CASES[f"heavy {heavy}"]
    assert case.error(ephs.simulate(case.make(), case.until, method=method)) <= 1e-4


@pytest.mark.parametrize("heavy", ["crank", "coupler", "rocker"])
@pytest.mark.parametrize(("method", "allowed"), [("natural", 1e-4), ("natural4", 1e-9)])
def test_component_by_component_too(method, allowed, heavy):
    """At constant steps of 0.01 s, to their errors at equal masses; balances to rounding."""
    case = CASES[f"heavy {heavy}"]
    sol = ephs.simulate(case.make(), case.until, method=method, step=0.01)
    assert case.error(sol) <= allowed
    assert sol.energy_error.max() <= 10.0 * np.sqrt(40) * 10.0 * EPS
