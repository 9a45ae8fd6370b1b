"""Hard contacts that share a load: which forces are indeterminate, and that sums and the motion are not."""

import numpy as np
import pytest

import ephs
from tests.written import scene_of_text

G, MASS = 9.81, 2.0
LEG = """
[surfaces.{name}]
body = "seat"
shape = {{ sphere = 0.05 }}
position = [{x}, {y}, -0.2]
restitution = 0.0
friction = {friction}
"""
SCENE = """
format = 1
name = "seat"
[world]
gravity = [{pull}, 0.0, -9.81]
[bodies.seat]
mass = 2.0
inertia = [0.1, 0.1, 0.1]
position = [0.0, 0.0, 0.25]
velocity = [{speed}, 0.0, 0.0]
[surfaces.floor]
body = "ground"
shape = {{ plane = {{}} }}
restitution = 0.0
friction = {friction}
"""
CHAIR = [(0.2, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.2, -0.2)]
TRIPOD = [(0.2, 0.0), (-0.1, 0.2), (-0.1, -0.2)]


def stood(legs, friction=0.0, pull=0.0, speed=0.0, shape=""):
    text = SCENE.format(friction=friction, pull=pull, speed=speed)
    text += "".join(LEG.format(name=f"leg{i}", x=x, y=y, friction=friction) for i, (x, y) in enumerate(legs))
    return ephs.simulate(scene_of_text(text + shape), 2.0**-5, method="rk54", step=2.0**-6, audit="off")


def legs_of(sol):
    return [sol.contact(name) for name in sol.scene.contacts]


def test_a_tripod_is_determinate():
    """Its forces are those of statics: moments about both axes vanish."""
    sol = stood(TRIPOD)
    legs = legs_of(sol)
    assert not any(leg.mask.any() or leg.points_mask.any() for leg in legs)
    rows = np.array([np.ones(3), *np.array(TRIPOD).T])
    expected = np.linalg.solve(rows, [MASS * G, 0.0, 0.0])
    assert [abs(leg.force[-1, 2]) for leg in legs] == pytest.approx(expected, abs=1e-6)


def test_legs_of_a_chair_share_its_weight():
    sol = stood(CHAIR)
    legs = legs_of(sol)
    for leg in legs:
        assert leg.mask[-1].tolist() == [False, False, True]
    assert sum(abs(leg.force[-1, 2]) for leg in legs) == pytest.approx(MASS * G, abs=1e-6)
    assert sol.body("seat").position[-1] == pytest.approx([0.0, 0.0, 0.25], abs=1e-12)


def test_feet_that_stick_press_against_each_other():
    """Three feet that stick hold nine directions of six; their normal forces are determinate all the same."""
    for leg in legs_of(stood(TRIPOD, friction=0.5)):
        assert leg.mask[-1].tolist() == [True, True, False]


def test_feet_that_slip_have_the_friction_of_their_weight():
    for leg in legs_of(stood(TRIPOD, friction=0.1, speed=1.0)):
        assert not leg.mask[-1].any()
        assert abs(leg.force[-1, 0]) == pytest.approx(0.1 * abs(leg.force[-1, 2]), rel=1e-6)


def test_corners_of_a_box_share_its_weight_and_their_sum_is_determinate():
    box = '[surfaces.box]\nbody = "seat"\nshape = { box = [0.4, 0.4, 0.5] }\nrestitution = 0.0\nfriction = 0.0\n'
    sol = stood([], shape=box)
    (found,) = legs_of(sol)
    assert not found.mask.any()
    corners = found.points_mask[-1, :, 2]
    assert corners.sum() == 4
    assert found.points[-1, corners].sum(axis=0) == pytest.approx(found.force[-1], abs=1e-9)
    assert abs(found.force[-1, 2]) == pytest.approx(MASS * G, abs=1e-6)


def test_reports_name_contacts_that_share_a_load():
    from ephs.show.plots.touching import contact_table

    assert "indeterminate" not in contact_table(stood(TRIPOD))
    assert "indeterminate forces" in contact_table(stood(CHAIR))
