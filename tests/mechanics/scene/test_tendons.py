"""Tendons through points of bodies: the forces are those of their length, by virtual work."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.operad import Path
from tests.numerics import largest
from tests.written import scene_of_text

STIFFNESS, DAMPING, LENGTH = 100.0, 2.0, 1.5
ARM = """
format = 1
name = "reach"
[bodies.arm]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
[bodies.hand]
mass = 0.5
inertia = [0.05, 0.05, 0.05]
[joints.pin]
type = "revolute"
bodies = ["ground", "arm"]
frame1 = {{ rotation = [0.7071067811865476, -0.7071067811865476, 0.0, 0.0] }}
frame2 = {{ position = [-0.5, 0.0, 0.0], rotation = [0.7071067811865476, -0.7071067811865476, 0.0, 0.0] }}
coordinate = {0}
rate = {2}
[joints.elbow]
type = "revolute"
bodies = ["arm", "hand"]
frame1 = {{ position = [0.5, 0.0, 0.0], rotation = [0.7071067811865476, -0.7071067811865476, 0.0, 0.0] }}
frame2 = {{ position = [-0.5, 0.0, 0.0], rotation = [0.7071067811865476, -0.7071067811865476, 0.0, 0.0] }}
coordinate = {1}
rate = {3}
"""
CABLE = f"""
[tendons.cable]
bodies = ["ground", "arm", "arm", "hand"]
points = [[0.0, 0.0, 0.4], [0.2, 0.1, 0.1], [0.4, 0.0, 0.1], [0.4, 0.2, 0.05]]
stiffness = {STIFFNESS}
damping = {DAMPING}
length = {LENGTH}
"""
STAY = """
[tendons.stay]
bodies = ["ground", "arm"]
points = [[0.0, 0.1, 0.4], [0.2, 0.0, 0.1]]
stiffness = 100.0
damping = 2.0
length = 0.3
heat = "air"
[thermal.air]
capacity = 10.0
temperature = 300.0
"""
SPRING = STAY.replace("tendons", "springs").replace("points = [[", "at1 = [").replace("], [", "]\nat2 = [").replace(
    "]]", "]"
)  # fmt: skip


def loaded(more, state=(0.2, -0.4, 0.5, -0.7), **options):
    return scene_of_text(ARM.format(*state) + more, **options)


def length(a, b):
    """Of the cable, by the angles of the two joints about y, of which rotations take x to −z."""

    def turned(angle, x, y, z):
        return np.array([np.cos(angle) * x + np.sin(angle) * z, y, np.cos(angle) * z - np.sin(angle) * x])

    first, second = turned(a, 0.7, 0.1, 0.1), turned(a, 0.9, 0.0, 0.1)
    last = turned(a, 1.0, 0.0, 0.0) + turned(a + b, 0.9, 0.2, 0.05)
    pieces = first - np.array([0.0, 0.0, 0.4]), second - first, last - second
    return sum(np.sqrt(np.sum(piece * piece)) for piece in pieces)


angle = st.floats(-1.2, 1.2)


@settings(max_examples=3)
@given(angle, angle, angle, angle, st.floats(-20.0, 20.0))
def test_forces_are_tension_times_the_gradient_of_the_length(a, b, rate_a, rate_b, pull):
    state = (a, b, rate_a, rate_b)
    bare, tied = ephs.dynamics(loaded("", state)), loaded(CABLE, state)
    step = 1e-20j
    gradient = np.array([length(a + step, b).imag, length(a, b + step).imag]) / 1e-20
    tension = STIFFNESS * (length(a, b) - LENGTH) + DAMPING * (gradient @ [rate_a, rate_b]) + pull
    forces = dict(zip(("pin", "elbow"), (-tension * gradient).tolist(), strict=True))
    exact = bare.acceleration(bare.state0, forces)
    eq = ReducedEquations(problem_of_scene(tied, inputs={"actuators.cable": pull}), 0.0)
    start = eq.start(0.0)
    found = eq.rates(0.0, start.q, eq.vector(start))[eq.nv :]
    for joint, value in exact.items():
        assert np.allclose(found[eq.layout.freedoms[joint]], value, rtol=1e-9, atol=1e-8)


def ended(scene, method, inputs=None, **options):
    sol = ephs.simulate(scene, 0.3, method=method, inputs=inputs or {}, audit="off", save_at=[0.0, 0.3], **options)
    return np.array([sol.joint(name).coordinate[-1, 0] for name in ("pin", "elbow")]), sol


@pytest.mark.parametrize(
    ("method", "options", "near"),
    [
        ("radau", {"rtol": 1e-9, "atol": 1e-11}, 1e-7),
        ("natural4", {"step": 2e-3}, 1e-7),
        ("natural", {"step": 2e-3}, 1e-4),
        ("variational", {"step": 0.01}, 1e-2),
    ],
)
def test_all_methods_pull_it(method, options, near):
    scene, inputs = loaded(CABLE), {"actuators.cable": lambda t: 5.0 * np.sin(7.0 * t)}
    exact, sure = ended(scene, "rk87", inputs, rtol=1e-11, atol=1e-12)
    found, sol = ended(scene, method, inputs, **options)
    assert sure.energy_error.max() < 1e-12
    assert largest(found - exact) <= near
    if method != "variational":
        assert sol.energy_error.max() < 1e-12


def test_between_two_points_it_is_a_spring():
    (exact, spring), (found, sol) = (ended(loaded(more), "rk87", rtol=1e-11, atol=1e-12) for more in (SPRING, STAY))
    assert largest(found - exact) <= 1e-9
    assert sol.heat[-1] == pytest.approx(spring.heat[-1], rel=1e-8)


@pytest.mark.parametrize("method", ["rk87", "radau", "natural"])
def test_antagonists_lie_beside_each_other(method):
    pair = STAY + STAY.partition("[thermal")[0].replace("stay", "other").replace("0.1, 0.4]", "-0.1, -0.4]")
    steps = {"step": 2e-3} if method == "natural" else {"rtol": 1e-8}
    pulled = {"actuators.other": 20.0}
    still, sol = (ended(loaded(pair), method, given, **steps) for given in ({}, pulled))
    assert sol[1].energy_error.max() < 1e-11
    assert sol[0][0] > still[0][0] + 1e-3


def test_an_actuator_pulls_at_a_tendon_by_its_ratio_within_its_limits(tmp_path):
    winch = '[actuators.winch]\ntendon = "cable"\nratio = -2.0\nlimits = [0.0, 3.0]\n'
    scene = loaded(CABLE + winch)
    one, other = (ended(scene, "rk87", given)[0] for given in ({"actuators.winch": 5.0}, {"actuators.cable": 6.0}))
    assert largest(one - other) <= 1e-12
    assert not np.allclose(one, ended(scene, "rk87")[0], atol=1e-3)


def test_the_length_is_a_state_where_it_stores_energy():
    sol = ended(loaded(CABLE), "rk87", rtol=1e-11, atol=1e-12)[1]
    whole = sol["tendons.cable.spring.q"].ravel() + np.sqrt(0.05)  # with what lies along the arm
    assert whole[0] == pytest.approx(length(0.2, -0.4), rel=1e-14)
    angles = (sol.joint(name).coordinate[-1, 0] for name in ("pin", "elbow"))
    assert whole[-1] == pytest.approx(length(*angles), rel=1e-10)


def test_at_rest_tension_balances_weight():
    """Forces are weights and k (ℓ − L) times the gradients of heights and length, by complex steps."""
    found = ephs.equilibrium(loaded(CABLE))
    angles = np.array([found.model.joint(name).coordinate[0] for name in ("pin", "elbow")])

    def energy(a, b):
        heights = -0.5 * np.sin(a), -np.sin(a) - 0.5 * np.sin(a + b)
        return 9.81 * (heights[0] + 0.5 * heights[1]) + 0.5 * STIFFNESS * (length(a, b) - LENGTH) ** 2

    slopes = [energy(*(angles + step)).imag / 1e-20 for step in 1e-20j * np.eye(2)]
    assert largest(slopes) < 1e-9 * STIFFNESS
    assert found.states[Path.of("tendons.cable.spring.q")][0] + np.sqrt(0.05) == pytest.approx(
        length(*angles), rel=1e-12
    )
    still = ephs.simulate(found.model, 0.1, method="rk87", audit="off")
    assert np.abs(still.joint("pin").coordinate[-1] - angles[0]) < 1e-9


def test_loads_beside_sprung_tendons_have_no_static_path():
    with pytest.raises(ValueError, match=r"tendons\.cable and loads"):
        ephs.equilibrium(loaded(CABLE + '[loads.push]\nbody = "hand"\nforce = [0.0, 0.0, 1.0]\n'))


THROUGH = """
format = 1
name = "through"
[world]
gravity = [0.0, 0.0, 0.0]
[bodies.cart]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
[joints.rail]
type = "prismatic"
bodies = ["ground", "cart"]
frame1 = { rotation = { axis = [0, 1, 0], angle_deg = 90 } }
frame2 = { rotation = { axis = [0, 1, 0], angle_deg = 90 } }
coordinate = -0.33
rate = 1.0
[tendons.stay]
bodies = ["ground", "cart"]
points = [[0.0, OFF, 0.0], [0.0, 0.0, 0.0]]
stiffness = 1e-3
length = 0.0
"""


@pytest.mark.parametrize("method", ["natural", "variational"])
def test_a_length_that_is_not_that_of_its_points_is_found_by_the_audit(tmp_path, method):
    """A segment's direction jumps at the length zero, where coarse steps lose length; beside it they do not."""
    for off, sound in ((0.0, False), (0.3, True)):
        file = tmp_path / f"{off}.toml"
        file.write_text(THROUGH.replace("OFF", str(off)), encoding="utf-8")
        sol = ephs.simulate(ephs.load(file), 1.0, method=method, step=0.08, audit="off")
        places = sol.body("cart").position - np.array([0.0, off, 0.0])
        apart = largest(sol["tendons.stay.spring.q"].ravel() - np.linalg.norm(places, axis=1))
        told = [finding for finding in sol.audit.findings if "tendons.stay" in finding.path]
        assert (apart <= 1e-2) == sound == (not told)
