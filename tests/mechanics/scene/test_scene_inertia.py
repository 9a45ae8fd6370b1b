"""Impossible inertias: refused, kept as long as the motion is determined, or replaced by the nearest possible ones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs.mechanics.scene.inertia import nearest_inertia
from tests.numerics import largest

entries = st.floats(-10.0, 10.0)
tensors = st.lists(entries, min_size=6, max_size=6).map(
    lambda x: np.array([[x[0], x[3], x[4]], [x[3], x[1], x[5]], [x[4], x[5], x[2]]])
)
points = st.lists(st.lists(entries, min_size=3, max_size=3), min_size=1, max_size=6).map(np.array)


def second_moments(tensor):
    return 0.5 * np.trace(tensor) * np.eye(3) - tensor


def of_points(x):
    second = x.T @ x
    return np.trace(second) * np.eye(3) - second


@given(tensors, points)
def test_the_nearest_tensor_is_possible_and_nearest(tensor, x):
    found = nearest_inertia(tensor)
    least, middle, most = np.linalg.eigvalsh(found)
    slack = 1e-12 * max(1.0, largest(tensor))
    assert least >= -slack
    assert most <= least + middle + slack
    # a projection on a convex set: from there to what is left it is a blunt angle to every other possible tensor
    left = second_moments(tensor) - second_moments(found)
    other = second_moments(of_points(x)) - second_moments(found)
    assert np.sum(left * other) <= 1e-9 * max(1.0, largest(left) * largest(other))


@given(points)
def test_a_possible_tensor_is_its_own_nearest(x):
    tensor = of_points(x)
    assert largest(nearest_inertia(tensor) - tensor) <= 1e-12 * max(1.0, largest(tensor))


# Point masses at the ends of rods without mass: no inertia about their centres.
PENDULUM = """format = 1
[assembly]
inertia = "warn"
[bodies.a]
mass = 2.0
inertia = [0.0, 0.0, 0.0]
position = [0.3, 0.0, -0.4]
[bodies.b]
mass = 1.0
inertia = [0.0, 0.0, 0.0]
position = [0.3, 0.0, -1.1]
[joints.first]
type = "revolute"
bodies = ["ground", "a"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
[joints.second]
type = "revolute"
bodies = ["a", "b"]
at = [0.3, 0.0, -0.4]
axis = [0.0, 1.0, 0.0]
"""


def write(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return path


def test_mass_points_accelerate_as_the_closed_form_says(tmp_path):
    with pytest.warns(ephs.SceneWarning) as caught:
        scene = ephs.load(write(tmp_path, PENDULUM))
    assert len(caught) == 1
    assert "bodies.a.inertia" in str(caught[0].message)
    assert "bodies.b.inertia" in str(caught[0].message)
    dynamics = ephs.dynamics(scene)
    rng = np.random.default_rng(5)
    for _ in range(10):
        x, u = rng.standard_normal((2, 2))
        state = dynamics.state({"first": x[0], "second": x[1]}, {"first": u[0], "second": u[1]})
        found = dynamics.acceleration(state)
        # angles from the vertical, about y: a rod at the angle φ points along (−sin φ, 0, −cos φ)
        one, two = x[0] + np.arctan2(-0.3, 0.4), x[0] + x[1]
        v1, v2, l1, l2, m1, m2, g = u[0], u[0] + u[1], 0.5, 0.7, 2.0, 1.0, 9.81
        c, s = np.cos(one - two), np.sin(one - two)
        mass = np.array([[(m1 + m2) * l1**2, m2 * l1 * l2 * c], [m2 * l1 * l2 * c, m2 * l2**2]])
        force = [
            -m2 * l1 * l2 * s * v2**2 - (m1 + m2) * g * l1 * np.sin(one),
            m2 * l1 * l2 * s * v1**2 - m2 * g * l2 * np.sin(two),
        ]
        a1, a2 = np.linalg.solve(mass, force)
        assert abs(found["first"][0] - a1) <= 1e-9 * abs(a1)
        assert abs(found["second"][0] - (a2 - a1)) <= 1e-9 * max(abs(a1), abs(a2))


@pytest.mark.filterwarnings("ignore::ephs.SceneWarning")
@pytest.mark.parametrize(
    "inertia", ["[0.0, 0.0, 0.0]", "[0.02, 0.02, 0.0]", "[0.02, 0.03, 0.2]", "[0.02, -0.01, 0.02]"]
)
@pytest.mark.parametrize("method", ["rk87", "natural", "radau"])
def test_runs_keep_their_energy(method, inertia, tmp_path):
    scene = ephs.load(
        write(
            tmp_path,
            PENDULUM.replace("[0.0, 0.0, 0.0]\nposition = [0.3, 0.0, -1", f"{inertia}\nposition = [0.3, 0.0, -1"),
        )
    )
    sol = ephs.simulate(scene, 0.2, method=method, **({"step": 0.005} if method == "natural" else {}))
    assert sol.energy_error.max() < 1e-7
    assert largest(sol.constraint_error) < 1e-10
    assert largest(sol.joint("second").rate) > 0.1
    reference = ephs.simulate(scene, 0.2, method="rk87", rtol=1e-11, atol=1e-13)
    near = 1e-3 if method == "natural" else 1e-5
    assert largest(sol.body("b").position[-1] - reference.body("b").position[-1]) < near


def test_mass_and_inertia_must_both_be_there(tmp_path):
    text = PENDULUM.replace("mass = 1.0\ninertia = [0.0, 0.0, 0.0]", "mass = 0.0\ninertia = [0.01, 0.01, 0.01]")
    with pytest.warns(ephs.SceneWarning, match=r"bodies\.b\.mass: found 0 kg"):
        scene = ephs.load(write(tmp_path, text))
    assert 0.0 < scene.body("b").mass < 1e-12
    with pytest.raises(ephs.SceneError, match="0 for a body of mass 0"):
        ephs.load(write(tmp_path, text), inertia="strict")


def test_an_argument_goes_before_the_file(tmp_path):
    text = PENDULUM.replace("inertia = [0.0, 0.0, 0.0]", "inertia = [1.0, 1.0, 3.0]")
    with pytest.raises(ephs.SceneError) as caught:
        ephs.load(write(tmp_path, text), inertia="strict")
    assert [fault.key for fault in caught.value.faults] == ["bodies.a.inertia", "bodies.b.inertia"]
    with pytest.warns(ephs.SceneWarning, match="replaced by the nearest possible ones: principal moments 1.5, 1.5, 3"):
        scene = ephs.load(write(tmp_path, text), inertia="nearest")
    assert largest(np.linalg.eigvalsh(scene.body("a").inertia) - [1.5, 1.5, 3.0]) < 1e-10
    with pytest.warns(ephs.SceneWarning, match='"nearest" takes'):
        kept = ephs.load(write(tmp_path, text))
    assert kept.body("a").inertia[2, 2] == 3.0
    with pytest.raises(ephs.SceneError, match='"strict", "warn" or "nearest"'):
        ephs.load(write(tmp_path, text), inertia="lax")


@pytest.mark.filterwarnings("ignore::ephs.SceneWarning")
@pytest.mark.parametrize("size", [0.02, 1e-4])
def test_rates_are_known_where_inertia_is_small(size, tmp_path):
    along = np.array([0.48, 0.6, 0.64])
    t = size * (np.eye(3) - np.outer(along, along))  # a rod across all axes
    rod = t[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()
    text = PENDULUM.replace(
        "inertia = [0.0, 0.0, 0.0]\nposition = [0.3, 0.0, -1", f"inertia = {rod}\nposition = [0.3, 0.0, -1"
    )
    scene = ephs.load(write(tmp_path, text)).with_state(rates={"first": 3.0, "second": -2.0})
    sol = ephs.simulate(scene, 0.01, audit="off")  # energies of such bodies are rounded by 1e-9 of their size
    assert abs(sol.joint("first").rate[0, 0] - 3.0) < 1e-11
    assert abs(sol.joint("second").rate[0, 0] + 2.0) < 1e-11
