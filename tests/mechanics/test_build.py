"""Scenes as systems: their names, what parts expose, heat, ground, and drives."""

from dataclasses import replace
from pathlib import Path as File

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings

import ephs
from ephs.mechanics.runs.check import check_model
from ephs.mechanics.runs.simulate import problem_of_scene
from ephs.mechanics.scene.build import (
    component_path,
    drive_ports,
    initial_state,
    scene_inputs,
    scene_system,
    wrench_port,
)
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from ephs.operad import Path
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.solve.instant import instant, mobility
from ephs.testing import mechanisms

ROOT = File(__file__).parents[2]
# Mechanisms are large, and each is solved: what Hypothesis deems slow and large is meant here.
calm = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])

LEG = """format = 1
[bodies.shank]
mass = 1.0
inertia = [0.1, 0.1, 0.02]
position = [0.0, 0.0, -0.5]
[joints.knee]
type = "revolute"
bodies = ["ground", "shank"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
friction = 0.1
heat = "grease"
drive = 0.2
[thermal.grease]
capacity = 5.0
temperature = 300.0
[conduction.air]
between = ["grease", "environment"]
conductance = 0.3
"""
WHOLE = """format = 1
[bodies.foot]
mass = 0.5
inertia = [0.01, 0.01, 0.01]
position = [0.0, 0.0, -1.1]
[bodies.base]
mass = 0.5
inertia = [0.01, 0.01, 0.01]
position = [2.0, 0.0, 0.0]
[joints.ankle]
type = "revolute"
bodies = ["left.shank", "foot"]
at = [0.0, 0.0, -1.0]
axis = [0.0, 1.0, 0.0]
friction = 0.05
heat = "left.grease"
[joints.post]
type = "fixed"
bodies = ["ground", "base"]
at = [2.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
[parts.left]
use = "leg.toml"
"""


@pytest.fixture
def walker(tmp_path):
    (tmp_path / "leg.toml").write_text(LEG)
    (tmp_path / "walker.toml").write_text(WHOLE)
    return ephs.load(tmp_path / "walker.toml")


def test_parts_expose_what_is_used_and_no_more(walker):
    system = scene_system(walker)
    part = system.fillings[Path.parse("parts.left")]
    assert sorted(map(str, part.interface)) == ["drives.knee", "entropies.grease", "momenta.ground", "momenta.shank"]
    assert sorted(map(str, system.interface)) == ["drives.left.knee"]
    assert sum(path[-1] == "ground" for path, _ in system.leaves()) == 1
    assert "momenta.left.shank" in map(str, system.pattern.junctions)


def test_every_state_has_its_start_and_every_port_its_input(walker):
    system = scene_system(walker)
    assert set(initial_state(walker)) == set(system.states)
    assert set(scene_inputs(walker)) == set(system.interface)
    assert str(component_path("bodies", "left.shank")) == "parts.left.bodies.shank"
    assert str(wrench_port("left.shank")) == "momenta.left.shank"
    assert [str(path) for path, _ in drive_ports(walker.joint("left.knee"))] == ["drives.left.knee"]


def test_a_part_moves_with_the_whole_and_heats_its_own_node(walker):
    sol = ephs.simulate(walker, 1.0, step=0.005)
    assert sol.energy_error.max() <= 1e-12
    assert sol.constraint_error.max() <= 1e-12
    assert sol.thermal("left.grease").temperature[-1] != 300.0
    assert sol.joint("left.knee").coordinate[-1, 0] != 0.0
    assert sol["parts.left.joints.knee.pe.q_r"].shape == (201, 1)
    assert set(sol.summary()["joints"]) == {"ankle", "post", "left.knee"}
    assert check_model(walker).ok


@settings(calm, max_examples=30)
@given(mechanisms())
def test_states_of_any_mechanism_are_complete(scene):
    system = scene_system(scene)
    assert set(initial_state(scene)) == set(system.states)
    assert not system.interface
    assert scene_to_text(scene_from_text(scene_to_text(scene))) == scene_to_text(scene)


@settings(calm, max_examples=30)
@given(mechanisms(loops=False))
def test_mobility_of_trees_is_the_number_of_freedoms(scene):
    problem = problem_of_scene(scene)
    held = {name for _, j in scene.all_joints() for name in (j.body1, j.body2)}
    found = mobility(problem.descriptor, problem.descriptor.pack(problem.initial))
    assert found.mobility == sum(j.dim for _, j in scene.all_joints()) + 6 * len(set(scene.bodies) - held)
    assert found.redundant == 0


