"""Derivatives of accelerations where the equations of a loop repeat each other: exact along what keeps it closed."""

from functools import partial

import numpy as np
import pytest

import ephs
from tests.numerics import largest, slope
from tests.scenes import shipped

GOOD = 1e-8
"""What extrapolated differences are good for, relative to the largest entry."""


difference = partial(slope, h=1e-2, times=2)


def closed_direction(model, state):
    """(n,) the rates that keep the loop closed: the kernel of its rows, one of which repeats the others."""
    found = model.constraints(state)
    assert found.rank == len(found.rows) - 1 == model.layout.n - 1
    return np.linalg.svd(found.rows)[2][-1]


def with_rates(model, state, change):
    array = np.array(state.array)
    end = array.size - len(model.layout.entropies)
    array[end - model.layout.n : end] += change
    return model.unpack(array)


@pytest.mark.parametrize(("turned", "rate"), [(0.1, 1.5), (-0.7, 1.0)])
def test_derivatives_along_a_loop_with_a_repeated_equation_are_those_of_differences(turned, rate):
    """Of Bricard's linkage, moved along its loop: rates follow, and without their part derivatives are others."""
    model = ephs.dynamics(shipped("bricard"))
    n = model.layout.n
    state = model.closed(model.state0)
    state = model.closed(model.moved(state, turned * closed_direction(model, state)))
    along = closed_direction(model, state)
    state = model.closed(with_rates(model, state, rate * along))

    def acceleration(at):
        found = model.acceleration(at)
        return np.concatenate([found[name] for name in model.freedoms])[:n]

    def moved(h):
        return model.closed(model.moved(state, h * along))

    def rates(at):
        return model.layout.split(at.array)[1]

    exact = model.derivatives(state)
    expected = difference(lambda h: acceleration(moved(h)))
    by_place = exact.acceleration_q @ difference(lambda h: model.difference(state, moved(h)))
    by_rates = exact.acceleration_r @ difference(lambda h: rates(moved(h)))
    size = largest(expected)
    assert largest(by_place + by_rates - expected) <= GOOD * size
    assert largest(by_place - expected) > 1e-3 * size, "the control: rates that do not follow leave the loop"
    quicker = difference(lambda h: acceleration(with_rates(model, state, h * along)))
    assert largest(exact.acceleration_r @ along - quicker) <= GOOD * max(1.0, largest(quicker))
