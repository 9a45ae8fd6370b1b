"""Woodpecker toy: its limit cycle, which sticks, slips and strikes, against code of its own that shares nothing."""

import numpy as np
import pytest

import ephs
from tests.mechanics.impacts import woodpecker as toy

LATE = 0.8
"""From when on it repeats itself, in s."""
HINGE = """
[joints.{name}]
type = "revolute"
bodies = {bodies}
frame1 = {{ position = {at1}, rotation = {{ axis = [1.0, 0.0, 0.0], angle = 1.5707963267948966 }} }}
frame2 = {{ position = {at2}, rotation = {{ axis = [1.0, 0.0, 0.0], angle = 1.5707963267948966 }} }}
coordinate = {coordinate}
rate = {rate}
stiffness = {stiffness}
"""
SURFACE = """
[surfaces.{name}]
body = "{body}"
shape = {{ sphere = {radius} }}
position = {at}
restitution = {e}
friction = {friction}
tangential = 0.0
[contacts.{name}]
surfaces = ["pole", "{name}"]
"""
HEAD = """
format = 1
name = "woodpecker"
[world]
gravity = [0.0, 0.0, {gravity}]
[bodies.carrier]
mass = 0.0
inertia = [0.0, 0.0, 0.0]
[bodies.sleeve]
mass = {masses[0]}
inertia = {sleeve}
[bodies.bird]
mass = {masses[1]}
inertia = {bird}
[joints.slide]
type = "prismatic"
bodies = ["ground", "carrier"]
frame1 = {{}}
frame2 = {{}}
coordinate = {z}
rate = {rate}
[surfaces.pole]
body = "ground"
shape = {{ plane = {{}} }}
position = [{pole}, 0.0, 0.0]
rotation = {{ axis = [0.0, 1.0, 0.0], angle = 1.5707963267948966 }}
restitution = 1.0
friction = 10.0
tangential = 0.0
"""


def scene_of(tmp_path, q, u):
    z, sleeve, bird = q
    text = HEAD.format(
        gravity=-toy.G, masses=toy.MASS, sleeve=[toy.INERTIA[0]] * 3, bird=[toy.INERTIA[1]] * 3, z=z, rate=u[0],
        pole=toy.POLE,
    )  # fmt: skip
    text += HINGE.format(
        name="tilt", bodies='["carrier", "sleeve"]', at1=[0.0] * 3, at2=[0.0] * 3, coordinate=sleeve, rate=u[1],
        stiffness=0.0,
    )  # fmt: skip
    text += HINGE.format(
        name="neck", bodies='["sleeve", "bird"]', at1=[toy.NECK, 0.0, 0.0], at2=[-toy.CENTRE, 0.0, 0.0],
        coordinate=bird - sleeve, rate=u[2] - u[1], stiffness=toy.SPRING,
    )  # fmt: skip
    places = ((toy.TIP - toy.BEAK[0], toy.BEAK[1]), toy.TIPS[1][0][1], toy.TIPS[2][0][1])
    for name, body, (x, y), e in zip(
        ("beak", "lower", "upper"), ("bird", "sleeve", "sleeve"), places, toy.RESTITUTION, strict=True
    ):
        text += SURFACE.format(name=name, body=body, radius=toy.TIP, at=[x, 0.0, y], e=e, friction=toy.FRICTION)
    file = tmp_path / "woodpecker.toml"
    file.write_text(text, encoding="utf-8")
    return ephs.load(file)


def states(sol):
    """(k, 6) of a run, as the other code has them."""
    q, u = (
        np.column_stack([getattr(sol.joint(name), what)[:, 0] for name in ("slide", "tilt", "neck")])
        for what in ("coordinate", "rate")
    )
    return np.column_stack([q[:, :2], q[:, 1] + q[:, 2], u[:, :2], u[:, 1] + u[:, 2]])


def test_its_limit_cycle_is_that_of_other_code(tmp_path):
    """It comes back after a period, lower by a fall, both of other code, to the order of steps with contacts, two."""
    times = np.array([LATE])
    (begin,), impacts = toy.simulate(*toy.start(), 1.2, times)
    beaks = [t for t, closed in impacts if closed == (0,)]
    period, before = np.diff(beaks)[-2:]
    assert period == pytest.approx(before, rel=1e-5)
    path, _ = toy.simulate(begin[:3], begin[3:], period, np.linspace(0.0, period, 65))
    after, swing = path[-1], np.ptp(path[:, 2])
    fall = after[0] - begin[0]
    assert after == pytest.approx(begin + np.array([fall, 0.0, 0.0, 0.0, 0.0, 0.0]), rel=1e-4, abs=1e-6)
    scene = scene_of(tmp_path, begin[:3], begin[3:])
    errors = []
    for count in (128, 256):
        sol = ephs.simulate(scene, period, method="rk54", step=period / count, save_at=[period], audit="off")
        assert np.abs(sol.energy_error).max() <= 1e-11
        assert sol.stats["least_production"] >= 0.0
        assert sol.heat[-1] == pytest.approx(-sum(toy.MASS) * toy.G * fall, rel=1e-2)
        errors.append(np.abs(states(sol)[0] - after))
    coarse, fine = errors
    assert fine[0] <= 1e-3 * abs(fall)
    assert fine[1:3].max() <= 1e-3 * swing
    assert np.all(fine[[0, 2, 3, 5]] <= 0.4 * coarse[[0, 2, 3, 5]])
