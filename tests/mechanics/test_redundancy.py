"""Which constraints depend on which: by name in known mechanisms, by count and span in any."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

import ephs
from ephs.mechanics.constraints.holding import ConfiguredMechanism
from ephs.mechanics.constraints.redundancy import dependences, explain, indeterminate, wrenches_in_words
from ephs.mechanics.runs.check import check_model
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.scene.build import component_path, scene_inputs
from ephs.mechanics.scene.geometry import coupling_of
from ephs.mechanics.scene.model import GROUND
from ephs.semantics.spaces import SE3
from ephs.solve.equations.instant import instant
from ephs.solve.equations.mobility import mobility
from ephs.testing import mechanisms
from tests.scenes import ROOT, shipped
from tests.written import scene_of_text

SHIPPED = sorted([*(ROOT / "scenes").glob("*.toml"), *(ROOT / "benchmarks" / "scenes").glob("*.toml")])
# Redundancy is searched in whole mechanisms, by singular values: what Hypothesis deems slow is meant here.
calm = settings(suppress_health_check=[HealthCheck.too_slow])
Z = (0.0, 0.0, 1.0)
HEAD = 'format = 1\nname = "test"\n[world]\ngravity = [0.0, 0.0, -9.81]\n'


def body(name, *position):
    return f"[bodies.{name}]\nmass = 1.0\ninertia = [0.1, 0.1, 0.1]\nposition = {list(map(float, position))}\n"


def joint(name, kind, first, second, at, axis=Z, extra=""):
    axis = "" if kind == "spherical" else f"axis = {list(map(float, axis))}\n"
    at = list(map(float, at))
    return f'[joints.{name}]\ntype = "{kind}"\nbodies = ["{first}", "{second}"]\nat = {at}\n{axis}{extra}'


def door(*joints):
    return body("door", 0.4, 0, 1) + "".join(joints)


def hinges(count, axis=Z):
    along = np.array(axis)
    return [joint(f"hinge_{i}", "revolute", "ground", "door", 0.3 * i * along, axis) for i in range(1, count + 1)]


def planar_loop(*corners, pairs=("revolute",) * 4):
    """Three bars and the ground, from corner to corner."""
    names = ["ground", "a", "b", "c", "ground"]
    ends = [np.array([*corner, 0.0]) for corner in corners]
    bodies = [body(name, *(0.5 * (p + q))) for name, p, q in zip(names[1:4], ends, ends[1:], strict=False)]
    joints = [joint(f"j{i}", pair, names[i], names[i + 1], ends[i]) for i, pair in enumerate(pairs)]
    return "".join([*bodies, *joints])


@pytest.fixture
def scene():
    def from_text(text):
        return scene_of_text(HEAD + text)

    return from_text


def counted(scene):
    problem = problem_of_scene(scene)
    return mobility(problem.descriptor, problem.descriptor.pack(problem.initial), problem.prescribed).redundant


# ---- an independent count: rows by hand, in body frames, of full joint matrices and least squares -------------------


def rows_by_hand(scene, name):
    """(6 - d, 6 n) rows of a joint on the bodies' twists, and its wrenches (6 - d, 6) about the world's origin."""
    j = scene.joint(name)
    bodies = [each for each, _ in scene.all_bodies()]
    pose = {each: b.pose for each, b in scene.all_bodies()} | {GROUND: SE3.identity()}
    basis = coupling_of(j).basis(np.asarray(j.coordinate))
    u, sigma, _ = np.linalg.svd(basis, full_matrices=True)
    forbidden = u[:, int(np.sum(sigma > 1e-9)) :].T
    c2 = SE3.compose(pose[j.body2], j.frame2)
    rows = np.zeros((len(forbidden), 6 * len(bodies)))
    for sign, name_of in ((-1.0, j.body1), (1.0, j.body2)):
        if name_of != GROUND:
            i = 6 * bodies.index(name_of)
            to_joint = SE3.adjoint(SE3.compose(SE3.inverse(c2), pose[name_of]))
            rows[:, i : i + 6] += sign * forbidden @ to_joint
    return rows, forbidden @ SE3.adjoint(SE3.inverse(c2))


def row_of(scene, name, wrench):
    """(6 n,) what a wrench between the joint's bodies does to their twists."""
    j = scene.joint(name)
    bodies = list(scene.all_bodies())
    out = np.zeros((len(bodies), 6))
    for i, (each, b) in enumerate(bodies):
        sign = float(each == j.body2) - float(each == j.body1)
        out[i] = sign * SE3.adjoint(b.pose).T @ wrench
    return out.ravel()


