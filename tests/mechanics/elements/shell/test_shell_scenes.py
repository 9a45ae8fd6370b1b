"""Shells of scene files: as systems made by hand, in other units and parts, welded to bodies, with heat, refused."""

import numpy as np
import pytest

import ephs
from ephs.mechanics import Shell, ShellSection
from ephs.mechanics.elements.shell.mesh import grid
from ephs.mechanics.elements.shell.system import shell_system
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from ephs.mechanics.scene.rescaled import rescaled
from ephs.semantics.spaces import SE3
from tests.numerics import largest
from tests.written import scene_of_text

UNTIL = 0.05
SHEET = {
    "corners": "[[0.0, 0.0, 0.0], [0.6, 0.0, 0.1], [0.6, 0.4, 0.1], [0.0, 0.4, 0.0]]", "elements": "[3, 2]",
    "thickness": "4e-3", "E": "2e7", "nu": "0.3", "rho": "900.0", "damping": "2e-3",
    "edges": '["free", "free", "free", "ground"]',
}  # fmt: skip
WORLD = "format = 1\n[world]\ngravity = [1.0, 0.0, -9.81]\n"
HUB = """
[bodies.hub]
mass = 1.0
inertia = [0.01, 0.01, 0.01]
position = [-0.1, 0.2, 0.3]
rotation = [0.8, 0.0, 0.6, 0.0]
[joints.held]
type = "KIND"
bodies = ["ground", "hub"]
at = [-0.1, 0.2, 0.3]
axis = [0.0, 1.0, 0.0]
"""


def lines_of(keys):
    return "".join(f"{key} = {value}\n" for key, value in keys.items())


def sheet(more="", **keys):
    return scene_of_text(f"{WORLD}{more}[shells.skin]\n{lines_of(SHEET | keys)}")


def hub(kind="revolute", **keys):
    return sheet(HUB.replace("KIND", kind), edges='["free", "free", "free", "hub"]', **keys)


def ran(model, **options):
    return ephs.simulate(model, UNTIL, method="radau", rtol=1e-8, atol=1e-10, save_at=[0.0, UNTIL], **options)


def tip(solution):
    """Place of the node farthest from the weld."""
    return solution.shell("skin").position[-1, -1]


def test_a_sheet_is_the_shell_that_is_made_by_hand():
    section = ShellSection.isotropic(4e-3, E=2e7, nu=0.3, rho=900.0)
    points, where, cells = grid(lambda u, v: (0.6 * u, 0.4 * v, 0.1 * u), (3, 2))
    held = np.flatnonzero(where[:, 0] == 0.0).tolist()
    made = shell_system(Shell.of(points, cells, section), gravity=[1.0, 0.0, -9.81], damping=2e-3, held=held)
    one, other = ran(sheet()), ran(made)
    last = f"node{len(points) - 1}.pe.q"
    # the heat of one goes to one environment, of the other to one in each element: sums in other orders
    assert one[f"shells.skin.{last}"][-1] == pytest.approx(other[last][-1], abs=1e-12)
    assert np.linalg.norm(tip(one) - points[-1]) > 1e-3, "it moves"


def test_what_is_welded_to_a_body_that_is_held_is_as_what_is_welded_to_the_ground():
    assert tip(ran(hub("fixed"))) == pytest.approx(tip(ran(sheet())), abs=1e-10)
    assert np.linalg.norm(tip(ran(hub("revolute"))) - tip(ran(sheet()))) > 1e-4, "the control: a hub that turns"


def test_energy_is_that_of_its_elements_and_its_heat_warms_a_node():
    more = "[thermal.frame]\ncapacity = 2.0\ntemperature = 300.0\n"
    run = ran(sheet(more, heat='"frame"'))
    shell = run.shell("skin")
    stored = sum(v[-1] for p, v in run.ledgers.storages.items() if str(p).endswith(".pe") and "element" in str(p))
    assert shell.energy[-1].sum() == pytest.approx(stored, rel=1e-9)
    warmed = 2.0 * (run.thermal("frame").temperature[-1] - 300.0)
    assert warmed == pytest.approx(run.heat[-1], rel=1e-6) and run.heat[-1] > 0.0
    assert run.energy_error.max() < 1e-13
    assert not shell.membrane[0].any() and largest(shell.moment[-1]) > 0.0


