"""Scenes as systems: their names, what parts expose, heat, ground, and drives."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

import ephs
from ephs.mechanics.runs.check import check_model
from ephs.mechanics.runs.scene_problem import problem_of_scene
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
from ephs.solve.equations.mobility import mobility
from ephs.testing import mechanisms
from tests.numerics import largest
from tests.written import scene_of_text

# Mechanisms are large, and each is solved: what Hypothesis deems slow and large is meant here.
calm = settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])

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


def test_loads_are_no_part_of_the_system_but_ports_where_they_act(walker, tmp_path):
    """A run of the system without them would be another motion, and is refused."""
    load = '[loads.{}]\nbody = "{}"\nforce = [1.0, 0.0, 2.0]\nmoment = [0.0, 0.3, 0.0]\nfollower = true\n'
    (tmp_path / "leg.toml").write_text(LEG + load.format("pull", "shank"))
    (tmp_path / "loaded.toml").write_text(WHOLE + load.format("push", "foot"))
    loaded = ephs.load(tmp_path / "loaded.toml")
    system, ports = loaded.system(), ["momenta.foot", "momenta.left.shank"]
    assert set(map(str, system.interface)) == {*ports, "drives.left.knee"}
    assert set(map(str, walker.system().interface)) == {"drives.left.knee"}
    drive = {"drives.left.knee": {"flow": 0.2}}
    with pytest.raises(ephs.AssemblyError, match="the outer port is open"):
        ephs.simulate(system, 0.1, inputs=drive)
    wrench = {"flow": np.array([0.0, 0.3, 0.0, 1.0, 0.0, 2.0])}
    by_hand = ephs.simulate(system, 0.5, inputs=drive | dict.fromkeys(ports, wrench))
    whole = ephs.simulate(loaded, 0.5)
    assert largest(by_hand["bodies.foot.pe.q"][-1] - whole["bodies.foot.pe.q"][-1]) <= 1e-14


def test_pressures_are_no_part_of_the_system_but_ports_where_they_act():
    text = """format = 1
    [shells.sheet]
    corners = [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.1, 0.0], [0.0, 0.1, 0.0]]
    elements = [1, 1]
    thickness = 0.01
    E = 1e5
    rho = 1000.0
    edges = ["free", "free", "free", "ground"]
    """
    at_rest, blown = scene_of_text(text), scene_of_text(text + "pressure = 20.0\n")
    assert not set(at_rest.system().interface)
    assert set(map(str, blown.system().interface)) == {"momenta.sheet.2", "momenta.sheet.3"}


@settings(calm, max_examples=30)
@given(mechanisms())
def test_states_of_any_mechanism_are_complete(scene):
    system = scene_system(scene)
    assert set(initial_state(scene)) == set(system.states)
    assert not system.interface
    assert scene_to_text(scene_from_text(scene_to_text(scene))) == scene_to_text(scene)


@settings(calm, max_examples=30)
@given(mechanisms())
def test_joints_of_systems_may_be_driven(scene):
    """Each gets a port of its rate's momentum; the state at the start stays, and nothing else is a port."""
    joints = {name: j for name, j in scene.all_joints() if j.dim}
    system = scene.system(driven=joints)
    ports = {path: len(range(j.dim)[part]) for j in joints.values() for path, part in drive_ports(j)}
    assert {path: port.quantity.space.dim for path, port in system.interface.items()} == ports
    assert all(np.array_equal(value, scene.system().initial[path]) for path, value in system.initial.items())
    with pytest.raises(ephs.SceneError, match="expected a joint of the scene"):
        scene.system(driven=["nowhere"])


@settings(calm, max_examples=30)
@given(mechanisms(loops=False))
def test_mobility_of_trees_is_the_number_of_freedoms(scene):
    problem = problem_of_scene(scene)
    held = {name for _, j in scene.all_joints() for name in (j.body1, j.body2)}
    found = mobility(problem.descriptor, problem.descriptor.pack(problem.initial))
    assert found.mobility == sum(j.dim for _, j in scene.all_joints()) + 6 * len(set(scene.bodies) - held)
    assert found.redundant == 0