def outside(row, rows):
    """How much of a row lies outside the span of others."""
    rows = rows[np.linalg.norm(rows, axis=1) > 0.0]
    rows = rows / np.linalg.norm(rows, axis=1)[:, None]
    _, sigma, vt = np.linalg.svd(rows)
    kept = vt[: int(np.sum(sigma > 1e-8 * sigma[0]))]
    row = row / np.linalg.norm(row)
    return np.linalg.norm(row - kept.T @ (kept @ row))


def agrees(scene):
    """All that is said of a scene without prescribed motions, held against rows by hand."""
    found = dependences(ConfiguredMechanism.of(scene))
    names = [name for name, _ in scene.all_joints()]
    rows = {name: rows_by_hand(scene, name) for name in names}
    total = np.vstack([np.zeros((0, 6 * len(dict(scene.all_bodies())))), *(rows[name][0] for name in names)])
    count = len(total) - (np.linalg.matrix_rank(total, tol=1e-8) if total.size else 0)
    assert sum(len(each.directions) for each in found) == count == counted(scene)
    for each in found:
        own = rows[each.joint][1]
        named = np.array([d.wrench for d in each.directions])
        assert np.linalg.matrix_rank(named, tol=1e-6) == len(named)
        before = np.vstack([rows[name][0] for name in each.on])
        assert all(names.index(name) < names.index(each.joint) for name in each.on)
        for d in each.directions:
            assert outside(d.wrench, own) < 1e-5  # the joint holds it
            assert outside(row_of(scene, each.joint, d.wrench), before) < 1e-5  # so do the others, together
        for left_out in each.on:  # and none of them can be spared
            fewer = [rows[name][0] for name in each.on if name != left_out]
            spared = [outside(row_of(scene, each.joint, d.wrench), np.vstack(fewer)) for d in each.directions if fewer]
            assert not fewer or max(spared) > 1e-6


def agrees_on_wrenches(scene):
    """What is called indeterminate is what an instant's equations leave open."""
    problem = problem_of_scene(scene)
    d = problem.descriptor
    now = instant(d, problem.reference, d.pack(problem.initial), problem.inputs(0.0, problem.initial))
    for name, free in indeterminate(ConfiguredMechanism.of(scene)).items():
        at = component_path("joints", name)
        box = at / "second" / "hc" if scene.joint(name).middle is not None else at / "hc"
        assert np.array_equal(np.isnan(now.multiplier(box)), free), name


# ---- known mechanisms -----------------------------------------------------------------------------------------------


