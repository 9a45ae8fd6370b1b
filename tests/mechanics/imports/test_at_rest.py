"""Robots of gymnasium fall onto their floor and come to rest."""

import warnings
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import ephs
from ephs.mechanics.imports.collisions import SINKING, SLIP

ROBOTS = ("hopper", "half_cheetah", "ant", "humanoid")


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_comes_to_rest_on_its_floor(name):
    """Its kinetic energy is dissipated, its weight on the floor, and no speed above the slip velocity, below which
    friction is viscous. The audit of the run has no finding."""
    pytest.importorskip("mujoco")
    spec = find_spec("gymnasium")
    assert spec is not None and spec.submodule_search_locations
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = ephs.load(Path(spec.submodule_search_locations[0]) / f"envs/mujoco/assets/{name}.xml", contact=True)
    sol = ephs.simulate(scene, 6.0, method="radau", rtol=1e-4, atol=1e-6, audit="fail")
    assert sol.summary()["audit"] == {"passed": True, "findings": []}
    speeds = [np.linalg.norm(sol.body(body).velocity, axis=1) for body, _ in scene.all_bodies()]
    assert max(speed.max() for speed in speeds) > 10 * SLIP > 10 * max(speed[-1] for speed in speeds)
    weight = 9.81 * sum(body.mass for _, body in scene.all_bodies())
    ground = [sol.contact(name) for name, each in scene.all_contacts() if "floor" in each.surfaces]
    assert sum(each.force[-1, 2] for each in ground) == pytest.approx(weight, rel=1e-2)
    assert max(-each.gap[-1] for each in ground) < 1.01 * 9.81 * SINKING**2  # the weight on a single contact
