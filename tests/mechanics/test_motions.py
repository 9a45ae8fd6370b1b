"""Motions of mechanisms: the laws of every step, by the compiled natural method."""

from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, find, given, settings

import ephs
from benchmarks.cases import CASES
from ephs.mechanics import joint, rigid_body
from ephs.mechanics.elements import components
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.scene.build import initial_state, scene_inputs, scene_system
from ephs.semantics import Reference
from ephs.semantics.meaning.step import step
from ephs.semantics.spaces import PAIRS
from ephs.semantics.systems.laws import Probe, system_law
from ephs.testing import mechanisms
from tests.mechanics.mechanisms import on_ground
from tests.methods import FIXED_OF_SCENES
from tests.numerics import EPS
from tests.scenes import of_all_scenes
from tests.written import scene_of_text

# what is slow is compiled once: the first example
# Mechanisms are large, and each is solved: what Hypothesis deems slow and large is meant here.
calm = settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])


@pytest.mark.parametrize(("method", "step"), [("natural", 0.005), ("natural4", 0.02)])
@settings(calm, max_examples=20)
@given(scene=mechanisms())
def test_energy_positions_and_entropy_of_any_mechanism(method, step, scene):
    """Energy to rounding, joints closed to rounding, no entropy destroyed, in each of some steps."""
    sol = ephs.simulate(scene, 0.2, method=method, step=step)
    # Theory: √N·10·κ·ε, with N ≤ 40 and κ a few, of the energies that the bodies have, cancel though they may.
    weight = sum(body.mass * 9.83 * np.abs(sol.body(name).position).max() for name, body in scene.all_bodies())
    ledgers = sol.ledgers
    gross = weight + np.abs(ledgers.potential).max() + ledgers.kinetic.max() + ledgers.heat.max()
    assert sol.energy_error.max() * ledgers.scale <= 1e-13 * gross
    assert sol.constraint_error.max() <= 1e-12
    assert sol.stats["least_production"] >= 0.0
    assert np.all(np.diff(sol.entropy) >= -1e-15 * np.abs(sol.entropy).max() - 1e-24)  # at rest all is rounding


@settings(calm, max_examples=25)
@given(mechanisms(max_bodies=2))
def test_both_routes_lead_to_the_relation_of_a_mechanism(scene):
    system, world = scene_system(scene), scene.world
    probe = Probe(system, initial_state(scene), reference=Reference(world.temperature, world.pressure))
    for name in ("functoriality", "Tellegen"):
        verdict = system_law(name)(probe)
        assert verdict.holds, verdict


@settings(calm, max_examples=5)
@given(mechanisms(max_bodies=1, loops=False))
def test_the_compiled_step_is_the_plain_step(scene):
    system, world = scene_system(scene), scene.world
    state = initial_state(scene)
    reference = Reference(world.temperature, world.pressure)
    plain, solved = step(system.flatten(), state, 0.01, reference)
    compiled = ephs.simulate(scene, 0.01, step=0.01)
    assert solved.residual < 1e-7
    for name, _ in scene.all_bodies():
        pose = plain[next(p for p in plain if str(p) == f"bodies.{name}.pe.q")]
        sign = np.sign(pose[:4] @ compiled.body(name).quaternion[-1])
        assert np.abs(sign * pose[:4] - compiled.body(name).quaternion[-1]).max() <= 1e-9
        assert np.abs(pose[4:] - compiled.body(name).position[-1]).max() <= 1e-9


def test_loops_and_all_pairs_and_heat_are_generated():
    # A search for one example, however long: `find` has no law to be slow at.
    quick = settings(max_examples=3000, database=None, suppress_health_check=list(HealthCheck))
    find(mechanisms(), lambda s: len(s.bodies) == 3 and "bar0" in s.bodies, settings=quick)
    mixed = find(
        mechanisms(), lambda s: "bar0" in s.bodies and len({j.kind for j in s.joints.values()}) > 1, settings=quick
    )
    assert len(mixed.joints) > len(mixed.bodies)  # a closed loop
    find(
        mechanisms(),
        lambda s: bool(s.thermal) and any(np.any(j.friction) for j in s.joints.values()),
        settings=quick,
    )
    for kind in [*PAIRS, "universal"]:
        find(mechanisms(), lambda s, kind=kind: any(j.kind == kind for j in s.joints.values()), settings=quick)


