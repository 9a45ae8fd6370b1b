"""Tendons: the rate of a length and the tension are transposes; motion by closed forms and by equations by hand."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import ephs
from ephs.mechanics.elements.springs import point_stretch
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.tendons import Tendon
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.operad import Path
from ephs.semantics.spaces import SE3
from ephs.solve.posing.problem import Signal
from ephs.testing import mechanisms
from tests.mechanics.tree.general import held_to_the_general_form
from tests.numerics import EPS, generators, largest
from tests.scenes import equations_of
from tests.written import scene_of_text

entry = st.floats(-1.0, 1.0)
AWAY = np.array([0.0, 0.0, 0.0, 2.0, 0.0, 0.0])
WEIGHT = """format = 1
[world]
gravity = [0.0, 0.0, -9.81]
[bodies.load]
mass = 2.0
inertia = [0.1, 0.1, 0.1]
[joints.rail]
type = "prismatic"
bodies = ["ground", "load"]
frame1 = {{ position = [0.0, 0.0, 0.0] }}
frame2 = {{ position = [0.0, 0.0, 0.0] }}
coordinate = {z}
rate = {rate}
[tendons.rope]
bodies = {bodies}
points = {points}
stiffness = 80.0
length = {length}
{more}
"""
FALL, MASS, STIFFNESS = 9.81, 2.0, 80.0


def weight(bodies, points, length, z=0.0, rate=0.0, more=""):
    named = "[" + ", ".join(f'"{body}"' for body in bodies) + "]"
    return scene_of_text(WEIGHT.format(bodies=named, points=points, length=length, z=z, rate=rate, more=more))


# ---- the box --------------------------------------------------------------------------------------------------------


@given(st.lists(entry, min_size=6, max_size=6), st.lists(entry, min_size=7, max_size=7))
def test_what_a_segment_gives_and_takes_is_nothing(place, efforts):
    pose = SE3.exp(np.array(place) + AWAY)
    skew, constraint = point_stretch().structure({Path.of("q_r"): pose})
    assert np.array_equal(skew, -skew.T)
    assert constraint.size == 0
    e = np.array(efforts)
    assert abs(e @ skew @ e) <= 8 * 7 * EPS * (np.abs(e) @ np.abs(skew) @ np.abs(e))


@given(st.lists(entry, min_size=6, max_size=6), st.lists(entry, min_size=6, max_size=6))
def test_a_segment_lengthens_at_the_rate_of_the_distance_of_its_ends(place, twist):
    pose, u = SE3.exp(np.array(place) + AWAY), np.array(twist)
    skew, _ = point_stretch().structure({Path.of("q_r"): pose})
    there, back = (np.linalg.norm(SE3.compose(pose, SE3.exp(h * u))[4:]) for h in (1e-5, -1e-5))
    assert -skew[6, :6] @ u == pytest.approx((there - back) / 2e-5, abs=1e-9)


# ---- joint coordinates and the general form -------------------------------------------------------------------------


def tied(scene, rng):
    """The scene with a tendon through drawn points of drawn bodies, and what pulls it."""
    names = ["ground", *(name for name, _ in scene.all_bodies())]
    bodies = [str(name) for name in rng.choice(names, int(rng.integers(2, 6)))]
    bodies += [name for name in names if name != bodies[-1]][:1]  # two that differ
    points = rng.uniform(-2.0, 2.0, (len(bodies), 3))
    numbers = rng.uniform(1.0, 9.0, 3)
    numbers[rng.random(3) < 0.3] = 0.0
    stiffness, length, damping = map(float, numbers)
    made = Tendon(bodies=bodies, points=points.tolist(), stiffness=stiffness, length=length, damping=damping)
    return replace(scene, tendons={"rope": made.called("rope")})


@settings(max_examples=8)
@given(mechanisms(max_bodies=4), generators)
def test_through_drawn_mechanisms_both_forms_have_its_forces(scene, rng):
    problem = problem_of_scene(tied(scene, rng))
    port = Path.of("tensions.rope")
    problem = replace(problem, signals={**problem.signals, port: Signal(rng.normal(size=1))})
    eq = ReducedEquations(problem, 0.0)
    held_to_the_general_form(eq, problem, eq.start(0.0))


# ---- motion ---------------------------------------------------------------------------------------------------------


METHODS = [
    ("rk54", {"rtol": 1e-11, "atol": 1e-12}, 1e-9),
    ("rk87", {"rtol": 1e-11, "atol": 1e-12}, 1e-9),
    ("radau", {"rtol": 1e-11, "atol": 1e-12}, 1e-9),
    ("natural4", {"step": 2e-3}, 1e-8),
    ("natural", {"step": 1e-3}, 1e-4),
    ("variational", {"step": 2e-3}, 1e-3),
]


@pytest.mark.parametrize(("method", "options", "near"), METHODS)
def test_a_mass_on_a_tendon_over_two_points_swings_as_a_cosine(method, options, near):
    scene = weight(("ground", "ground", "load"), [[3.0, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 0.0]], 4.5)
    sol = ephs.simulate(scene, 1.0, method=method, save_at=[0.0, 0.5, 1.0], audit="off", **options)
    rest = np.sqrt(10.0) + 2.0 - 4.5 - MASS * FALL / STIFFNESS  # where weight and tension balance
    exact = rest * (1.0 - np.cos(np.sqrt(STIFFNESS / MASS) * sol.t))
    assert largest(sol.joint("rail").coordinate[:, 0] - exact) <= near
    assert largest(sol["tendons.rope.spring.q"].ravel() - (2.0 - exact)) <= near


def swinging(t, y):
    """A bob on a rail across a taut tendon, z its height: the tension has a part 2 z/ℓ across it, ℓ = 2 √(1 + z²)."""
    z, v, _ = y
    length = 2.0 * np.sqrt(1.0 + z * z)
    rate = 4.0 * z / length * v
    tension = STIFFNESS * (length - 1.8) + 0.7 * rate
    return [v, -FALL - tension * 4.0 * z / length / MASS, 0.7 * rate * rate]


@pytest.mark.parametrize(("method", "options", "near"), METHODS)
def test_a_bob_across_a_damped_tendon_moves_as_equations_by_hand_say(method, options, near):
    points = [[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    scene = weight(("ground", "load", "ground"), points, 1.8, 0.3, 1.0, "damping = 0.7")
    sol = ephs.simulate(scene, 1.0, method=method, save_at=[0.0, 1.0], audit="off", **options)
    z, v, heat = solve_ivp(swinging, (0.0, 1.0), [0.3, 1.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    rail = sol.joint("rail")
    found = np.array([rail.coordinate[-1, 0], rail.rate[-1, 0], sol.heat[-1]])
    assert largest(found - [z, v, heat]) <= 10.0 * near
    assert np.all(np.diff(sol.heat) >= 0.0)
    assert sol.energy_error.max() < 1e-10


def test_a_cable_only_pulls():
    """A body is thrown up on a cable: free until it is taut, then held back."""
    scene = weight(("ground", "load"), [[0.0, 0.0, -0.5], [0.0, 0.0, 0.0]], 1.0, 0.0, 4.0, "slack = true")
    taut = (4.0 - np.sqrt(16.0 - 2.0 * FALL * 0.5)) / FALL
    times = np.array([0.0, 0.5 * taut, taut, taut + 0.2])
    for method, options in (("rk87", {"rtol": 1e-10}), ("natural", {"step": 1e-3}), ("radau", {"rtol": 1e-9})):
        sol = ephs.simulate(scene, float(times[-1]), method=method, save_at=times, audit="off", **options)
        z = sol.joint("rail").coordinate[:, 0]
        assert largest(z[:3] - (4.0 * times[:3] - 0.5 * FALL * times[:3] ** 2)) <= 1e-6
        rate, beat = 4.0 - FALL * taut, np.sqrt(STIFFNESS / MASS)
        drop = MASS * FALL / STIFFNESS
        exact = 0.5 - drop + drop * np.cos(0.2 * beat) + rate / beat * np.sin(0.2 * beat)
        assert z[3] == pytest.approx(exact, abs=1e-5)
        assert sol.energy_error.max() < 1e-9


def test_a_body_on_tendons_alone_moves_as_a_free_one():
    """A ball between four tendons: its free joint is that of its name, and momentum changes by the tensions."""
    text = "format = 1\n[world]\ngravity = [0.0, 0.0, 0.0]\n[bodies.ball]\nmass = 0.5\ninertia = [0.1, 0.2, 0.3]\n"
    for k, (x, y) in enumerate(((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))):
        text += f"[tendons.t{k}]\nbodies = ['ground', 'ball']\nstiffness = 10.0\n"
        text += f"points = [[{x}, {y}, 0.3], [{0.1 * x}, {0.1 * y}, 0.0]]\nlength = 1.0\n"
    scene = scene_of_text(text).with_state(rates={"ball": [1.0, -2.0, 0.5, 0.3, 0.2, 0.1]})
    eq = equations_of(scene)
    assert eq.layout.joints == ("ball",)
    assert eq.reduced.tables.rows.sum() == 0
    one, other = (ephs.simulate(scene, 0.5, method=m, rtol=1e-10, audit="off") for m in ("rk87", "radau"))
    assert np.allclose(one.body("ball").position[-1], other.body("ball").position[-1], atol=1e-7)
    assert one.energy_error.max() < 1e-11
