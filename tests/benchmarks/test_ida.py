"""IDA beside the package's own methods: an independent integrator comes to the same motion, and keeps the balance."""

import pytest

import ephs
from benchmarks.ida import IDA
from ephs.mechanics.methods.registry import METHODS
from tests.numerics import largest
from tests.scenes import shipped


@pytest.mark.parametrize("name", ["bricard", "slider-crank", "hot-brake"])
def test_it_comes_to_the_same_motion_and_keeps_the_balance(name):
    """Its steps are good to a hundredth of the tolerance; errors of a few hundred of them add up."""
    scene = shipped(name)
    sol = ephs.simulate(scene, 0.4, method=IDA, rtol=1e-8, atol=1e-9, audit="off")
    exact = ephs.simulate(scene, 0.4, method="rk87", rtol=1e-12, atol=1e-12, audit="off")
    for body, _ in scene.all_bodies():
        assert largest(sol.body(body).position[-1] - exact.body(body).position[-1]) <= 1e-6
        assert largest(sol.body(body).rotation[-1] - exact.body(body).rotation[-1]) <= 1e-6
    assert sol.heat[-1] == pytest.approx(exact.heat[-1], rel=1e-6, abs=1e-9)
    assert sol.energy_error.max() <= 1e-13
    assert "plain_defect" not in sol.stats, "it goes on from uncorrected states"


def test_it_is_no_method_of_the_package():
    assert IDA.name not in METHODS
    with pytest.warns(FutureWarning, match="'radau' is taken in its place"):
        ephs.simulate(shipped("heavy-top"), 0.1, method="ida")
