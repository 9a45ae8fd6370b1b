"""A drawn scene, written, made, run or read another way, is the same motion."""

from functools import cache

import numpy as np
import pytest

import ephs
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.parameters import names, read, varied
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from tests.mechanics.drawn_scenes import FREEDOMS, SECTIONS, drawn, toml
from tests.written import scene_of_text

UNTIL = 0.2
TIGHT = {"method": "rk87", "rtol": 1e-9, "atol": 1e-11}
SAME = 1e-7
"""Differences of runs whose steps differ, over 1 + what is compared: a hundred times what is asked of each step."""
SEEDS = range(24)
LONG = [pytest.param(seed, marks=pytest.mark.long) for seed in SEEDS[4:]]
seeds = pytest.mark.parametrize("seed", [*SEEDS[:4], *LONG])


@cache
def scene(seed):
    return scene_of_text(toml(drawn(seed)))


@cache
def run(seed):
    return ephs.simulate(scene(seed), UNTIL, **TIGHT)


def ends(solution, prefix="", at=-1):
    """Coordinates, heat and work at the end; names of joints without what is before them."""
    joints = {name: np.array(solution.joint(name).coordinate[at]) for name in solution.freedoms}
    found = {name.removeprefix(prefix): value for name, value in joints.items()}
    return found | {"heat": solution.heat[at], "work": solution.work[at]}


def assert_same(found, expected, tolerance=SAME):
    for name, value in expected.items():
        np.testing.assert_allclose(
            found[name], value, rtol=0.0, atol=tolerance * (1.0 + np.abs(value).max(initial=0.0))
        )


def test_all_kinds_are_drawn_in_these_scenes():
    tables = [drawn(seed) for seed in SEEDS]
    assert {name for each in tables for name in each} >= set(SECTIONS)
    assert {joint["type"] for each in tables for joint in each["joints"].values()} == set(FREEDOMS)
    assert sum(len(each) > 6 for each in tables) > len(SEEDS) // 4  # several at once


def test_a_percent_of_a_mass_is_seen():
    """The control: it is another motion."""
    tables = drawn(0)
    tables["bodies"]["b0"]["mass"] *= 1.01
    with pytest.raises(AssertionError):
        assert_same(ends(ephs.simulate(scene_of_text(toml(tables)), UNTIL, **TIGHT)), ends(run(0)))


@seeds
def test_by_another_method(seed):
    assert_same(ends(ephs.simulate(scene(seed), UNTIL, method="radau", rtol=1e-8)), ends(run(seed)), 10.0 * SAME)


@seeds
def test_with_tables_in_another_order(seed):
    tables = {name: dict(reversed(each.items())) if name in SECTIONS else each for name, each in drawn(seed).items()}
    tables |= {name: dict(reversed(tables[name].items())) for name in ("bodies", "joints")}
    assert_same(ends(ephs.simulate(scene_of_text(toml(tables)), UNTIL, **TIGHT)), ends(run(seed)))


@seeds
def test_as_a_part_that_is_turned_and_shifted(seed, tmp_path):
    tables, turn = drawn(seed), np.array([0.3, 0.5, -0.4, 0.6]) / np.sqrt(0.86)
    world = tables.pop("world")
    gravity = (quaternion_to_matrix(turn) @ world["gravity"]).tolist()
    part = {"use": "part.toml", "position": [1.0, -2.0, 0.5], "rotation": turn.tolist()}
    (tmp_path / "part.toml").write_text(toml(tables))
    whole = {"world": world | {"gravity": gravity}, "parts": {"it": part}}
    whole |= {"assembly": tables["assembly"]} if "assembly" in tables else {}
    (tmp_path / "whole.toml").write_text(toml(whole))
    found = ephs.simulate(ephs.load(tmp_path / "whole.toml"), UNTIL, **TIGHT)
    assert_same(ends(found, "it."), ends(run(seed)))


@seeds
def test_as_a_system_made_by_hand(seed):
    """With all that acts from outside at its ports."""
    signals = problem_of_scene(scene(seed)).signals
    inputs = {str(port): {"effort" if of.effort else "flow": of.at if not of.constant else of.value}
              for port, of in signals.items()}  # fmt: skip
    system, expected = scene(seed).system(), ends(run(seed))
    assert set(inputs) == set(map(str, system.interface))
    reference = ephs.Reference(temperature=drawn(seed)["world"]["temperature"])
    found = ends(ephs.simulate(system, UNTIL, inputs=inputs, reference=reference, **TIGHT), "joints.")
    halves = {name for name, joint in scene(seed).all_joints() if joint.kind == "universal"}  # two joints of the system
    assert_same(found, {name: value for name, value in expected.items() if name not in halves})


@seeds
def test_in_two_runs(seed):
    half = ephs.simulate(scene(seed), 0.5 * UNTIL, **TIGHT)
    then = ephs.simulate(scene(seed).at(half, 0.5 * UNTIL), 0.5 * UNTIL, **TIGHT)
    for name, _ in scene(seed).all_bodies():
        np.testing.assert_allclose(then.body(name).position[-1], run(seed).body(name).position[-1], atol=SAME)
    for name, _ in scene(seed).all_thermal():
        expected = run(seed).thermal(name).temperature[-1]
        assert then.thermal(name).temperature[-1] == pytest.approx(expected, rel=SAME)


@seeds
def test_from_its_file(seed, tmp_path):
    run(seed).save(tmp_path / "run.nc")
    again = ephs.load_solution(tmp_path / "run.nc")
    for name in run(seed).freedoms:
        for reading in ("coordinate", "rate", "wrench"):
            one, other = (getattr(each.joint(name), reading) for each in (again, run(seed)))
            np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-12 * (1.0 + np.abs(other).max(initial=0.0)))


@seeds
def test_of_its_dynamics(seed):
    model, h = ephs.dynamics(scene(seed)), 1e-7  # rods swing by 1e4 rad/s; rounding of rates over h is 1e-8
    start = ephs.simulate(scene(seed), 2.0 * h, method="rk87", step=h)
    for name, a in model.acceleration(model.state0).items():
        if a.size:
            rate = start.joint(name).rate
            differenced = (-3.0 * rate[0] + 4.0 * rate[1] - rate[2]) / (2.0 * h)
            assert np.abs(a - differenced).max() <= 1e-4 * (1.0 + np.abs(a).max()), name


@seeds
def test_of_its_derivatives(seed):
    """By four of its numbers, as differences of runs; inputs that read states have none."""
    tables = drawn(seed)
    tables.pop("loads", None)
    model = scene_of_text(toml(tables))
    known = [path for path in names(model) if "velocity" not in path and abs(read(model, path)) > 1e-3]
    for path in np.random.default_rng(seed).permutation(known).tolist()[:4]:
        value, h = read(model, path), 1e-4 * abs(read(model, path))
        try:
            found = ephs.sensitivity(model, [path], UNTIL, **TIGHT)
        except ephs.OptionError as error:
            assert path in str(error)  # it is refused, not wrong
            continue
        ways = [ephs.simulate(varied(model, {path: value + by}, strict=False), UNTIL, **TIGHT) for by in (h, -h)]
        for name in model.bodies:
            one, other = (way.body(name).position[-1] for way in ways)
            mine = found[f"bodies.{name}.position"][-1, :, 0]
            assert np.abs((one - other) / (2.0 * h) - mine).max() * abs(value) <= 1e-4, (path, name)  # 10 rtol over h
