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
    exponent = None if hard else rng.choice([1.0, 1.5])
    parts.append(law_of(rng, exponent))
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
        parts.append(BODY.format(i=i, shape=shape, law=law_of(rng, exponent), **numbers))
    if joined:
        parts.append(ARM.format(kind=rng.choice(["revolute", "spherical"]), at="[0.15, 0.0, 0.25]"))
        if rng.random() < 0.5:
            parts[-1] = parts[-1].replace('type = "spherical"', 'type = "revolute"')
        if "spherical" in parts[-1]:
            parts[-1] = parts[-1].replace("axis = [0.0, 1.0, 0.0]\n", "")
    return "".join(parts)


def law_of(rng, exponent):
    friction = f"friction = {rng.choice([0.0, 0.1, 0.4, 1.5])}\n"
    if exponent is None:
        return friction + f"restitution = {rng.choice([0.0, 0.3, 0.8, 1.0])}\n"
    elastic = f"stiffness = {10.0 ** rng.uniform(3, 6)}\nexponent = {exponent}\nloss = {rng.uniform(0.0, 2.0)}\n"
    return friction + elastic + f"rolling = {rng.choice([0.0, 1e-2])}\n"


def assert_lawful(sol, missed=1e-11):
    assert np.abs(sol.energy_error).max() <= missed
    assert sol.stats["least_production"] >= 0.0
    assert np.all(np.diff(sol.heat) >= 0.0)


@pytest.mark.parametrize("seed", range(20))
def test_both_laws_hold_whatever_strikes(seed):
    step = [None, 2.0**-4, 2.0**-6, 2.0**-8][seed % 4]
    scene = scene_of_text(text_of(np.random.default_rng(seed), hard=True))
    sol = ephs.simulate(scene, 0.3, method="rk54", audit="off", **({"step": step} if step else {}))
    assert_lawful(sol)
    assert min(sol.contact(name).gap.min() for name, _ in scene.all_contacts()) >= -2.0 * CLOSED


@pytest.mark.parametrize("method", ["rk54", "rk87", "radau", "auto"])
@pytest.mark.parametrize("seed", range(12))
def test_both_laws_hold_whatever_touches(seed, method):
    """A coarse step over a whole bounce may miss more energy than the motion holds: it is refused, and tried shorter.

    What is left is the energy of a motion by one tolerance, 2 rtol of it, in the mean of six directions.
    """
    rtol = [1e-1, 3e-2, 1e-2, 1e-3][seed % 4]
    scene = scene_of_text(text_of(np.random.default_rng(seed), hard=False))
    sol = ephs.simulate(scene, 0.3, method=method, rtol=rtol, audit="off")
    assert_lawful(sol, 1e-11 if rtol <= 1e-2 else 2.0 * np.sqrt(6.0) * rtol)
