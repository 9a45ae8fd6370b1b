"""Generated scenes of bodies that fall, slip, roll and strike each other, hard and elastic: both laws at any step."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.impacts.stepping import CLOSED
from tests.written import scene_of_text

HEAD = 'format = 1\nname = "thrown"\n[world]\ngravity = [0.0, 0.0, -9.81]\n[surfaces.floor]\nbody = "ground"\n'
HEAD += "shape = { plane = {} }\n"
BODY = """
[bodies.b{i}]
mass = {mass}
inertia = {inertia}
position = {position}
rotation = {rotation}
velocity = {velocity}
angular_velocity = {spin}
[surfaces.b{i}]
body = "b{i}"
shape = {{ {shape} }}
{law}
"""
ARM = """
[joints.arm]
type = "{kind}"
bodies = ["b0", "b1"]
at = {at}
axis = [0.0, 1.0, 0.0]
"""
SHAPES = ("sphere = 0.1", "capsule = [0.05, 0.1]", "box = [0.15, 0.1, 0.12]", "cylinder = [0.08, 0.1]")
MEETING = SHAPES[:3]


def text_of(rng, *, hard):
    """One to three bodies above a floor, at no point in each other; half of those of several have a joint."""
    count, parts = int(rng.integers(1, 4)), [HEAD]
    parts.append(law_of(rng, hard=hard))
    joined = count > 1 and rng.random() < 0.5
    for i in range(count):
        shape = (SHAPES if count == 1 else MEETING)[rng.integers(4 if count == 1 else 3)] if i == 0 else SHAPES[0]
        turn = rng.normal(size=4)
        numbers = {
            "mass": float(rng.uniform(0.2, 2.0)), "inertia": (float(rng.uniform(1.0, 3.0)) * np.full(3, 2e-3)).tolist(),
            "position": [0.3 * i + float(rng.uniform(-0.02, 0.02)), 0.0, float(rng.uniform(0.13, 0.3))],
            "rotation": (turn / np.linalg.norm(turn)).tolist(), "spin": (5.0 * rng.normal(size=3)).tolist(),
            "velocity": [float(rng.normal()) - i, float(rng.normal()), float(rng.normal())],
        }  # fmt: skip
        if joined and i < 2:
            numbers |= {"velocity": [0.0] * 3, "spin": [0.0] * 3}
        parts.append(BODY.format(i=i, shape=shape, law=law_of(rng, hard=hard), **numbers))
    if joined:
        parts.append(ARM.format(kind=rng.choice(["revolute", "spherical"]), at="[0.15, 0.0, 0.25]"))
        if rng.random() < 0.5:
            parts[-1] = parts[-1].replace('type = "spherical"', 'type = "revolute"')
        if "spherical" in parts[-1]:
            parts[-1] = parts[-1].replace("axis = [0.0, 1.0, 0.0]\n", "")
    return "".join(parts)


def law_of(rng, *, hard):
    friction = f"friction = {rng.choice([0.0, 0.1, 0.4, 1.5])}\n"
    if hard:
        return friction + f"restitution = {rng.choice([0.0, 0.3, 0.8, 1.0])}\n"
    return friction + f"stiffness = {10.0 ** rng.uniform(4, 6)}\nloss = {rng.uniform(0.0, 1.0)}\n"


@pytest.mark.parametrize(("seed", "hard"), [(seed, hard) for hard in (True, False) for seed in range(20)])
def test_both_laws_hold_whatever_touches(seed, hard):
    rng = np.random.default_rng(seed)
    step = [None, 2.0**-4, 2.0**-6, 2.0**-8][seed % 4] if hard else None
    options = {"method": "rk54", "step": step} if step else {"rtol": [1e-2, 1e-3][seed % 2]}
    scene = scene_of_text(text_of(rng, hard=hard))
    sol = ephs.simulate(scene, 0.3, audit="off", **options)
    assert np.abs(sol.energy_error).max() <= 1e-11
    assert sol.stats["least_production"] >= 0.0
    assert np.all(np.diff(sol.heat) >= 0.0)
    if hard:
        assert min(sol.contact(name).gap.min() for name, _ in scene.all_contacts()) >= -2.0 * CLOSED