HINGED = "translation along x, y and z, rotation about x and y"
FLAT = "translation along z, rotation about x and y"
SLANTED = (0.0, 0.6, 0.8)
KNOWN = {
    "door on two hinges": (door(*hinges(2)), [f"hinge_2 repeats hinge_1: {HINGED}"]),
    "slanted door": (door(*hinges(2, SLANTED)), [f"hinge_2 repeats hinge_1: {HINGED} (joint axes)"]),
    "door on five hinges": (door(*hinges(5)), [f"hinge_{i} repeats hinge_1: {HINGED}" for i in range(2, 6)]),
    "hinge, ball": (
        door(*hinges(1), joint("ball", "spherical", "ground", "door", (0, 0, 2))),
        ["ball repeats hinge_1: translation along x, y and z"],
    ),
    "ball, hinge": (
        door(joint("ball", "spherical", "ground", "door", (0, 0, 2)), *hinges(1)),
        ["hinge_1 repeats ball: translation along x, y and z at ball"],
    ),
    "hinge, ball beside the axis": (
        door(*hinges(1), joint("ball", "spherical", "ground", "door", (0.5, 0, 2))),
        ["ball repeats hinge_1: translation along x and z"],
    ),
    "hinge after less": (
        door(joint("ball", "spherical", "ground", "door", (0, 0, 2)), *hinges(2)),
        ["hinge_1 repeats ball: translation along x, y and z at ball", f"hinge_2 repeats hinge_1: {HINGED}"],
    ),
    "two balls": (
        door(*(joint(f"ball_{i}", "spherical", "ground", "door", 0.5 * i * np.array(SLANTED)) for i in (1, 2))),
        ["ball_2 repeats ball_1: translation along (0, 0.6, 0.8)"],
    ),
    "parallel guides": (
        door(*(joint(f"guide_{i}", "prismatic", "ground", "door", (0, i, 0), (1, 0, 0)) for i in (1, 2))),
        ["guide_2 repeats guide_1: translation along y and z, rotation about x, y and z"],
    ),
    "two screws": (
        door(*(joint(f"s{i}", "screw", "ground", "door", (0, 0, i), Z, "pitch = 0.1\n") for i in (1, 2))),
        [
            "s2 repeats s1: translation along x and y, rotation about x and y, translation along z in step with "
            "rotation about z"
        ],
    ),
    "welded twice": (
        door(*(joint(f"weld_{i}", "fixed", "ground", "door", (i, 0, 0)) for i in (1, 2))),
        ["weld_2 repeats weld_1: translation along x, y and z, rotation about x, y and z"],
    ),
    "the shorter loop of two": (
        door(
            body("step", 0, 0, 0),
            joint("step_1", "fixed", "ground", "step", (0, 0, 0)),
            joint("step_2", "fixed", "step", "door", (0, 0, 0)),
            *(joint(f"weld_{i}", "fixed", "ground", "door", (i, 0, 0)) for i in (1, 2)),
        ),
        [
            "weld_1 repeats step_1 and step_2: translation along x, y and z, rotation about x, y and z",
            "weld_2 repeats weld_1: translation along x, y and z, rotation about x, y and z",
        ],
    ),
    "four-bar": (
        planar_loop((0.0, 0.0), (0.1, 1.0), (1.2, 1.3), (1.0, 0.1)),
        [f"j3 repeats j0, j1 and j2: {FLAT}"],
    ),
    "afloat": (
        body("a", 0, 0, 0)
        + body("b", 1, 0, 0)
        + body("c", 0, 1, 0)
        + joint("ab", "revolute", "a", "b", (0.5, 0, 0))
        + joint("bc", "revolute", "b", "c", (0.5, 0.5, 0))
        + joint("ac", "revolute", "a", "c", (0, 0.5, 0)),
        [f"ac repeats ab and bc: {FLAT}"],
    ),
    # the cranks hold the coupler by the forces through the intersection of their lines, (1, 2): one is along y
    "four-bar held by a guide": (
        planar_loop((0.0, 0.0), (0.5, 1.0), (1.5, 1.0), (2.0, 0.0))
        + joint("guide", "prismatic", "ground", "b", (1.2, 1.0, 0.0), (1, 0, 0)),
        [
            f"j3 repeats j0, j1 and j2: {FLAT}",
            f"guide repeats j0, j1, j2 and j3: {FLAT}, translation along y at the point (1, 1, 0)",
        ],
    ),
    "four-bar without redundancy": (
        planar_loop(
            (0.0, 0.0),
            (0.1, 1.0),
            (1.2, 1.3),
            (1.0, 0.1),
            pairs=("revolute", "spherical", "cylindrical", "revolute"),
        ),
        [],
    ),
    "stretched four-bar": (
        planar_loop((0.0, 0.0), (1.0, 0.0), (2.5, 0.0), (1.5, 0.0)),
        [f"j3 repeats j0, j1 and j2: {FLAT}, in this configuration translation along x too"],
    ),
    "a motion prescribed twice": (
        door(*(joint(f"h{i}", "revolute", "ground", "door", (0, 0, i), Z, "motion = { rate = 0 }\n") for i in (1, 2))),
        [f"h2 repeats h1: {HINGED}", "the motion of h2 repeats the motion of h1: rotation about z"],
    ),
    "shipped four-bar": ("four-bar", [f"pivot repeats main, pin and knee: {FLAT}"]),
    "slider-crank": ("slider-crank", []),
    "chain": ("chain", []),
    "universal": ("universal", ["output repeats input and cross: translation along x and y at cross (joint axes)"]),
}


@pytest.mark.parametrize("case", KNOWN)
def test_known_mechanisms_are_described(case, scene):
    text, expected = KNOWN[case]
    found = scene(text) if "\n" in text else shipped(text)
    assert [str(each) for each in dependences(ConfiguredMechanism.of(found))] == expected
    assert sum(len(each.directions) for each in dependences(ConfiguredMechanism.of(found))) == counted(found)
    if "motion" not in case:
        agrees(found)
    agrees_on_wrenches(found)


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_shipped_scenes_are_described(file):
    agrees(ephs.load(file))
    agrees_on_wrenches(ephs.load(file))


def test_a_row_of_windows_repeats_window_by_window(scene):
    """Each window's last joint depends on its own window, not on all that stand before."""
    text = ""
    for i in range(4):
        text += body(f"crank{i}", i, 0.5, 0) + joint(f"foot{i}", "revolute", "ground", f"crank{i}", (i, 0, 0))
        if i:
            text += body(f"rod{i}", i - 0.5, 1, 0)
            text += joint(f"left{i}", "revolute", f"crank{i - 1}", f"rod{i}", (i - 1, 1, 0))
            text += joint(f"right{i}", "revolute", f"rod{i}", f"crank{i}", (i, 1, 0))
    found = dependences(ConfiguredMechanism.of(scene(text)))
    assert [(each.joint, each.on) for each in found] == [
        (f"right{i}", (f"foot{i - 1}", f"foot{i}", f"left{i}")) for i in (1, 2, 3)
    ]