STEPS = {2: (0.01, 0.005), 3: (0.01, 0.005), 4: (0.04, 0.02), 5: (0.05, 0.025), 6: (0.1, 0.05), 8: (0.1, 0.05)}
LAWLESS = ("variational",)  # unless it is asked to


def end(sol):
    return np.concatenate([sol.body(name).position[-1] for name in sol.scene.bodies])


@cache
def rubbing(kind):
    """One body on another on the ground, rubbing, heating a node; and where they are after 0.2 s."""
    # A search for one example, however long: `find` has no law to be slow at.
    quick = settings(max_examples=500, database=None, derandomize=True, suppress_health_check=list(HealthCheck))
    scenes = mechanisms(max_bodies=2, kinds=(kind,), loops=False)
    scene = find(scenes, lambda s: len(s.bodies) == 2 and bool(s.thermal) and np.any(s.springs), settings=quick)
    return scene, end(ephs.simulate(scene, 0.2, method="rk87", rtol=1e-13, atol=1e-13))


@pytest.mark.parametrize("method", FIXED_OF_SCENES)
@pytest.mark.parametrize("kind", [*PAIRS, "universal"])
def test_every_pair_with_every_method(kind, method):
    """Balances, closure, and the method's order."""
    scene, exact = rubbing(kind)
    order, errors = METHODS[method].order, []
    for h in STEPS[order]:
        sol = ephs.simulate(scene, 0.2, method=method, step=h)
        assert sol.energy_error.max() <= (1e-3 if method in LAWLESS else 1e-12)
        assert sol.constraint_error.max() <= 1e-12
        assert sol.velocity_error.max() <= 1e-11
        assert sol.stats["least_production"] >= 0.0
        errors.append(np.abs(end(sol) - exact).max())
    if kind == "fixed":  # nothing moves
        assert max(errors) <= 1e-15
        return
    rounding = 8.0 * EPS * np.abs(exact).max()
    assert errors[1] <= max(errors[0] / 2.0 ** (order - (0.1 if order <= 4 else 0.5)), rounding)
    # no method is better than it says where errors can be seen
    assert errors[1] >= errors[0] / 2.0 ** (order + 0.25) or errors[0] < 1e-6


