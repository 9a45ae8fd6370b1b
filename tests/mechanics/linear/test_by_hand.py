"""Mechanisms made by hand, linearised in independent coordinates of joints, as their scenes are."""

import numpy as np
import pytest
from hypothesis import given, settings

import ephs
from ephs import Pattern, quantity
from ephs.mechanics import rigid_body
from ephs.mechanics.elements import components
from ephs.mechanics.scene.build import scene_inputs
from tests.mechanics.dynamics.drawn import moving
from tests.mechanics.methods.test_by_hand import four_bar
from tests.numerics import EPS, largest
from tests.scenes import shipped


def given_at_ports(scene):
    """What a scene prescribes, by the outer ports of its system."""
    return {
        str(port): {"effort" if signal.effort else "flow": signal.value} for port, signal in scene_inputs(scene).items()
    }


@settings(max_examples=15)
@given(drawn=moving())
def test_a_system_has_the_linear_system_of_its_scene(drawn):
    """With heat, springs, loops, driven and prescribed joints, in motion; joints have the paths of their boxes."""
    scene, _, state, _ = drawn
    system, inputs = scene.system(), given_at_ports(scene)
    one = ephs.linearize(scene, state)
    states = ephs.dynamics(scene).states(state)
    two = ephs.linearize(system, {str(path): value for path, value in states.items()}, inputs=inputs)
    assert len(one.states) == len(two.states)
    size = max(largest(one.A, initial=0.0), 1.0)
    assert largest(one.A - two.A, initial=0.0) <= 1e3 * EPS * size * max(1, len(one.A))  # loops closed once more


def test_ports_of_joints_are_the_forces_on_them():
    _, system, poses, inputs = four_bar()
    found = ephs.linearize(system, poses, inputs=inputs)
    named = ephs.linearize(system, poses, inputs=["joints.main"])
    assert found.inputs == ("motor",) and named.inputs == ("joints.main",)
    assert largest(found.B - named.B) == 0.0 and np.array_equal(found.C, named.C)
    assert np.array_equal(found.D, [[0.0]])


def test_a_gap_of_a_system_is_named_by_its_joint():
    _, system, poses, inputs = four_bar()
    apart = poses | {"bars.rocker.pe.q": poses["bars.rocker.pe.q"] + np.eye(7)[6] * 0.01}
    with pytest.raises(ephs.AssemblyError, match=r"knee|pivot"):
        ephs.linearize(system, apart, inputs=inputs)


def test_a_voltage_drives_the_current_that_it_sees():
    """Of the coil b' = u − …, i = b/l, by hand-made attachments in all states of the system."""
    scene = shipped("motor-four-bar")
    states = ["motors.drive.coil.b", "bodies.rocker.pe.q", "bodies.crank.ke.p"]
    found = ephs.linearize(scene.system(), inputs=given_at_ports(scene), outputs=["voltages.drive", *states])
    assert found.inputs == ("voltages.drive",)
    coil = found.states.index("motors.drive.coil.b")
    size = largest(found.A)
    assert largest(found.B[:, 0] - np.eye(len(found.A))[coil]) <= 1e3 * EPS * size
    inductance = scene.motors["drive"].inductance
    assert largest(found.C[0] - np.eye(len(found.A))[coil] / inductance) <= 1e3 * EPS * size
    assert largest(found.D) <= 1e3 * EPS
    assert np.array_equal(found.C[1], np.eye(len(found.A))[coil])
    # What the states do to poses and momenta of bodies is what they do to them along the motion.
    model = ephs.dynamics(scene)
    jacobian = model.jacobian(model.state0, "rocker")
    free = [name.split(".")[1] for name in found.states if name.endswith(".rate")]
    assert free and largest(found.C[2:8, 0]) > 0.0
    column = jacobian @ np.concatenate([ephs.linearize(scene, outputs=[f"joints.{j}"]).C[:, 1] for j in model.freedoms])
    assert largest(found.C[2:8, 0] - column) <= 1e-12 * largest(column)


def test_what_has_no_place_in_joint_coordinates_is_refused_where_joints_could_open():
    text = "p: body_momentum; x: momentum; rod(p); rope(p, x); mass(p=x);"
    rope = ephs.transformer({"p": quantity.body_momentum, "x": quantity.momentum}, [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]])
    parts = {"rod": rigid_body(1.0, [1, 1, 1]), "rope": rope, "mass": ephs.library.point_mass(m=1.0)}
    loose = Pattern.from_text(text)(**parts)
    assert len(ephs.linearize(loose).states) == 12  # a free body: poses are independent
    held = Pattern.from_text(text + "ground: body_momentum; earth(p=ground); pin(p1=ground, p2=p)")(
        **parts, earth=components.ground(), pin=ephs.mechanics.joint("revolute")
    )
    with pytest.raises(ephs.OptionError, match=r"form='paper'"):
        ephs.linearize(held)
    assert len(ephs.linearize(held, form="paper").states) > 2
