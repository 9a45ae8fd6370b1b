"""What `reduce` says: groups, loops, redundancy and cyclic coordinates against independent computations of each."""

import numpy as np
import pytest
from hypothesis import assume, given, settings

import ephs
from benchmarks.cases import CASES
from ephs import library
from ephs.mechanics.rewrite import coordinates
from ephs.mechanics.rewrite.rewrite import Strength
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.build import component_path, initial_state
from ephs.mechanics.scene.geometry import coupling_of
from ephs.mechanics.tree.finding.mechanism import reduce_system
from ephs.semantics.spaces import SE3
from ephs.solve.equations.mobility import mobility
from ephs.testing import mechanisms
from tests.numerics import generators, largest
from tests.scenes import SCENES, model_of, of_all_scenes, shipped
from tests.typed import typed
from tests.written import scene_of_text

BY_NAME = {case.name: case for case in CASES}


def reduced_of(scene):
    problem = problem_of_scene(scene)
    return reduce_system(problem, model_of(problem))


def scene_of(text):
    return scene_of_text("format = 1\nname = 'scene'\n" + text)


def named(reduction, name):
    return next(step for step in reduction.steps if step.name == name)


# ---- groups ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stem", "words"),
    [
        ("four-bar", "SE(2) (dimension 3) with the normal (0, 0, 1)"),
        ("heavy-top", "SO(3) (dimension 3) about the point (0, 0, 0)"),
    ],
)
def test_the_group_of_a_motion_is_named(stem, words):
    step = named(ephs.reduce(shipped(stem)), "the group of the motion")
    assert words in step.reason
    assert step.strength == Strength.TRAJECTORIES


SLIDES = """
[bodies.a]
mass = 1.0
inertia = [1.0, 1.0, 1.0]
[bodies.b]
mass = 1.0
inertia = [1.0, 1.0, 1.0]
[joints.one]
type = "prismatic"
bodies = ["ground", "a"]
at = [0.0, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
[joints.two]
type = "{kind}"
bodies = ["a", "b"]
at = [0.0, 0.0, 1.0]
axis = [0.0, 1.0, 0.0]
"""


@pytest.mark.parametrize(
    ("kind", "name"), [("prismatic", "ℝ²"), ("revolute", "SE(2)"), ("cylindrical", "SE(2)×ℝ"), ("spherical", "SE(3)")]
)
def test_slides_and_pins_make_the_groups_that_they_generate(kind, name):
    (part,) = coordinates.mechanisms(reduced_of(scene_of(SLIDES.format(kind=kind))))
    assert part.group.name == name
    assert part.bodies == ("a", "b")


@settings(max_examples=15)
@given(scene=mechanisms(max_bodies=3))
def test_bodies_never_leave_the_group_of_their_mechanism(scene):
    """Displacements from the start are in it: the logarithm of q q⁰⁻¹, where it is short, lies in the algebra."""
    found = coordinates.mechanisms(reduced_of(scene))
    solution = ephs.simulate(scene, 0.05, method="natural", step=0.01)
    for part in found:
        for name in part.bodies:
            poses = solution[component_path("bodies", name) / "pe" / "q"]
            twist = SE3.log(SE3.compose(poses[-1], SE3.inverse(poses[0])))
            outside = twist - part.group.basis @ (part.group.basis.T @ twist)
            assert largest(outside) <= 1e-10 * max(1.0, largest(twist))


# ---- loops and redundancy ----------------------------------------------------------------------------------------


def check_rank(scene):
    """The tree's freedoms that the loops' equations leave are the motions that the paper's constraints leave."""
    problem, reduced = problem_of_scene(scene), reduced_of(scene)
    found = mobility(problem.descriptor, problem.descriptor.pack(problem.initial))
    assert reduced.freedoms - coordinates._rank(reduced, coordinates.loops(reduced)) == found.mobility
    steps = list(coordinates.coordinate_steps(scene, problem, 1000))
    unknowns = next((s for s in steps if s.name == "loops closed within their groups"), steps[0]).after
    assert unknowns == 2 * reduced.freedoms + sum(loop.rows for loop in coordinates.loops(reduced))
    assert unknowns == reduced.unknowns
    return steps


@of_all_scenes
def test_loops_impose_all_that_they_did(file):
    scene = ephs.load(file)
    if not any(
        section == "motors" for section, _, _ in scene.all_attachments()
    ):  # whose currents are motions that no joint has
        check_rank(scene)


@settings(max_examples=25)
@given(scene=mechanisms(max_bodies=3))
def test_so_they_do_in_generated_mechanisms(scene):
    check_rank(scene)


