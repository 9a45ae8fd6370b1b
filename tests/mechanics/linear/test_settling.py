"""Equilibria of systems: a scene's own system settles where the scene does, with joints closed."""

import numpy as np
import pytest

import ephs
from ephs.mechanics.elements.shell import statics
from ephs.solve.auditing.growth import apart
from examples.failing import scene
from tests.numerics import largest
from tests.written import scene_of_text

AXES = {
    "parallel": ([0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]),
    "skew": ([0.0, 1.0, 0.0], [0.5, 0.0, -0.8], [0.3, 1.0, 0.2]),
}


def chain(axes: str, held: int | None, free: int = 0, motion: str = "rate = 0.0") -> ephs.Scene:
    """Three rods in a row, far from hanging, with springs in the later hinges; one may be held, another one free."""
    parts = []
    for number, axis in enumerate(AXES[axes]):
        more = f"motion = {{ {motion} }}" if number == held else f"stiffness = {3.0 * number * (number != free)}"
        parts.append(f"""
    [bodies.rod{number}]
    mass = {1.0 + number}
    inertia = [0.02, 0.1, 0.1]
    position = [{number + 0.5}, 0.0, {0.1 * number}]
    [joints.hinge{number}]
    type = "revolute"
    bodies = ["{f"rod{number - 1}" if number else "ground"}", "rod{number}"]
    at = [{number}, 0.0, 0.0]
    axis = {axis}
    {more}
    """)
    return scene("[assembly]\nadjust = true\n" + "".join(parts))


@pytest.mark.parametrize("held", [None, 1, 2])
@pytest.mark.parametrize("axes", list(AXES))
def test_a_scenes_system_settles_where_the_scene_does(axes, held):
    """Steps of whole turns solve the equations of long steps, too, and steps along rates open joints."""
    model = chain(axes, held)
    system = model.system()
    inputs = {str(port): {"effort": [0.0]} for port in system.interface}
    assert len(inputs) == (held is not None)
    settled, rest = ephs.equilibrium(system, inputs=inputs), ephs.equilibrium(model)
    poses = [path for path in rest.states if str(path).endswith(".pe.q")]
    assert len(poses) == 3
    for path in poses:
        assert apart(settled.states[path], rest.states[path], 3.0) < 1e-9
    end = ephs.simulate(system, 0.5, initial=settled.states, inputs=inputs, rtol=1e-9, atol=1e-9)
    assert end.constraint_error.max() < 1e-8
    for path in poses:
        assert largest(end.states[path] - settled.states[path]) < 1e-7


def test_a_joint_whose_motion_is_prescribed_is_free_in_a_system_without_it():
    loose, rest = ephs.equilibrium(chain("skew", 2).system()), ephs.equilibrium(chain("skew", None, 2))
    for path in (path for path in rest.states if str(path).endswith(".pe.q")):
        assert apart(loose.states[path], rest.states[path], 3.0) < 1e-9


@pytest.mark.parametrize("motion", ["rate = 2.0", "polynomial = [0.0, 1.0]", "polynomial = [2.0, -1.0]"])
def test_a_joint_that_is_moved_within_the_first_second_has_no_equilibrium(motion):
    """Also one that is at rest at the beginning of it, or at the end."""
    with pytest.raises(ephs.SimulationError, match=r"joints\.hinge1.*its motion is prescribed"):
        ephs.equilibrium(chain("parallel", 1, motion=motion))


def weighed(sheet):
    """The shell of a sheet that is held at x = 0, its weight, and what is free to move."""
    made = next(each for _, each in sheet.all_shells()).shell()
    free = np.ones((len(made.points), 6), dtype=bool)
    free[made.points[:, 0] == 0.0] = False
    load = np.zeros((len(made.points), 6))
    load[:, 5] = made.shares(-9.81 * 900.0 * 4e-3 * made.areas)
    return made, load, free


def test_a_stiff_sheets_system_settles_where_the_sheet_does():
    """Rounding of membrane forces is large beside the size of its states: forces are measured by forces."""
    sheet = scene_of_text("""
        format = 1
        [shells.sheet]
        corners = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.1, 0.0], [0.0, 0.1, 0.0]]
        elements = [3, 1]
        thickness = 4e-3
        E = 2e9
        nu = 0.3
        rho = 900.0
        damping = 2e-3
        edges = ["free", "free", "free", "ground"]
        """)
    rest, settled = ephs.equilibrium(sheet), ephs.equilibrium(sheet.system())
    for path, value in rest.states.items():
        assert largest(settled.states[path] - value) <= 1e-14  # rounding: lengths of models differ, as metrics
    made, load, free = weighed(sheet)
    poses, _ = statics.equilibrium(made, load, free)
    tip = rest.states[ephs.Path.of("shells.sheet.node7.pe.q")]
    np.testing.assert_allclose(tip[4:], poses[7, 4:], atol=1e-9)


@pytest.mark.parametrize(("young", "across"), [(2e6, 1), (4e5, 2)])
def test_a_sheet_that_hangs_rests_where_growing_parts_of_its_weight_lead_it(young, across):
    """It sags by 0.9 of its length; forces that hold its start are let go."""
    sheet = scene(f"""
        [shells.sheet]
        corners = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.2, 0.0], [0.0, 0.2, 0.0]]
        elements = [3, {across}]
        thickness = 4e-3
        E = {young}
        nu = 0.3
        rho = 900.0
        edges = ["free", "free", "free", "ground"]
        """)
    rest = ephs.equilibrium(sheet)
    made, load, free = weighed(sheet)
    poses = made.poses
    for share in np.linspace(0.0, 1.0, 41)[1:] ** 2:
        poses, _ = statics.equilibrium(made, share * load, free, poses)
    for i in np.flatnonzero(free.any(axis=1)):
        pose = rest.states[ephs.Path.of(f"shells.sheet.node{i}.pe.q")]
        np.testing.assert_allclose(pose[4:], poses[i, 4:], atol=1e-8)
    assert poses[:, 6].min() < -0.25
    # the scene is at rest there, its nodes included
    assert ephs.linearize(rest.model).structure is not None
    again = ephs.equilibrium(rest.model)
    assert again.steps <= 1
