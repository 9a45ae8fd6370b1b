"""Adjusting keeps what is given of joints, and says what it changes."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from benchmarks.hard.four_bars import ADJUSTED
from ephs.mechanics.runs.check import check_model
from ephs.mechanics.scene.adjust import mass_roots
from ephs.mechanics.scene.kinematics import elements, largest_gap, largest_slip
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.state import Snapshot
from ephs.semantics.spaces.rank import ASSEMBLY
from tests.written import scene_of_text


def text_of(crank="", rocker="", x=0.15, adjust="true"):
    return 'format = 1\nname = "guessed"\n' + ADJUSTED.format(crank=crank, rocker=rocker, x=x, adjust=adjust)


def load(**given) -> Scene:
    return scene_of_text(text_of(**given))


def closed(scene: Scene) -> bool:
    now = Snapshot.of(scene)
    xs, scale = elements(now.links, now.poses), now.scale(scene.world.gravity)
    gap, slip = largest_gap(now.links, now.poses, xs, scale), largest_slip(now.links, now.twists, xs, scale)
    return max(gap, slip) <= ASSEMBLY


@settings(max_examples=8, deadline=None)
@given(
    angle=st.floats(-0.3, 0.3), rate=st.floats(-8.0, 8.0), off=st.floats(-0.05, 0.05),
    kind=st.sampled_from(["rate = {}", "motion = {{ rate = {} }}"]),
)  # fmt: skip
def test_given_coordinates_and_rates_come_before_given_poses(angle, rate, off, kind):
    crank = f"coordinate = {angle!r}\n" + kind.format(repr(rate))
    scene = load(crank=crank, x=0.15 + off)
    assert closed(scene)
    assert scene.joint("a").coordinate[0] == pytest.approx(angle, abs=1e-8)
    assert scene.joint("a").rate[0] == pytest.approx(rate, abs=1e-7)
    assert scene.adjusted is None or not scene.adjusted.changed


@given(st.floats(-6.0, 6.0))
def test_the_unit_of_mass_does_not_decide_what_moves(power):
    """Roots of inertias that are c times as large are √c times as small, also those of massless bodies."""
    masses = np.array([2.0, 0.0, 0.5])
    inertias = np.array([np.diag([1.0, 2.0, 3.0]), np.zeros((3, 3)), np.diag([1.0, 1.0, 0.0])])
    roots, scale = mass_roots(masses, inertias), 10.0**power
    assert np.allclose(mass_roots(scale * masses, scale * inertias) * np.sqrt(scale), roots, rtol=1e-14, atol=1e-15)
    assert np.allclose(roots[0] @ roots[0], np.diag(1.0 / np.array([1.0, 2.0, 3.0, 2.0, 2.0, 2.0])), atol=1e-15)


def test_where_given_rates_contradict_each_other_it_is_said_which_gave_way(capsys):
    scene = load(crank="rate = 6.0", rocker="rate = 6.0")
    assert closed(scene)
    changed = {(c.joint, c.what): c for c in scene.adjusted.changed}
    assert set(changed) <= {("a", "rate"), ("d", "rate")} and changed
    for c in changed.values():
        assert c.given == (6.0,) and abs(scene.joint(c.joint).rate[0] - c.taken[0]) < 1e-12
    assert "given rate 6 contradicts others" in str(check_model(scene))


def test_what_moved_is_said_by_checks_and_stands_in_the_summary(tmp_path):
    scene = load(crank="rate = 6.0", x=0.17)
    item = next(item for item in check_model(scene).items if item.name == "adjusted")
    assert "crank: moved" in item.detail
    sol = ephs.simulate(scene, 0.01, method="rk54")
    said = json.loads(json.dumps(sol.summary()))["adjusted"]
    assert {entry["body"] for entry in said["moved"]} == {d.body for d in scene.adjusted.moved} == {
        "crank", "coupler", "rocker"
    }  # fmt: skip
    sol.save(tmp_path / "sol.nc")
    assert ephs.load_solution(tmp_path / "sol.nc").scene.adjusted == scene.adjusted


def test_a_part_keeps_what_its_file_gives_when_the_whole_is_adjusted(tmp_path):
    (tmp_path / "guessed.toml").write_text(text_of(crank="rate = 6.0", x=0.17), encoding="utf-8")
    (tmp_path / "whole.toml").write_text(
        'format = 1\nname = "whole"\n[assembly]\nadjust = true\n[world]\ngravity = [0.0, -9.81, 0.0]\n'
        '[parts.left]\nuse = "guessed.toml"\n'
        "[bodies.rider]\nmass = 1.0\ninertia = [0.1, 0.1, 0.1]\nposition = [0.3, 1.0, 0.0]\n"
        '[joints.seat]\ntype = "revolute"\nbodies = ["left.crank", "rider"]\n'
        "frame1 = { position = [0.15, 0.4, 0.0] }\nframe2 = {}\n",
        encoding="utf-8",
    )
    scene = ephs.load(tmp_path / "whole.toml")
    assert closed(scene)
    assert scene.joint("left.a").rate[0] == pytest.approx(6.0, abs=1e-7)
    assert np.linalg.norm(scene.body("rider").pose[4:] - [0.3, 0.8, 0.0]) < 0.1
