"""Joint wrenches from the bodies' equations alone are those of the whole descriptor form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs.mechanics.scene.build import component_path
from ephs.mechanics.scene.model import Scene
from ephs.solve.equations.instant import instant
from ephs.testing import mechanisms
from tests.numerics import largest
from tests.written import scene_of_text


def of_descriptor(sol: ephs.Solution, name: str, i: int) -> np.ndarray:
    """The oracle: the multiplier of the joint's relation at an instant."""
    problem, state = sol.problem, sol.motion.state(i)
    at = component_path("joints", name)
    box = at / "second" / "hc" if sol.scene.joint(name).middle is not None else at / "hc"
    inputs = problem.inputs(float(sol.t[i]), state)
    d = problem.descriptor
    return instant(d, problem.reference, d.pack(state), inputs).multiplier(box)


def assert_wrenches(text, names, **tolerances):
    """At the end of a run they are those of the descriptor form."""
    sol = ephs.simulate(scene_of_text(text), 0.1, method="rk87", **tolerances)
    for name in names:
        found, expected = sol.joint(name).wrench[-1], of_descriptor(sol, name, len(sol) - 1)
        assert largest(found - expected) < 1e-10 * largest(expected)


def inputs_of(scene: Scene, seed: int) -> dict[str, object]:
    """A wrench on each body that changes with time, a force on each joint that changes with the state."""
    rng = np.random.default_rng(seed)
    out: dict[str, object] = {}
    for name, _ in scene.all_bodies():
        size = rng.standard_normal(6)
        out[f"bodies.{name}"] = lambda t, size=size: size * np.cos(t)
        pose = f"bodies.{name}.pe.q"
    for name, joint in scene.all_joints():
        if joint.dim and joint.motion is None:
            size = rng.standard_normal(joint.dim)
            out[f"joints.{name}"] = lambda t, state, size=size, pose=pose: size * state[pose][4] + t
    return out


@given(mechanisms(), st.booleans(), st.integers(0, 9))
def test_wrenches_are_those_of_the_descriptor_form(scene, driven, seed):
    sol = ephs.simulate(scene, 2e-5, step=1e-5, inputs=inputs_of(scene, seed) if driven else None)
    for name in scene.joints:
        found, expected = sol.joint(name).wrench[1], of_descriptor(sol, name, 1)
        assert np.array_equal(np.isnan(found), np.isnan(expected))
        scale = 1.0 + np.nanmax(np.abs(expected), initial=0.0)
        assert np.nanmax(np.abs(found - expected), initial=0.0) < 1e-9 * scale


@pytest.mark.parametrize("kind", ["revolute", "cylindrical", "spherical"])
@pytest.mark.filterwarnings("ignore::ephs.SceneWarning")
def test_wrenches_of_bodies_with_a_negative_principal_moment_are_those_of_the_descriptor_form(kind):
    """A scene may keep an inertia that no body has: its equations have a solution all the same."""
    place = "" if kind == "spherical" else "axis = [0.0, 1.0, 0.2]"
    text = f"""
    format = 1
    name = "odd"
    [assembly]
    inertia = "warn"
    adjust = true
    [bodies.rod]
    mass = 1.0
    inertia = [0.1, 0.2, -0.05]
    position = [0.5, 0.1, 0.0]
    angular_velocity = [0.3, 1.0, 0.2]
    [bodies.bob]
    mass = 0.7
    inertia = [0.1, -0.02, 0.05]
    position = [1.0, 0.3, -0.2]
    angular_velocity = [0.0, 1.0, 0.5]
    [joints.pin]
    type = "{kind}"
    bodies = ["ground", "rod"]
    at = [0.0, 0.0, 0.0]
    {place}
    [joints.elbow]
    type = "revolute"
    bodies = ["rod", "bob"]
    at = [0.8, 0.1, 0.0]
    axis = [1.0, 1.0, 0.2]
    """
    assert_wrenches(text, ("pin", "elbow"), rtol=1e-9, atol=1e-9)


def test_a_weld_transmits_what_the_body_behind_it_needs():
    """Bodies that are fixed to each other are one link of the methods, and two where wrenches are read."""
    text = """
    format = 1
    name = "welded"
    [bodies.rod]
    mass = 1.0
    inertia = [0.1, 0.2, 0.2]
    position = [0.5, 0.0, 0.0]
    [bodies.bob]
    mass = 0.7
    inertia = [0.1, 0.2, 0.15]
    position = [1.0, 0.0, 0.0]
    [joints.pin]
    type = "revolute"
    bodies = ["ground", "rod"]
    at = [0.0, 0.0, 0.0]
    axis = [0.0, 1.0, 0.0]
    [joints.weld]
    type = "fixed"
    bodies = ["rod", "bob"]
    at = [0.8, 0.1, 0.0]
    """
    assert_wrenches(text, ("pin", "weld"))
