"""Springs of no length: a bushing pulls its two points together, and starts with both in one place."""

import numpy as np
import pytest

import ephs
from benchmarks.hard.case import read
from benchmarks.hard.loops import BLOCK, BUSHING, GRAVITY, STIFFNESS, fall
from ephs.mechanics.methods.registry import METHODS
from tests.methods import OF_SCENES
from tests.numerics import largest


def scene_of(length):
    return read(BUSHING.format(length=length))


@pytest.mark.parametrize("name", OF_SCENES)
def test_a_block_falls_from_the_point_that_holds_it(name):
    method = METHODS[name]
    steps = {"step": 2.0**-8} if method.fixed else {"rtol": 1e-8, "atol": 1e-10}
    times = np.linspace(0.0, 1.0, 5)
    sol = ephs.simulate(scene_of(0.0), 1.0, method=name, save_at=times, **steps)
    error = largest(sol.body("block").position[:, 1] - 0.2 - fall(times))
    assert error <= (2.0**-14 if method.fixed else 1e-6)
    lost = -BLOCK * GRAVITY * fall(1.0) - 0.5 * STIFFNESS * fall(1.0) ** 2
    assert np.abs(sol.heat[-1] - (lost - kinetic(sol))) < 1e-3


def kinetic(sol):
    return 0.5 * BLOCK * float(sol.body("block").velocity[-1] @ sol.body("block").velocity[-1])


def test_a_spring_with_a_length_is_refused_there():
    with pytest.raises(ephs.SceneError, match="both ends at the same point"):
        scene_of(0.5)
