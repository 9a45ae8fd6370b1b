"""A misfit is as large as the mechanism makes it: assembly knows no unit."""

import pytest

import ephs

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


def arm(length, off, tmp_path):
    mass = 2.0
    file = tmp_path / "pair.toml"
    half, inertia = 0.5 * length, mass * length**2 / 12.0
    file.write_text(PAIR.format(mass=mass, inertia=inertia, half=half, back=-half, off=off), encoding="utf-8")
    return ephs.load(file)


@pytest.mark.parametrize("length", [1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e5])
def test_a_gap_is_measured_by_the_mechanism(length, tmp_path):
    assert arm(length, 1e-9 * length, tmp_path).joint("pin").coordinate.shape == (1,)
    with pytest.raises(ephs.SceneError, match="a gap of"):
        arm(length, 1e-7 * length, tmp_path)
