"""A run that starts from the end of another one goes on as if that had not stopped."""

import pytest

import ephs
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.scene.build import scene_inputs
from ephs.solve.running.control import RTOL
from tests.numerics import EPS, largest
from tests.scenes import SCENES, of_all_scenes

STEP, STEPS = 1e-3, 10
ONWARDS = ("natural",)
"""Its steps depend on more than a scene's state: on momenta that leave the joints by the method's error."""
ROUNDING = 8 * 7 * STEPS * EPS
"""Of eight sums a stage, seven stages a step, relative."""
CONDITION = 1e3
"""Of what is solved in a step: closed loops, pressures by bulk moduli."""


COUNTERS = ("s", "e", "atmosphere.v")
"""States that count from where a run begins."""


def apart(whole, rest):
    """Largest difference of the ends by the largest state of the same name; of counters, of what they then count.

    By name, as the entropy of an environment changes by differences of nearly equal temperatures.
    """
    found, sizes = 0.0, dict[str, float]()
    for path in whole.states:
        sizes[path[-1]] = max(sizes.get(path[-1], 0.0), float(largest(whole[path], initial=0.0)))
    for path in whole.states:
        one, two = whole[path], rest[path]
        if f".{path}".endswith(tuple(f".{name}" for name in COUNTERS)):
            one, two = one - one[STEPS], two - two[0]
        if one.size:
            found = max(found, float(largest(one[-1] - two[-1]) / (sizes[path[-1]] or 1.0)))
    return found


def goes_on(scene, method):
    """How far the two runs are apart where the second one starts from `Scene.at`."""
    run = {"method": method, "step": STEP, "audit": "off"}
    whole, half = (ephs.simulate(scene, until, **run) for until in (2 * STEP * STEPS, STEP * STEPS))
    there = scene.at(half, STEP * STEPS)
    return apart(whole, ephs.simulate(there, 2 * STEP * STEPS, t0=STEP * STEPS, **run))


@of_all_scenes
def test_runs_of_all_scenes_go_on(file):
    assert goes_on(ephs.load(file), "rk54") <= CONDITION * ROUNDING


@pytest.mark.parametrize("method", [name for name in METHODS if name not in ONWARDS])
def test_runs_by_all_methods_go_on(method):
    found = goes_on(ephs.load(SCENES[0].with_name("four-bar.toml")), method)
    assert found <= (
        RTOL if method == "radau" else CONDITION * ROUNDING
    )  # its matrix is as old as the run, its iterations end at a part of that


@pytest.mark.parametrize("method", ["natural", "natural4", "rk54"])
def test_runs_of_systems_go_on(method):
    scene = ephs.load(SCENES[0].with_name("four-bar.toml"))
    system = scene.system()
    inputs = {str(path): {"flow": one.value} for path, one in scene_inputs(scene).items()}
    run = {"method": method, "step": STEP, "audit": "off", "inputs": inputs}
    whole, half = (ephs.simulate(system, until, **run) for until in (2 * STEP * STEPS, STEP * STEPS))
    rest = ephs.simulate(system.at(half, STEP * STEPS), 2 * STEP * STEPS, t0=STEP * STEPS, **run)
    assert apart(whole, rest) <= CONDITION * ROUNDING