@pytest.mark.parametrize(("name", "mobile", "redundant"), [
    ("four-bar-windows-1", 1, 3), ("andrews-squeezer", 1, 9), ("revolute-chain-4", 4, 0), ("spherical-chain-2", 6, 0),
])  # fmt: skip
def test_mobility_and_redundancy_of_known_mechanisms(name, mobile, redundant):
    problem = problem_of_scene(ephs.load(ROOT / "benchmarks" / "scenes" / f"{name}.toml"))
    found = mobility(problem.descriptor, problem.descriptor.pack(problem.initial))
    assert (found.mobility, found.redundant) == (mobile, redundant)


def test_a_prescribed_motion_goes_at_its_rate_and_takes_away_a_freedom():
    scene = ephs.load(ROOT / "benchmarks" / "scenes" / "four-bar-windows-1.toml")
    name = "j0"
    rate = float(scene.joints[name].rate[0])
    driven = replace(
        scene, joints={**scene.joints, name: replace(scene.joints[name], motion=ephs.PolynomialMotion((rate,)))}
    )
    sol = ephs.simulate(driven, 1.0, step=0.005)
    assert np.allclose(sol.joint(name).coordinate[:, 0], rate * sol.t, rtol=0.0, atol=1e-12)
    assert np.allclose(sol.joint(name).rate, rate, rtol=0.0, atol=1e-12)
    assert sol.energy_error.max() <= 1e-13
    assert sol.summary()["mobility"] == 0
    with pytest.raises(ephs.AssemblyError, match=r"joints\.j0.*prescribed"):
        ephs.simulate(driven, 1.0, inputs={"joints.j0": 1.0})


def test_heat_goes_where_it_is_sent():
    """Friction heat of the slider-crank is in the housing and, through the fins, in the environment."""
    sol = ephs.simulate(ephs.load(ROOT / "scenes" / "slider-crank.toml"), 2.0, step=0.002)
    gained = sol.ledgers.thermal - sol.ledgers.thermal[0] + sol.ledgers.environment - sol.ledgers.environment[0]
    assert np.allclose(gained, sol.heat, rtol=0.0, atol=1e-12)
    assert np.all(np.diff(sol.thermal("housing").temperature) > 0.0)


@settings(calm, max_examples=25)
@given(mechanisms(kinds=("revolute", "prismatic", "spherical"), loops=False, springs=False, heat=False))
def test_accelerations_are_those_of_another_engine(scene):
    """Pinocchio's articulated-body algorithm, in joint coordinates, against the equations with multipliers."""
    model = pin.Model()
    model.gravity.linear = np.array(scene.world.gravity)
    ids, place = {"ground": 0}, {"ground": pin.SE3.Identity()}
    kinds = {"revolute": pin.JointModelRZ, "prismatic": pin.JointModelPZ, "spherical": pin.JointModelSpherical}
    for name, j in scene.joints.items():
        before = place[j.body1] * _pin(j.frame1)
        number = model.addJoint(ids[j.body1], kinds[j.kind](), before, name)
        after = _pin(j.frame2).inverse()
        body = scene.bodies[j.body2]
        model.appendBodyToJoint(number, pin.Inertia(body.mass, np.zeros(3), np.array(body.inertia)), after)
        ids[j.body2], place[j.body2] = number, after
    q, v, tau = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    for name, j in scene.joints.items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = np.roll(j.coordinate, -1) if j.kind == "spherical" else j.coordinate
        v[joint.idx_v : joint.idx_v + joint.nv] = j.rate
        tau[joint.idx_v : joint.idx_v + joint.nv] = -j.friction @ j.rate
    data = model.createData()
    expected = pin.aba(model, data, q, v, tau)
    pin.forwardKinematics(model, data, q, v, expected)
    problem = problem_of_scene(scene)
    now = instant(problem.descriptor, problem.reference, problem.descriptor.pack(problem.initial))
    for name, body in scene.bodies.items():
        momentum = now.rates[component_path("bodies", name) / "ke" / "p"]
        ours = np.concatenate([np.linalg.solve(body.inertia, momentum[:3]), momentum[3:] / body.mass])
        theirs = (place[name].inverse()).act(data.a[ids[name]])
        theirs = np.concatenate([theirs.angular, theirs.linear])
        assert np.abs(ours - theirs).max() <= 1e-8 * max(1.0, np.abs(theirs).max())


def _pin(pose):
    return pin.SE3(quaternion_to_matrix(pose[:4]), np.array(pose[4:]))


def test_models_that_cannot_move_are_told_what_is_wrong(walker):
    twice = ephs.Pattern(
        junctions={"q": ephs.junction(ephs.quantity.displacement)}, boxes={"a": {"q": "q"}, "b": {"q": "q"}}
    )(a=ephs.library.spring(k=1.0), b=ephs.library.spring(k=1.0))
    report = check_model(twice)
    assert not report.ok
    assert "a.q and b.q" in str(report)
    assert "holds" in str(check_model(walker))
