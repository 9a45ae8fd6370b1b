"""A spring with a damper between points: what it does to bodies is Newton's law, whichever of its ends they are."""

import numpy as np
import pytest

from tests.numerics import largest
from tests.scenes import equations_of
from tests.written import scene_of_text

K, LENGTH, D = 50.0, 0.4, 3.0
MASSES = {"a": 2.0, "b": 3.0}
PLACES = {"ground": np.array([0.1, -0.2, 0.3]), "a": np.array([1.0, 0.5, 0.2]), "b": np.array([-0.3, 0.8, 1.4])}
VELOCITIES = {"ground": np.zeros(3), "a": np.array([0.3, -0.4, 0.5]), "b": np.array([-1.0, 0.2, 0.7])}
BODY = """
[bodies.{name}]
mass = {mass}
inertia = [0.6, 0.7, 0.8]
position = {place}
velocity = {velocity}
"""
SPRING = """
[springs.s]
bodies = ["{one}", "{two}"]
at1 = {at1}
at2 = {at2}
stiffness = {k}
length = {length}
damping = {d}
"""


def scene_of(one, two):
    at = {name: [0.0, 0.0, 0.0] if name != "ground" else PLACES[name].tolist() for name in PLACES}
    text = 'format = 1\nname = "points"\n[world]\ngravity = [0.0, 0.0, 0.0]\n'
    for name, mass in MASSES.items():
        text += BODY.format(name=name, mass=mass, place=PLACES[name].tolist(), velocity=VELOCITIES[name].tolist())
    text += SPRING.format(one=one, two=two, at1=at[one], at2=at[two], k=K, length=LENGTH, d=D)
    return scene_of_text(text)


@pytest.mark.parametrize(
    ("one", "two"), [("a", "b"), ("b", "a"), ("ground", "a"), ("a", "ground"), ("ground", "b"), ("b", "ground")]
)
def test_bodies_are_pulled_together(one, two):
    scene = scene_of(one, two)
    eq = equations_of(scene)
    state = eq.start(0.0)
    along = PLACES[two] - PLACES[one]
    distance = np.linalg.norm(along)
    along /= distance
    pull = K * (distance - LENGTH) + D * (VELOCITIES[two] - VELOCITIES[one]) @ along
    expected = {name: np.zeros(3) for name in MASSES}
    for name, sign in ((one, 1.0), (two, -1.0)):
        if name in MASSES:
            expected[name] = sign * pull * along / MASSES[name]
    y, dense, nv = eq.vector(state), np.zeros(eq.size), eq.nv
    assert eq.dense.rates(state.q, y, eq.given, eq.heats, dense)[0] == 0
    for found_rates in (eq.rates(0.0, state.q, y), dense):
        rates, flows = found_rates[nv : nv + eq.n], found_rates[eq.size - len(eq.reduced.made) :]
        # bodies stand as the world's axes do, so that a body's frame is the world's
        found = {name: rates[6 * i + 3 : 6 * i + 6] for i, name in enumerate(MASSES)}
        for name in MASSES:
            assert largest(rates[6 * list(MASSES).index(name) :][:3]) <= 1e-12
            assert largest(found[name] - expected[name]) <= 1e-11, name
        slack = D * ((VELOCITIES[two] - VELOCITIES[one]) @ along) ** 2
        assert flows.sum() == pytest.approx(slack, rel=1e-12)
