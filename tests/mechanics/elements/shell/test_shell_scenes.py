"""Shells of scene files: as systems made by hand, in other units and parts, welded to bodies, with heat, refused."""

import numpy as np
import pytest

import ephs
from ephs.mechanics import Shell, ShellSection
from ephs.mechanics.elements.shell.mesh import grid
from ephs.mechanics.elements.shell.system import shell_system
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
    assert run.body("skin.11").velocity[-1] == pytest.approx(
        run.linked.twists["skin.11"][-1, 3:] @ run.body("skin.11").rotation[-1].T, abs=1e-12
    )