def test_the_squeezer_closes_three_loops_with_two_equations_each():
    steps = check_rank(BY_NAME["andrews-squeezer"].scene())
    loop = next(step for step in steps if step.name == "loops closed within their groups")
    assert loop.before - loop.after == 9
    assert loop.reason.count("imposes 2 in place of 5") == 3
    assert not any(step.name == "redundant constraints" for step in steps)


def test_what_no_group_explains_is_found_by_rank():
    """Both ends of the shafts of a universal joint are held: turning about them closes only where they meet."""
    scene = shipped("universal")
    reduced = reduced_of(scene)
    step = named(ephs.reduce(scene), "redundant constraints")
    (loop,) = coordinates.loops(reduced)
    assert step.before - step.after == loop.rows - coordinates._rank(reduced, (loop,))
    assert "output repeats" in step.reason
    assert step.strength == Strength.MOTION


# ---- cyclic coordinates -------------------------------------------------------------------------------------------


def count(scene):
    reduced = reduced_of(scene)
    return sum(coordinates.cyclic(reduced, part).dim for part in coordinates.mechanisms(reduced))


TOP = """
[world]
gravity = {gravity}
[bodies.top]
mass = 1.0
inertia = [1.0, 1.0, 1.0]
position = [0.0, 0.0, 1.0]
{joint}
"""
PIVOT = """
[joints.tip]
type = "{kind}"
bodies = ["ground", "top"]
at = [0.0, 0.0, 0.0]
axis = {axis}
{more}
"""
UP, ACROSS, TILTED = "[0.0, 0.0, 1.0]", "[1.0, 0.0, 0.0]", "[0.6, 0.0, 0.8]"


@pytest.mark.parametrize(
    ("gravity", "kind", "axis", "more", "expected"),
    [
        ("[0.0, 0.0, 0.0]", None, UP, "", 6),
        ("[0.0, 0.0, -9.81]", None, UP, "", 3),
        ("[0.0, 0.0, -9.81]", "spherical", UP, "", 1),
        ("[0.0, 0.0, 0.0]", "spherical", UP, "", 3),
        ("[0.0, 0.0, -9.81]", "revolute", UP, "", 1),
        ("[0.0, 0.0, -9.81]", "revolute", TILTED, "", 0),
        ("[0.0, 0.0, -9.81]", "prismatic", ACROSS, "", 1),
        ("[0.0, 0.0, -9.81]", "prismatic", UP, "", 0),
        ("[0.0, 0.0, -9.81]", "cylindrical", UP, "", 1),
        ("[0.0, 0.0, -9.81]", "planar", UP, "", 3),
        ("[0.0, 0.0, -9.81]", "planar", ACROSS, "", 1),
        ("[0.0, 0.0, -9.81]", "screw", UP, "pitch = 0.1", 0),
        ("[0.0, 0.0, 0.0]", "screw", UP, "pitch = 0.1", 1),
        ("[0.0, 0.0, -9.81]", "revolute", UP, "stiffness = 2.0", 0),
        ("[0.0, 0.0, -9.81]", "revolute", UP, "friction = 2.0", 1),
    ],
)
def test_cyclic_coordinates_of_one_joint(gravity, kind, axis, more, expected):
    joint = "" if kind is None else PIVOT.format(kind=kind, axis=axis, more=more)
    assert count(scene_of(TOP.format(gravity=gravity, joint=joint))) == expected


@pytest.mark.parametrize(
    ("gravity", "kind", "axis", "more", "expected"),
    [
        ("[0.0, 0.0, 0.0]", None, UP, "", [1] * 6),
        ("[0.0, 0.0, -9.81]", None, UP, "", [0] * 6),
        ("[0.0, 0.0, 0.0]", "spherical", UP, "", [1] * 3),
        ("[0.0, 0.0, -9.81]", "spherical", UP, "", [0] * 3),
        ("[0.0, 0.0, -9.81]", "revolute", UP, "", [1]),
        ("[0.0, 0.0, -9.81]", "revolute", ACROSS, "", [0]),
        ("[0.0, 0.0, -9.81]", "planar", UP, "", [1] * 3),
        ("[0.0, 0.0, -9.81]", "revolute", UP, "stiffness = 2.0", [0]),
    ],
)
def test_jacobians_leave_out_joints_that_only_move_what_nothing_reads(gravity, kind, axis, more, expected):
    joint = "" if kind is None else PIVOT.format(kind=kind, axis=axis, more=more)
    scene = scene_of(TOP.format(gravity=gravity, joint=joint))
    assert coordinates.unread(reduced_of(scene)).tolist() == expected


