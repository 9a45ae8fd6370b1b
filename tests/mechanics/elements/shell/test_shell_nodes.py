"""Nodes of shells of scene files are bodies: for loads, springs, tendons, markers, inputs and readings."""

import numpy as np
import pytest

import ephs
from ephs import SceneError
from tests.numerics import largest
from tests.written import scene_of_text

UNTIL = 0.02
FORCE = np.array([0.3, -0.2, 0.5])
FREE = """format = 1
[world]
gravity = [0.0, 0.0, 0.0]
[shells.skin]
corners = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.2, 0.0], [0.0, 0.2, 0.0]]
elements = [1, 1]
thickness = 0.02
E = 2e4
rho = 900.0
"""
MARKER = '[markers.tip]\nbody = "skin.3"\nat = [0.02, 0.01, 0.0]\n'


def in_its_axes(t, state):
    """The force, as a wrench on a node."""
    return np.append(np.zeros(3), state.bodies["skin.3"].rotation.T @ FORCE)


ACTING = {
    "a load": ('[loads.push]\nbody = "skin.3"\nforce = [0.3, -0.2, 0.5]\n', {}, FORCE),
    "a wrench in the node's axes": ("", {"bodies.skin.3": in_its_axes}, FORCE),
    "a force at a marker": (MARKER, {"markers.tip": FORCE}, FORCE),
    "a spring between nodes": (
        '[springs.pull]\nbodies = ["skin.0", "skin.3"]\nat1 = [0.0, 0.0, 0.0]\nat2 = [0.0, 0.01, 0.0]\n'
        "stiffness = 40.0\nlength = 0.1\n",
        {},
        np.zeros(3),
    ),
    "a tendon between nodes": (
        '[tendons.cord]\nbodies = ["skin.0", "skin.3"]\npoints = [[0.0, 0.0, 0.0], [0.0, 0.01, 0.0]]\n'
        "stiffness = 40.0\nlength = 0.1\n",
        {},
        np.zeros(3),
    ),
}


def momentum(run, shell="skin"):
    """(n, 3) linear momentum of the nodes in the world."""
    sheet = dict(run.scene.all_shells())[shell]
    return sum(node.mass * run.body(name).velocity for name, node in sheet.bodies().items())


@pytest.mark.parametrize("what", ACTING)
def test_the_momentum_of_a_free_sheet_is_that_of_the_force_at_its_node(what):
    more, inputs, force = ACTING[what]
    run = ephs.simulate(scene_of_text(FREE + more), UNTIL, method="rk87", rtol=1e-9, atol=1e-12, inputs=inputs)
    assert largest(momentum(run) - run.t[:, None] * force) <= 1e-9 * UNTIL
    assert run.energy_error.max() < 1e-12 and run.audit
    still, moved = run.shell("skin").position[0], run.shell("skin").position[-1]
    assert largest(moved[3] - run.body("skin.3").position[-1]) <= 1e-15
    assert np.linalg.norm(moved[3] - still[3]) > 1e-5, "the control: something acts"


def test_what_acts_on_the_nodes_of_a_part_acts_from_outside(tmp_path):
    (tmp_path / "sheet.toml").write_text(FREE)
    whole = 'format = 1\n[world]\ngravity = [0.0, 0.0, 0.0]\n[parts.left]\nuse = "sheet.toml"\n'
    (tmp_path / "whole.toml").write_text(whole + ACTING["a load"][0].replace("skin", "left.skin"))
    run = ephs.simulate(ephs.load(tmp_path / "whole.toml"), UNTIL, method="rk87", rtol=1e-9, atol=1e-12)
    assert largest(momentum(run, "left.skin")[-1] - UNTIL * FORCE) <= 1e-9


def test_functions_read_nodes_and_markers_on_them_as_solutions_do():
    seen = []

    def watched(t, state):
        tip, node = state.markers.tip, state.bodies["skin.3"]
        seen.append([t, *tip.position, *tip.velocity, *node.position, *node.velocity])
        return FORCE

    run = ephs.simulate(
        scene_of_text(FREE + MARKER), UNTIL, method="rk87", rtol=1e-9, atol=1e-12, inputs={"markers.tip": watched}
    )
    tip, node = run.marker("tip"), run.body("skin.3")
    read = np.column_stack([run.t, tip.position, tip.velocity, node.position, node.velocity])
    at = {row[0]: row for row in seen}
    both = [(row, at[row[0]]) for row in read if row[0] in at]
    assert len(both) > len(read) // 2 and np.ptp(read[:, 1:4], axis=0).max() > 1e-5
    for row, told in both:
        assert largest(row - told) <= 1e-9


@pytest.mark.parametrize(
    ("edges", "body", "told"),
    [
        ('"free"', "skin.4", 'found "skin.4", expected a node of skin.0 … skin.3'),
        ('"free"', "skin.03", 'found "skin.03", expected a node of skin.0 … skin.3'),
        ('"free", "free", "free", "ground"', "skin.0", "welded to ground, expected a node that moves by itself"),
        ('"free"', "skan.0", 'expected "ground" or a body'),
    ],
)
def test_nodes_that_are_not_there_or_do_not_move_by_themselves_are_refused_by_name(edges, body, told):
    edges = ", ".join([edges] * (4 if edges == '"free"' else 1))
    with pytest.raises(SceneError, match=r"loads\.push\.body: ") as error:
        scene_of_text(f'{FREE}edges = [{edges}]\n[loads.push]\nbody = "{body}"\nforce = [0.0, 0.0, 1.0]\n')
    assert told in str(error.value)


def test_a_sheet_with_a_pressure_rests_under_a_load_at_a_node():
    keys = 'pressure = 0.3\ndamping = 0.5\nedges = ["free", "free", "free", "ground"]\n'
    rest = ephs.equilibrium(
        scene_of_text(FREE + keys + ACTING["a load"][0].replace("0.3, -0.2, 0.5", "1e-3, 0.0, 1e-2"))
    )
    run = ephs.simulate(rest.model, 0.1, method="radau", rtol=1e-8)
    assert largest(run.shell("skin").position - run.shell("skin").position[0]) < 1e-12
    still = rest.model.shells["skin"].shell().points
    assert largest(run.shell("skin").position[0] - still) > 1e-3, "the control"
    with pytest.raises(ephs.OptionError, match="a node of a sheet with a pressure"):
        ephs.dynamics(rest.model, inputs={"bodies.skin.3": np.zeros(6)})


def test_joints_hold_bodies_alone():
    with pytest.raises(SceneError, match=r"joints.pin.bodies\[1\]"):
        scene_of_text(f'{FREE}[joints.pin]\ntype = "spherical"\nbodies = ["ground", "skin.0"]\nat = [0.0, 0.0, 0.0]\n')


def test_saved_runs_keep_what_acts_on_nodes(tmp_path):
    run = ephs.simulate(scene_of_text(FREE + ACTING["a load"][0] + MARKER), UNTIL, method="rk87")
    run.save(tmp_path / "run.ephs")
    again = ephs.load_solution(tmp_path / "run.ephs")
    np.testing.assert_array_equal(again.marker("tip").position, run.marker("tip").position)
    assert again.scene.loads["push"].body == "skin.3"
