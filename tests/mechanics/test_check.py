"""Checks of large models: what is left out of them, or measured once, changes no verdict."""

import numpy as np
import pytest

from ephs.mechanics.runs import check
from ephs.mechanics.runs.check import check_model, run_of_touching, stays_open
from ephs.mechanics.runs.running import by_constant_steps
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.semantics.systems import report
from ephs.semantics.systems.laws import SystemLaw, Verdict, system_law
from tests.numerics import largest
from tests.written import scene_of_text

SCENE = """
format = 1
name = "falling"
[bodies.low]
mass = 2.0
inertia = [0.1, 0.2, 0.3]
position = [0.0, 0.0, {low!r}]
angular_velocity = [1.0, 0.5, 0.0]
[bodies.high]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.05, 0.0, {high!r}]
velocity = [0.0, 0.0, {speed!r}]
[surfaces.floor]
body = "ground"
shape = {{ plane = {{}} }}
[surfaces.low]
body = "low"
shape = {{ box = [0.2, 0.3, 0.2] }}
stiffness = 1e4
[surfaces.high]
body = "high"
shape = {{ sphere = 0.1 }}
stiffness = 1e4
"""


@pytest.fixture
def load():
    def made(low=0.1, high=1.0, speed=0.0):
        return scene_of_text(SCENE.format(low=low, high=high, speed=speed))

    return made


def steps(problem):
    return by_constant_steps(problem, 0.1, 1e-3)


def least_gaps(scene, solution):
    return {name: float(solution.contact(name).gap.min()) for name, _ in scene.all_contacts()}


@pytest.mark.parametrize("seed", range(4))
def test_what_stays_open_changes_no_motion(load, seed):
    """Low falls a few millimetres, high some centimetres; each may reach the other or the floor, or not."""
    rng = np.random.default_rng(seed)
    scene = load(low=rng.uniform(0.1, 0.3), high=rng.uniform(0.45, 0.6), speed=rng.uniform(-3.0, 0.0))
    problem = problem_of_scene(scene)
    whole = steps(problem)
    found, left = run_of_touching(problem, [name for name, _ in scene.all_contacts()], steps)
    for path, values in found.states.items():
        assert largest(values - whole[path]) <= 1e-9, path
    gaps = least_gaps(scene, whole)
    assert left <= sum(gap > 0.0 for gap in gaps.values())
    assert left >= sum(gap > 0.05 for gap in gaps.values())  # more than the way of one step
    for name, contact in scene.all_contacts():
        assert not (stays_open(scene, contact, whole.motion) and gaps[name] <= 0.0)


def test_a_contact_that_closes_later_is_taken_back(load):
    scene = load(low=0.3, high=1.0)
    names = [name for name, _ in scene.all_contacts()]
    late = load(low=0.3, high=0.75, speed=-5.0)  # high hits low within a tenth of a second
    assert run_of_touching(problem_of_scene(scene), names, steps)[1] == len(names)
    assert run_of_touching(problem_of_scene(late), names, steps)[1] == len(names) - 1


def test_a_large_model_has_the_verdicts_of_a_small_one(load, monkeypatch):
    scene = load()
    small = {item.name: item for item in check_model(scene).items}
    monkeypatch.setattr(check, "LARGEST", 100)
    large = {item.name: item for item in check_model(scene).items}
    assert small.keys() == large.keys()
    assert all(item.ok for item in (*small.values(), *large.values()))
    for same in ("types", "structure", "assembly", "mobility", "redundant constraints", "joint wrenches"):
        assert small[same] == large[same]
    assert "2 contacts stay open, and are left out" in large["power balance"].detail
    assert "left out" not in small["power balance"].detail


def test_subsystems_of_every_kind_are_composed_by_both_routes(load, monkeypatch):
    """Of a large model all subsystems, or some of each kind; a kind that fails is named."""
    seen = []

    def record(probe):
        seen.append({primitive.name for _, primitive in probe.system.leaves()})
        return Verdict(1.0 if "plane_sphere_loss" in seen[-1] else 0.0, 0.5, "measured")

    law = SystemLaw("functoriality", "s", record)
    monkeypatch.setattr(check, "LARGEST", 100)
    monkeypatch.setattr(check, "system_law", lambda name: law if name == "functoriality" else system_law(name))
    verdicts = {}
    for alike in (100, 1):
        monkeypatch.setattr(check, "ALIKE", alike)
        seen.clear()
        verdicts[alike] = [item for item in check_model(load()).items if item.name.startswith("functoriality")]
        assert set().union(*seen) >= {"kinetic", "plane_sphere_energy", "rounded_box_sphere_loss"}
        assert not verdicts[alike][0].ok
    assert "each of" in verdicts[100][-1].detail
    assert "at most 1 of those that differ in numbers only" in verdicts[1][-1].detail
    assert len(verdicts[1]) < len(verdicts[100])


def test_a_value_that_fills_many_boxes_is_searched_once(load, monkeypatch):
    searched = []

    def search(primitive, count):
        searched.append(primitive)
        return found(primitive, count)

    found = report.search
    monkeypatch.setattr(report, "search", search)
    system = load().system()
    assert report.check_structure(system).detail.startswith(f"{len(list(system.leaves()))} components")
    assert len(searched) == len({id(primitive) for _, primitive in system.leaves()}) < len(list(system.leaves()))
