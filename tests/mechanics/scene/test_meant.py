"""A mechanism that is movable but for rounding is movable, by every method and for checks; in between it is refused."""

import warnings

import numpy as np
import pytest

import ephs
from benchmarks.hard.four_bars import PINS, four_bar
from benchmarks.hard.loops import stretched
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.load import load
from ephs.mechanics.scene.meant import as_meant
from ephs.mechanics.scene.own_units import mobility_of
from tests.methods import OF_SCENES
from tests.scenes import SCENES

EACH = pytest.mark.parametrize("name", OF_SCENES)


def read(delta, tmp_path, size=1.0, pins=PINS):
    file = tmp_path / "tilted.toml"
    text = four_bar(tilt=delta, size=size, pins=pins)
    file.write_text(f'format = 1\nname = "tilted"\n{text}', encoding="utf-8")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        scene = load(file)
    return scene, "".join(str(each.message) for each in said)


def swung(scene, name):
    method = METHODS[name]
    steps = {"step": 0.01} if method.fixed else {"rtol": 1e-8, "atol": 1e-11}
    sol = ephs.simulate(scene, 0.2, method=name, save_at=[0.0, 0.2], **steps)
    assert sol.constraint_error.max() < 1e-12
    return float(sol.joint("a").coordinate[-1, 0])


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    scene, said = read(0.0, tmp_path_factory.mktemp("straight"))
    assert not said
    return scene


@pytest.fixture(scope="module")
def rounded(tmp_path_factory):
    found = [read(delta, tmp_path_factory.mktemp("rounded")) for delta in (1e-12, 1e-9)]
    assert all("joint frames are moved by up to" in said for _, said in found)
    return [scene for scene, _ in found]


@EACH
def test_what_is_movable_but_for_rounding_moves_by_every_method(name, straight, rounded):
    there = swung(straight, name)
    for scene in rounded:
        assert swung(scene, name) == pytest.approx(there, rel=1e-7)


@pytest.mark.parametrize("delta", [1e-12, 1e-9])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e5])
def test_checks_see_one_freedom_and_three_repeated_constraints(delta, size, tmp_path):
    found = mobility_of(problem_of_scene(read(delta, tmp_path, size)[0]))
    assert (found.mobility, found.redundant) == (1, 3)


@pytest.mark.parametrize("delta", [1e-7, 1e-6, 1e-5])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e5])
def test_what_moves_with_larger_gaps_is_refused_by_all(delta, size, tmp_path):
    with pytest.raises(ephs.SceneError, match="a mechanism that moves if its joints open by"):
        read(delta, tmp_path, size)


def test_what_is_clearly_locked_is_taken_at_its_word(tmp_path):
    scene, said = read(1e-3, tmp_path)
    assert not said
    assert mobility_of(problem_of_scene(scene)).mobility == 0


@pytest.mark.parametrize("height", [1e-9, 1e-6])
def test_a_truss_that_moves_to_first_order_only_is_no_mechanism(height, tmp_path):
    """Two bars, all but in line between two pins of the ground."""
    file = tmp_path / "stretched.toml"
    file.write_text(f'format = 1\nname = "stretched"\n{stretched(height)}', encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load(file)


@pytest.mark.parametrize("off", [1e-3, 1e-6, 1e-9])
def test_a_four_bar_near_alignment_is_left_as_it_is(off, tmp_path):
    """All links are 1 m, and all but in line, where it could change into its other branch."""
    x, y = float(np.cos(off)), float(np.sin(off))
    scene, said = read(0.0, tmp_path, pins={"a": (0.0, 0.0), "b": (x, y), "c": (1.0 + x, y), "d": (1.0, 0.0)})
    assert not said
    assert mobility_of(problem_of_scene(scene)).mobility in (1, 2)


def test_scenes_that_move_exactly_are_left_as_they_are():
    for file in SCENES:
        scene = ephs.load(file)
        assert as_meant(scene) == (scene, "", [])
