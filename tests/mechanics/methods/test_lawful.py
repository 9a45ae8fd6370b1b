"""Both laws in every step of the implicit methods on joint coordinates, and by which option they are kept."""

import numpy as np
import pytest

import ephs
from tests.mechanics.plain import uncorrected
from tests.scenes import shipped

ROUNDING = 1e-13
"""Of sums of energies relative to the gross ones: ten times the rounding of fifty steps."""
KEEPING = {"radau": {}, "variational": {"keep": "energy"}}
"""Methods and options that keep the energy."""


def run(name, method, options, step=0.02):
    scene = shipped(name)
    return ephs.simulate(scene, 0.4, method=method, options=options, step=step, audit="off")


@pytest.mark.parametrize("name", ["bricard", "slider-crank", "hot-brake"])
@pytest.mark.parametrize("method", KEEPING)
def test_every_step_keeps_the_balance_and_no_component_loses_entropy(name, method):
    """A loop, a prescribed motion with a loop, friction that warms capacities which conduct."""
    sol = run(name, method, KEEPING[method])
    assert sol.energy_error.max() <= ROUNDING
    assert np.diff(sol.ledgers.heat).min() >= 0.0
    assert "plain_defect" in sol.stats


@pytest.mark.parametrize("method", KEEPING)
def test_without_the_correction_the_balance_is_missed(method):
    """The control, at steps that are long for each method."""
    steps = {"radau": 0.05}
    with uncorrected():
        sol = run("bricard", method, KEEPING[method], steps.get(method, 0.02))
    assert sol.energy_error.max() > 1e2 * ROUNDING
    assert run("bricard", method, KEEPING[method], steps.get(method, 0.02)).energy_error.max() <= ROUNDING


def test_what_else_a_method_keeps_leaves_the_balance_as_it_is():
    sol = run("bricard", "variational", {})
    assert sol.energy_error.max() > 1e2 * ROUNDING and "plain_defect" not in sol.stats
    assert sol.stats["keep"] == "momentum"
    with pytest.raises(ephs.OptionError, match="keep"):
        run("bricard", "variational", {"keep": "time"})