@pytest.mark.parametrize("kind", PAIRS)
def test_joints_of_a_system_read_as_those_of_its_scene(kind):
    scene, world = rubbing(kind)[0], rubbing(kind)[0].world
    inputs = {
        str(port): {"effort" if given.effort else "flow": given.value} for port, given in scene_inputs(scene).items()
    }
    environment = Reference(world.temperature, world.pressure)
    steps = {"method": "rk54", "step": 0.02}
    whole = ephs.simulate(scene, 0.1, **steps)
    by_hand = ephs.simulate(scene.system(), 0.1, inputs=inputs, reference=environment, **steps)
    for name, _ in scene.all_joints():
        one, other = whole.joint(name), by_hand.joint(f"joints.{name}")
        for read in ("coordinate", "rate", "wrench"):
            expected = getattr(one, read)
            largest = 1.0 + abs(expected).max(initial=0.0)
            np.testing.assert_allclose(getattr(other, read), expected, rtol=0.0, atol=1e-12 * largest)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_motions_converge_to_independent_references(case):
    """Against states that two other programs agree upon: second order."""
    errors = [
        case.error(ephs.simulate(case.scene(), case.time, step=case.step / 2**k, save_at=[case.time])) for k in (1, 2)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_a_four_bar_passes_its_singular_configuration():
    """All links in line, three equations dependent anyway: the exact motion goes on, and so does the computed one."""
    case = next(c for c in CASES if c.name == "four-bar-windows-1")
    sol = ephs.simulate(case.scene(), 5.0, step=0.005)
    height = sol.body("coupler0").position[:, 1]
    assert height.min() < 0.0 < height.max()
    assert sol.energy_error.max() <= 1e-13
    assert sol.constraint_error.max() <= 1e-12
    assert case.error(sol) < 1e-3
    assert sol.summary()["redundant_constraints"] == 3
    assert sol.summary()["mobility"] == 1


@of_all_scenes
def test_the_shipped_scenes_move(file):
    sol = ephs.simulate(ephs.load(file), 0.5, step=1e-3, audit="off")  # too long for digits of the top
    assert sol.energy_error.max() <= 1e-12
    assert sol.constraint_error.max() <= 1e-12
    assert sol.stats["least_production"] >= 0.0


# ---- reading motions -------------------------------------------------------------------------------------------


def test_a_step_of_more_than_half_a_turn_does_not_end_well():
    """150 rad/s and 30 ms: steps are taken in halves, and their error is found."""
    case = next(c for c in CASES if c.name == "heavy-top")
    with pytest.raises(ephs.AuditError, match="accuracy"):
        ephs.simulate(case.scene(), 1.0, step=0.03)


def test_functions_of_the_user_move_with_the_same_balances():
    """A pendulum with a Python potential and a friction that grows with speed and falls with temperature."""
    system = on_ground(
        link=joint(
            "revolute",
            frame2={"position": [0.0, 0.5, 0.0]},
            friction=lambda x, u, theta: [[0.1 * (1.0 + u[0] ** 2) * 300.0 / theta]],
            potential=lambda x: 2.0 * float(np.sin(x[0])) ** 2,
        ),
        body=rigid_body(1.0, [0.1, 0.05, 0.1], potential=lambda pose: 0.5 * float(pose[4:] @ pose[4:])),
    )
    start = {
        "joint.pe.q_r": 0.3,
        "body.pe.q": [np.cos(0.15), 0, 0, np.sin(0.15), 0.5 * np.sin(0.3), -0.5 * np.cos(0.3), 0],
    }
    sol = ephs.simulate(system, 0.4, step=0.01, initial=start)
    assert sol.energy_error.max() <= 1e-11
    assert sol.stats["least_production"] >= 0.0
    assert np.ptp(sol["joint.pe.q_r"]) > 0.1
    gap = sol["body.pe.q"][:, 4] - 0.5 * np.sin(sol["joint.pe.q_r"][:, 0])
    assert np.abs(gap).max() <= 1e-12


@pytest.mark.parametrize("group", ["SE3", "SO3xR3"])
def test_a_free_body_falls_and_tumbles_in_both_groups(group):
    body = rigid_body(2.0, [1.0, 2.0, 2.5], (0.0, 0.0, -9.81), group=group)
    closed = ephs.Pattern(junctions={"p": ephs.junction(components.MOMENTA[group])}, boxes={"body": {"p": "p"}})(
        body=body
    )
    sol = ephs.simulate(closed, 1.0, step=0.01, initial={"body.ke.p": [0.5, 4.0, 0.3, 1.0, 0.0, 0.0]})
    assert sol.energy_error.max() <= 1e-13
    turned = sol["body.ke.p"][:, :3]
    assert np.allclose(np.linalg.norm(turned, axis=1), np.linalg.norm(turned[0]), rtol=1e-13, atol=0.0)
    exact = np.array([0.5, 0.0, -0.5 * 9.81])
    assert np.abs(sol["body.pe.q"][-1, 4:] - exact).max() <= (1e-13 if group == "SO3xR3" else 1e-2)


RESTING = """
format = 1
[bodies.block]
mass = 2.7
inertia = [0.2, 0.7, 0.7]
position = [0.5, 0.3, 0.2]
[joints.weld]
type = "fixed"
bodies = ["ground", "block"]
at = [0.1, 0.0, 0.3]
[springs.s]
bodies = ["ground", "block"]
at1 = [1.5, 0.8, 2.2]
at2 = [0.15, -0.13, 0.15]
stiffness = 5.0
length = 1.5
damping = 0.3
heat = "a"
[thermal.a]
capacity = 5.0
temperature = 300.0
[thermal.b]
capacity = 0.1
temperature = 310.0
[conduction.c]
between = ["a", "b"]
conductance = 100.0
"""


ROUNDING = 8 * EPS * 100.0 * 0.01
"""Of the entropy that a conductance of 100 W/K passes on in a step of 0.01 s, in J/K."""


def test_what_comes_to_rest_stays_there():
    """Damping makes the square of a rate that is all rounding, conduction the difference of equal temperatures."""
    sol = ephs.simulate(scene_of_text(RESTING), 5.0, step=0.01, audit="off")  # conduction is too fast for such steps
    warm = [sol.summary()["thermal"][name]["temperature"] for name in "ab"]
    assert warm[0] == pytest.approx(warm[1], rel=1e-12)
    assert np.abs(sol.body("block").position - [0.5, 0.3, 0.2]).max() <= 1e-14
    assert sol.energy == pytest.approx(sol.energy[0], rel=1e-13) and sol.stats["least_production"] >= -ROUNDING
