"""Both laws in every step of the implicit methods on joint coordinates, and by which option they are kept."""

from pathlib import Path

import numpy as np
import pytest

import ephs
from tests.mechanics.plain import uncorrected

SCENES = Path(__file__).parents[3] / "scenes"
ROUNDING = 1e-13
"""Of sums of energies relative to the gross ones: ten times the rounding of fifty steps."""
KEEPING = {
    "radau": {}, "gauss4": {}, "gauss6": {}, "gauss8": {}, "variational": {"keep": "energy"},
    "alpha": {"keep": "energy"},
}  # fmt: skip
"""Methods and options that keep the energy."""


def run(name, method, options, step=0.02):
    of = {} if method == "ida" else {"step": step}
    scene = ephs.load(SCENES / f"{name}.toml")
    return ephs.simulate(scene, 0.4, method=method, options=options, audit="off", **of)


@pytest.mark.parametrize("name", ["bricard", "slider-crank", "hot-brake"])
@pytest.mark.parametrize("method", [*KEEPING, "ida"])
def test_every_step_keeps_the_balance_and_no_component_loses_entropy(name, method):
    """A loop, a prescribed motion with a loop, friction that warms capacities which conduct."""
    sol = run(name, method, KEEPING.get(method, {}))
    assert sol.energy_error.max() <= ROUNDING
    assert np.diff(sol.ledgers.heat).min() >= 0.0
    assert ("plain_defect" in sol.stats) == (method != "ida"), "ida goes on from uncorrected states"


@pytest.mark.parametrize("method", KEEPING)
def test_without_the_correction_the_balance_is_missed(method):
    """The control, at steps that are long for each method."""
    steps = {"gauss6": 0.1, "gauss8": 0.2, "radau": 0.05, "gauss4": 0.05}
    with uncorrected():
        sol = run("bricard", method, KEEPING[method], steps.get(method, 0.02))
    assert sol.energy_error.max() > 1e2 * ROUNDING
    assert run("bricard", method, KEEPING[method], steps.get(method, 0.02)).energy_error.max() <= ROUNDING


@pytest.mark.parametrize("method", ["variational", "alpha"])
def test_what_else_a_method_keeps_leaves_the_balance_as_it_is(method):
    sol = run("bricard", method, {})
    assert sol.energy_error.max() > 1e2 * ROUNDING and "plain_defect" not in sol.stats
    assert sol.stats["keep"] == {"variational": "momentum", "alpha": "damping"}[method]
    with pytest.raises(ephs.OptionError, match="keep"):
        run("bricard", method, {"keep": "time"})
