"""Markers: points on bodies that are read, and that forces are put on."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from tests.numerics import largest
from tests.written import scene_of_text

PENDULUM = """
format = 1
name = "pendulum"
[bodies.rod]
mass = 2.0
inertia = [0.2, 0.2, 0.01]
[joints.pin]
type = "revolute"
bodies = ["ground", "rod"]
axis = [1.0, 0.0, 0.0]
at = [0.0, 0.0, 0.5]
[markers.tip]
body = "rod"
at = [0.1, 0.0, -0.5]
[markers.wall]
body = "ground"
at = [1.0, 2.0, 3.0]
"""


@pytest.fixture
def pendulum():
    return scene_of_text(PENDULUM)


def test_a_marker_moves_with_its_body(pendulum):
    sol = ephs.simulate(pendulum.with_state(coordinates={"pin": 1.0}), 0.5, step=0.005)
    tip, rod = sol.marker("tip"), sol.body("rod")
    assert np.allclose(tip.position, sol.point("rod", [0.1, 0.0, -0.5]))
    steps = (tip.position[2:] - tip.position[:-2]) / 0.01
    assert largest(steps - tip.velocity[1:-1]) <= 2e-3
    assert np.allclose(np.linalg.norm(tip.position - rod.position, axis=1), np.hypot(0.1, 0.5))
    assert np.array_equal(sol.marker("wall").position, np.tile([1.0, 2.0, 3.0], (len(sol), 1)))
    assert not sol.marker("wall").velocity.any()
    with pytest.raises(KeyError, match="no such marker; the markers are tip, wall"):
        sol.marker("top")


def test_a_force_at_a_marker_is_the_wrench_that_it_makes(pendulum):
    """A force against gravity at the centre of mass: nothing moves; at the tip it has a moment, and works."""
    weight = 2.0 * 9.81
    bent = pendulum.with_state(coordinates={"pin": 0.7})

    def wrench(t, state):
        w, x, y, z = state[ephs.Path.of("bodies.rod.pe.q")][:4]
        up = np.array([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]) * weight
        return np.concatenate([np.cross([0.1, 0.0, -0.5], up), up])

    by_force = ephs.simulate(bent, 0.3, step=0.003, inputs={"markers.tip": [0.0, 0.0, weight]})
    by_wrench = ephs.simulate(bent, 0.3, step=0.003, inputs={"bodies.rod": wrench})
    assert largest(by_force.joint("pin").coordinate - by_wrench.joint("pin").coordinate) <= 1e-12
    rise = by_force.marker("tip").position[:, 2] - by_force.marker("tip").position[0, 2]
    # inputs are held at the middle of a step, where the rotation is known to second order
    assert largest(by_force.work - weight * rise) <= 1e-4 * weight * np.ptp(rise)
    both = ephs.simulate(bent, 0.3, step=0.003, inputs={"markers.tip": [0.0, 0.0, weight], "bodies.rod": np.zeros(6)})
    assert largest(both.joint("pin").coordinate - by_force.joint("pin").coordinate) <= 1e-13


def test_markers_of_parts_move_with_their_ground(tmp_path):
    (tmp_path / "pendulum.toml").write_text(PENDULUM)
    (tmp_path / "hall.toml").write_text(
        "format = 1\n[bodies.ball]\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\n"
        '[parts.left]\nuse = "pendulum.toml"\nposition = [0.0, 5.0, 0.0]\n'
    )
    hall = ephs.load(tmp_path / "hall.toml")
    assert [name for name, _ in hall.all_markers()] == ["left.tip", "left.wall"]
    sol = ephs.simulate(hall, 0.01, step=0.01)
    assert np.allclose(sol.marker("left.wall").position[0], [1.0, 7.0, 3.0])
    assert np.allclose(sol.marker("left.tip").position[0], [0.1, 5.0, -0.5])
    again = scene_from_text(scene_to_text(hall))
    assert [(n, m.at) for n, m in again.all_markers()] == [(n, m.at) for n, m in hall.all_markers()]


def test_unknown_inputs_list_the_markers(pendulum):
    with pytest.raises(ephs.SemanticsError, match=r"markers\.tip"):
        ephs.simulate(pendulum, 0.1, inputs={"markers.top": [0.0, 0.0, 1.0]})
    with pytest.raises(ephs.SemanticsError, match=r"markers\.wall"):  # a force on the ground does nothing
        ephs.simulate(pendulum, 0.1, inputs={"markers.wall": [0.0, 0.0, 1.0]})
