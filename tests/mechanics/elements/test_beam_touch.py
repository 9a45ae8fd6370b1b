"""Rods that touch themselves and others: capsules along the pieces of their nodes."""

import numpy as np
import pytest

import ephs
from tests.written import scene_of_text

LOOP = """format = 1
[world]
gravity = [0.0, 0.0, 0.0]
[beams.rod]
points = [[0.0, -0.05, 0.0], [0.2, -0.05, 0.0], [0.25, 0.0, 0.0], [0.2, 0.05, 0.0], [0.0, 0.05, 0.0]]
elements = {elements}
section = {{ circle = 0.005, E = 1e5, nu = 0.3, rho = 1000.0 }}
damping = 1e-3
{surface}
[loads.one]
body = "rod.0"
force = [0.0, 0.1, 0.0]
[loads.two]
body = "rod.{elements}"
force = [0.0, -0.1, 0.0]
"""
STIFFNESS, RADIUS = 1e3, 0.005
SOFT = "surface = { stiffness = 2e3, loss = 0.1, friction = 0.3 }"


def loop(surface, elements=8, more=""):
    return scene_of_text(LOOP.format(surface=surface, elements=elements) + more)


def test_a_loop_that_is_pressed_together_touches_itself():
    """Two forces close a loop. Its ends overlap by δ at most, ½ k δ² being the work of the forces till then; both
    surfaces have the stiffness 2 k, in series k."""
    pace = {"method": "rk54", "rtol": 1e-4, "atol": 1e-6, "audit": "off"}
    sol = ephs.simulate(loop(SOFT), 0.1, **pace)
    ends = [sol.body(name).position for name in ("rod.0", "rod.8")]
    apart = np.linalg.norm(ends[1] - ends[0], axis=1)
    work = 0.1 * (ends[0][:, 1] - ends[1][:, 1] + 0.1)
    assert 2.0 * RADIUS - np.sqrt(2.0 * work.max() / STIFFNESS) <= apart.min() < 2.0 * RADIUS
    assert sol.energy_error.max() <= 1e-11 and sol.stats["least_production"] >= 0.0
    through = ephs.simulate(loop(""), 0.1, **pace)
    ends = [through.body(name).position[:, 1] for name in ("rod.0", "rod.8")]
    assert (ends[1] - ends[0]).min() < 0.0  # nothing stops them without a surface


def test_pieces_near_one_another_along_the_rod_do_not_touch():
    """A rod of radius r that is bent to a circle of radius r meets itself π r further on, and not before."""
    scene = loop(SOFT, 16)
    length = {name: s.shape["capsule"][1] for name, s in scene.all_surfaces()}
    pairs = {tuple(int(s.removeprefix("rod.")) for s in c.surfaces) for _, c in scene.all_contacts()}
    for i in range(17):
        for j in range(i + 1, 17):
            between = sum(length[f"rod.{k}"] for k in range(i + 1, j))
            assert ((i, j) in pairs) == (between > np.pi * 0.005)
    assert sum(length.values()) == pytest.approx(sum(j.strain.length for _, j in scene.all_joints()), rel=1e-12)


def test_rods_meet_other_surfaces():
    floor = '[surfaces.floor]\nbody = "ground"\nshape = { plane = {} }\nposition = [0.0, 0.0, -0.1]\nstiffness = 1e4\n'
    scene = loop(SOFT, more=floor)
    assert sum("floor" in contact.surfaces for _, contact in scene.all_contacts()) == 9