def test_a_spring_to_the_ground_and_a_loop_read_where_a_mechanism_is():
    joint = PIVOT.format(kind="spherical", axis=UP, more="")
    spring = "[springs.s]\nbodies = ['ground', 'top']\nat1 = [1.0, 0.0, 0.0]\nat2 = [0.0, 0.2, 0.0]\nstiffness = 1.0\n"
    assert count(scene_of(TOP.format(gravity="[0.0, 0.0, -9.81]", joint=joint + spring))) == 0
    assert count(shipped("four-bar")) == 0


@settings(max_examples=20)
@given(scene=mechanisms(max_bodies=3, loops=False, springs=False, heat=False), rng=generators)
def test_moving_along_cyclic_coordinates_changes_nothing_else(scene, rng):
    """Started elsewhere along them, momenta and all other coordinates go as before."""
    reduced = reduced_of(scene)
    changed = {str(path): value for path, value in initial_state(scene).items()}
    shifted = set()
    for part in coordinates.mechanisms(reduced):
        group = coordinates.cyclic(reduced, part)
        if not group.dim:
            continue
        move = SE3.exp(group.basis @ (0.5 * rng.standard_normal(group.dim)))
        for name in part.bodies:
            path = str(component_path("bodies", name) / "pe" / "q")
            changed[path] = SE3.compose(move, changed[path])
            shifted.add(path)
        for i in part.edges:
            edge = reduced.edges[i]
            if edge.path is None or min(edge.body1, edge.body2) >= 0 or edge.pair.dim == 0:
                continue
            (joint,) = [j for n, j in scene.all_joints() if n == edge.name]
            assume(joint.middle is None and joint.body1 == "ground")
            path = str(edge.path / "pe" / "q_r")
            of = coupling_of(joint)
            frame = np.array(joint.frame1)
            turned = SE3.compose(SE3.compose(SE3.inverse(frame), SE3.compose(move, frame)), of.include(changed[path]))
            changed[path] = of.fit(turned, changed[path])
            shifted.add(path)
    assume(shifted)
    one, other = (ephs.simulate(scene, 0.02, method="natural", step=2e-3, initial=x) for x in (None, changed))
    assert one.stats["cut_steps"] == other.stats["cut_steps"] == 0
    for path in one:
        if str(path) not in shifted:
            assert largest(one[path] - other[path], initial=0.0) <= 1e-9 * max(1.0, largest(one[path], initial=0.0)), (
                path
            )


# ---- the whole ----------------------------------------------------------------------------------------------------


TWO = """
[bodies.a]
mass = 1.0
inertia = [1.0, 1.0, 1.0]
[bodies.b]
mass = 1.0
inertia = [1.0, 1.0, 1.0]
[joints.one]
type = "revolute"
bodies = ["ground", "a"]
at = [0.0, 0.0, 1.0]
axis = [1.0, 0.0, 0.0]
friction = 0.1
heat = "warm"
[joints.two]
type = "spherical"
bodies = ["ground", "b"]
at = [0.0, 1.0, 1.0]
friction = 0.1
heat = "warm"
[thermal.warm]
capacity = 10.0
temperature = 300.0
"""


def test_mechanisms_that_share_ground_and_heat_only_are_separate():
    step = named(ephs.reduce(scene_of(TWO)), "separate mechanisms")
    assert step.where == ("a", "b")
    assert "2 mechanisms of 1 to 3 degrees of freedom" in step.reason


@of_all_scenes
def test_each_step_begins_where_the_last_one_ended(file):
    scene = ephs.load(file)
    found = ephs.reduce(scene)
    assert found.before == ephs.simulate(scene, 1e-4, method="natural", step=1e-4, form="paper").stats["unknowns"]
    for one, other in zip(found.steps, found.steps[1:], strict=False):
        assert one.after == other.before
        assert one.after <= one.before
    text = str(found)
    for step in found.steps:
        assert step.name in text
        assert step.reason.split()[0] in text
        assert f"{step.before} → {step.after}" in text


def test_systems_are_reduced_as_far_as_systems_go():
    found = ephs.reduce(_levers())
    assert found.steps[0].name == "fold a transformer"
    assert found.after < found.before


def _levers():
    ports = {"x": ephs.quantity.momentum, "y": ephs.quantity.momentum}
    pattern = ephs.Pattern.from_text("a: momentum; b: momentum; mass(p=a); lever(x=a, y=b); rod(x=b)")
    hold = ephs.constraint({"x": ephs.quantity.momentum}, [[1.0]])
    return pattern(mass=library.point_mass(m=1.0), lever=ephs.transformer(ports, [[2.0]]), rod=hold)


def test_the_command_prints_the_table(capsys):
    assert typed(f"reduce {SCENES[0].parent / 'four-bar.toml'}") == 0
    out = capsys.readouterr().out
    assert "224 unknowns" in out
    assert "joints.main.o1" in out
    assert "knee imposes 2 in place of 5" in out
    assert typed("reduce nothing.toml") == 2
