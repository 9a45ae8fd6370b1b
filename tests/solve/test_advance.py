"""Runs whose steps get ever shorter near a singularity end; those whose steps grow, or are short and steady, do not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.running.control import CRAWL, STRETCH, Advance


def walk(first, ratio, least, *, span=1.0, most=10_000):
    """Number of steps of lengths first·ratioⁿ, at least ``least``, until the end or an error."""
    advance, t, h = Advance(0.0, span), 0.0, first
    for count in range(1, most):
        t += h
        advance.require(count, t)
        if t >= span:
            return count
        h = max(h * ratio, least)
    return most


@given(st.floats(1e-6, 0.1), st.floats(0.1, 0.7), st.floats(1e-16, 0.9 * CRAWL))
def test_shrinking_steps_end_the_run(first, ratio, least):
    with pytest.raises(SolveError) as failed:
        walk(first, ratio, least)
    assert failed.value.outcome is Outcome.TINY


@given(st.floats(1e-15, 1e-3), st.floats(1.6, 5.0))
def test_growing_steps_do_not(first, ratio):
    assert walk(first, ratio, 0.0) < STRETCH + np.log(1.0 / first) / np.log(ratio)


def test_steady_steps_do_not_however_many_nor_constant_ones():
    assert walk(2.0 * CRAWL, 1.0, 0.0) == 10_000
    assert walk(1e-20, 1.0, 0.0, span=0.0, most=3) == 1