def test_other_units_are_the_same_motion():
    """By powers of two nothing is rounded but what adaptive steps make of tolerances in metres."""
    scene = sheet()
    other = rescaled(scene, 2.0, 4.0, 1.0)
    assert other.shells["skin"].E == 4.0 / 2.0 * scene.shells["skin"].E
    assert tip(ran(other)) / 2.0 == pytest.approx(tip(ran(scene)), abs=1e-8)


def test_a_part_that_is_moved_has_its_sheet_moved(tmp_path):
    (tmp_path / "wing.toml").write_text(f"format = 1\n[shells.skin]\n{lines_of(SHEET)}")
    turn = [0.8, 0.0, 0.0, 0.6]
    (tmp_path / "whole.toml").write_text(
        f'{WORLD}[parts.left]\nuse = "wing.toml"\nposition = [1.0, 2.0, 0.5]\nrotation = {turn}\n'
    )
    run = ran(ephs.load(tmp_path / "whole.toml"))
    start = run.shell("left.skin").position[0]
    assert start[-1] == pytest.approx(np.array([1.0, 2.0, 0.5]) + turned(turn, [0.6, 0.4, 0.1]), abs=1e-12)
    assert run.energy_error.max() < 1e-13


def turned(quaternion, vector):
    w, x, y, z = quaternion
    u, v = np.array([x, y, z]), np.array(vector)
    return v + 2.0 * w * np.cross(u, v) + 2.0 * np.cross(u, np.cross(u, v))


def test_it_is_read_again_from_a_result(tmp_path):
    scene = hub()
    assert scene_to_text(scene_from_text(scene_to_text(scene))) == scene_to_text(scene)
    run = ran(scene)
    run.save(tmp_path / "run.nc")
    assert np.array_equal(ephs.load_solution(tmp_path / "run.nc").shell("skin").position, run.shell("skin").position)


@pytest.mark.parametrize("pinned", ["false", "true"])
def test_a_run_goes_on_from_a_strained_sheet(pinned):
    """From halfway it is the run to the end, in a document and in other units, too."""
    scene, end, most = hub(pinned=f"[false, false, false, {pinned}]", elements="[1, 1]"), 0.02, {"rtol": 1e-7}
    whole = ephs.simulate(scene, end, method="radau", **most, save_at=[0.0, 0.5 * end, end])
    half = scene.at(whole, 0.5 * end)
    assert half.shells["skin"].nodes != scene.shells["skin"].nodes
    assert scene_to_text(scene_from_text(scene_to_text(half))) == scene_to_text(half)
    for start, unit in ((half, 1.0), (rescaled(half, 2.0, 4.0, 1.0), 2.0)):
        rest = ephs.simulate(start, 0.5 * end, method="radau", **most)
        assert tip(rest) / unit == pytest.approx(tip(whole), abs=1e-6)
        assert rest.energy_error.max() < 1e-13
        assert rest.shell("skin").energy[0].sum() == pytest.approx(
            unit * unit * 4.0 ** (unit - 1.0) * whole.shell("skin").energy[1].sum(), rel=1e-9
        )
    assert np.linalg.norm(tip(rest) - tip(ephs.simulate(scene, 0.5 * end, method="radau"))) > 1e-4


def test_a_body_that_is_moved_strains_the_sheet_that_it_carries():
    """Nodes that are welded go with it, the others stay: the strain is that of statics, and the run starts with it."""
    scene = hub()
    moved = scene.with_state({"held": 0.02})
    before, after = (of.shells["skin"] for of in (scene, moved))
    motion = SE3.compose(moved.body("hub").pose, SE3.inverse(scene.body("hub").pose))
    (still, _), (there, _) = before.start(), after.start()
    for i in range(len(still)):
        expected = SE3.compose(motion, still[i]) if i in before.welds()["hub"] else still[i]
        assert there[i] == pytest.approx(expected, abs=1e-15)
    run = ran(moved)
    assert run.shell("skin").energy[0] == pytest.approx(before.shell().energy(there), rel=1e-9, abs=1e-15)
    stored = sum(v[0] for p, v in run.ledgers.storages.items() if str(p).endswith(".pe") and "element" in str(p))
    assert stored == pytest.approx(before.shell().energy(there).sum(), rel=1e-9)
    assert stored > 1e-6 and run.energy_error.max() < 1e-13
    assert scene.with_state(rates={"held": 0.1}).shells == scene.shells


def test_nodes_are_read_as_bodies():
    run = ran(hub())
    assert run.body("skin-node11").velocity[-1] == pytest.approx(
        run.linked.twists["skin-node11"][-1, 3:] @ run.body("skin-node11").rotation[-1].T, abs=1e-12
    )
