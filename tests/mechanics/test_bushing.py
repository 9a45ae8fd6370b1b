"""Springs of no length: a bushing pulls its two points together, and starts with both in one place."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.methods import METHODS

MASS, STIFFNESS, DAMPING, GRAVITY = 2.0, 50.0, 3.0, 9.81
SCENE = f"""format = 1
name = "bushing"
[world]
gravity = [0.0, -{GRAVITY}, 0.0]
[bodies.block]
mass = {MASS}
inertia = [0.2, 0.3, 0.4]
position = [0.1, 0.2, 0.3]
[springs.bushing]
bodies = ["ground", "block"]
at1 = [0.1, 0.2, 0.3]
at2 = [0.0, 0.0, 0.0]
stiffness = {STIFFNESS}
length = {{length}}
damping = {DAMPING}
"""


def scene_of(length, tmp_path):
    file = tmp_path / "bushing.toml"
    file.write_text(SCENE.format(length=length), encoding="utf-8")
    return ephs.load(file)


def fall(t):
    """Height above the support of a damped oscillator that is let go there."""
    decay = DAMPING / (2.0 * MASS)
    turns = np.sqrt(STIFFNESS / MASS - decay**2)
    sag = MASS * GRAVITY / STIFFNESS
    return -sag * (1.0 - np.exp(-decay * t) * (np.cos(turns * t) + decay / turns * np.sin(turns * t)))


@pytest.mark.parametrize("name", [name for name, method in METHODS.items() if method.scenes])
def test_a_block_falls_from_the_point_that_holds_it(name, tmp_path):
    method = METHODS[name]
    steps = {"step": 2.0**-8} if method.fixed else {"rtol": 1e-8, "atol": 1e-10}
    times = np.linspace(0.0, 1.0, 5)
    sol = ephs.simulate(scene_of(0.0, tmp_path), 1.0, method=name, save_at=times, **steps)
    error = np.abs(sol.body("block").position[:, 1] - 0.2 - fall(times)).max()
    assert error <= (2.0**-14 if method.fixed else 1e-6)
    assert np.abs(sol.heat[-1] - (-MASS * GRAVITY * fall(1.0) - kinetic(sol) - 0.5 * STIFFNESS * fall(1.0) ** 2)) < 1e-3


def kinetic(sol):
    return 0.5 * MASS * float(sol.body("block").velocity[-1] @ sol.body("block").velocity[-1])


def test_a_spring_with_a_length_is_refused_there(tmp_path):
    with pytest.raises(ephs.SceneError, match="both ends at the same point"):
        scene_of(0.5, tmp_path)
