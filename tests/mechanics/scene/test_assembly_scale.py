"""A misfit is as large as the mechanism makes it: assembly knows no unit."""

import pytest

import ephs
from tests.written import scene_of_text

PAIR = """format = 1
name = "pair"
[world]
gravity = [0.0, -9.81, 0.0]
[bodies.arm]
mass = {mass!r}
inertia = [{inertia!r}, {inertia!r}, {inertia!r}]
position = [{half!r}, {off!r}, 0.0]
[joints.pin]
type = "revolute"
bodies = ["ground", "arm"]
frame1 = {{}}
frame2 = {{ position = [{back!r}, 0.0, 0.0] }}
"""


def arm(length, off):
    mass = 2.0
    half, inertia = 0.5 * length, mass * length**2 / 12.0
    return scene_of_text(PAIR.format(mass=mass, inertia=inertia, half=half, back=-half, off=off))


@pytest.mark.parametrize("length", [1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e5])
def test_a_gap_is_measured_by_the_mechanism(length):
    assert arm(length, 1e-9 * length).joint("pin").coordinate.shape == (1,)
    with pytest.raises(ephs.SceneError, match="a gap of"):
        arm(length, 1e-7 * length)