def test_texts_are_grouped_and_shortened(scene):
    text = explain(scene(door(*hinges(9))))
    assert text == (
        "40 constraint equations depend on others (in world axes): hinge_2, hinge_3, hinge_4, hinge_5, hinge_6 and 3 "
        f"more each repeat hinge_1: {HINGED}"
    )
    assert explain(shipped("chain")) == ""
    balls = "".join(
        body(f"b{i}", i, 0, 0)
        + joint(f"p{i}", "spherical", "ground", f"b{i}", (i, 0, 0))
        + joint(f"q{i}", "spherical", "ground", f"b{i}", (i, 0, 1))
        for i in range(6)
    )
    assert explain(scene(balls)).endswith("q2 repeats p2: translation along z; and 3 more")
    assert explain(scene(door(*hinges(2, SLANTED)))).startswith("5 constraint equations depend on others: hinge_2")


def test_wrenches_are_told_apart(scene):
    found = scene(door(*hinges(2)) + body("bell", 0.4, 0, 0) + joint("hook", "spherical", "door", "bell", (0.4, 0, 1)))
    assert wrenches_in_words(indeterminate(ConfiguredMechanism.of(found))) == (
        "hinge_1 and hinge_2: force along x, y and z, moment about x and y indeterminate (joint axes); "
        "unique in the other joint"
    )
    sol = ephs.simulate(found, 0.01, step=0.01)
    for name, free in indeterminate(ConfiguredMechanism.of(found)).items():
        assert np.array_equal(np.isnan(sol.joint(name).wrench[0]), free)
    chain = shipped("chain")
    assert wrenches_in_words(indeterminate(ConfiguredMechanism.of(chain))) == "unique in every joint"
    assert wrenches_in_words(indeterminate(ConfiguredMechanism.of(replace(chain, joints={})))) == "no joints"


def test_a_check_says_what_repeats_what(scene):
    items = {name: detail for name, _, detail in check_model(shipped("four-bar")).items}
    assert items["mobility"] == "1 independent motion in this configuration"
    assert items["redundant constraints"] == (
        f"3 constraint equations depend on others (in world axes): pivot repeats main, pin and knee: {FLAT}; "
        "the motion is still unique"
    )
    assert items["joint wrenches"] == (
        "main, pin, knee and pivot: force along z, moment about x and y indeterminate (joint axes)"
    )
    items = {name: detail for name, _, detail in check_model(shipped("chain")).items}
    assert (items["redundant constraints"], items["joint wrenches"]) == ("none", "unique in every joint")


# ---- any mechanism --------------------------------------------------------------------------------------------------


@settings(calm, max_examples=30)
@given(mechanisms())
def test_any_mechanism_is_described(scene):
    """The directions named are as many as the system's own equations have dependences.

    These count more equations, for the joint frames, the rates u_r and the ground, and each such equation has an effort
    of its own: it adds to the rows and to the rank alike. Left null vectors are the same, wrenches that balance.
    """
    agrees(scene)
    agrees_on_wrenches(scene)


@settings(calm, max_examples=20)
@given(mechanisms(loops=False, springs=False))
def test_a_joint_doubled_repeats_itself(scene):
    """A copy of any joint at the same place says nothing new, in all that it holds, however it lies in space."""
    name, of = list(scene.joints.items())[-1]
    twice = replace(scene, joints=scene.joints | {"copy": replace(of, name="copy")})
    found = dependences(ConfiguredMechanism.of(twice))
    holds = 6 - of.dim
    assert [each.joint for each in found] == (["copy"] if holds else [])
    if found:
        assert found[0].on == (name,)
        assert len(found[0].directions) == holds
        if of.kind not in ("screw", "universal"):  # a screw couples two directions, a cross has axes askew
            assert all(np.count_nonzero([*d.moment, *d.force]) == 1 for d in found[0].directions)
    agrees(twice)


@pytest.mark.parametrize("name", ["four-bar", "bricard", "cardan-shaft", "n-four-bar"])
def test_a_system_repeats_what_its_scene_does(name):
    """In the same words, but for the paths of boxes."""
    scene = shipped(name)
    inputs = {
        str(port): {"effort" if signal.effort else "flow": signal.value} for port, signal in scene_inputs(scene).items()
    }
    of, own = problem_of_system(scene.system(), None, inputs).constraints(), ConfiguredMechanism.of(scene)
    assert [str(each).replace("joints.", "") for each in dependences(of)] == [str(each) for each in dependences(own)]
    here, there = indeterminate(of), indeterminate(own)
    assert [joint.removeprefix("joints.") for joint in here] == list(there)
    told = [{name: detail for name, _, detail in check_model(model).items} for model in (scene, scene.system())]
    for what in ("mobility", "redundant constraints", "joint wrenches"):
        assert told[1][what].replace("joints.", "") == told[0][what]
    assert all(np.array_equal(*each) for each in zip(here.values(), there.values(), strict=True))
