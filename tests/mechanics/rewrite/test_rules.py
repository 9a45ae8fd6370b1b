"""Rules of rewriting: what is kept means what it did, what is lost is found again, in any order, or they refuse."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import ephs
from ephs import Path, Pattern, library, quantity
from ephs.mechanics import joint, rigid_body
from ephs.mechanics.elements.components import ground, thermal_node
from ephs.mechanics.rewrite.dropping import DROP_FRICTION, DROP_GYROSCOPIC, DROP_JOINT, DROP_POSE
from ephs.mechanics.rewrite.folding import FOLD
from ephs.mechanics.rewrite.merging import MERGE
from ephs.mechanics.rewrite.rewrite import Strength, rewrite, sites_of
from ephs.mechanics.rewrite.rules import RULES
from ephs.mechanics.runs.running import by_constant_steps
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.scene.build import initial_state
from ephs.mechanics.scene.model import frozen
from ephs.semantics import Reference
from ephs.semantics.spaces import SE3
from ephs.solve.equations.instant import instant
from ephs.testing import mechanisms
from tests.mechanics.mechanisms import on_ground
from tests.mechanics.rewrite.rewriting import in_order, lever_networks, levers, same_relation
from tests.numerics import generators, jacobian, largest

NONE, WEIGHT = (0.0, 0.0, 0.0), (0.3, -0.2, -9.81)
TURNED = SE3.exp(np.array([0.3, 0.4, 0.1, 0.0, 0.0, 0.0]))
ASIDE = SE3.exp(np.array([0.0, 0.0, 0.0, 0.5, 0.0, 0.0]))
BALL, BRICK, SKEW = [0.4, 0.4, 0.4], [0.3, 0.4, 0.5], [0.3, 0.4, 0.5, 0.0, 0.1, 0.05]
KINDS = (*4 * ("fixed",), "revolute", "spherical", "free")
"""Most joints are fixed, that there is something to merge."""
MERGING = (FOLD, DROP_FRICTION, MERGE)
"""A fixed joint has nothing to rub and nothing to heat: its friction goes first."""
SAME = tuple(rule for rule in RULES if rule.strength == Strength.RELATION)
Q1, Q2, P1, P2 = (Path.of(f"body{i}.{state}") for state in ("pe.q", "ke.p") for i in (1, 2))


def paths(system):
    return {str(path) for path, _ in system.flatten().leaves()}


def light(scene):
    """Without gravity, so that poses matter to nobody."""
    return replace(scene, world=replace(scene.world, gravity=frozen([0.0, 0.0, 0.0])))


def body(inertia=BRICK, gravity=(0.0, 0.0, -9.81), **group):
    return rigid_body(1.0, inertia, gravity, **group)


def alone(inertia):
    """A body whose velocity is taken in world axes, with nothing outside."""
    return Pattern.from_text("p: direct_momentum; body(p)")(body=body(inertia, group="SO3xR3"))


def row(first, rng, kind, inertia):
    """Bodies after a first part, each on the one before by a joint of its own frames."""
    text = "".join(f"p{i}: body_momentum; b{i}(p=p{i});" for i in range(4))
    text += "".join(f"w{i}(p1=p{i}, p2=p{i + 1});" for i in range(3))
    parts = {"b0": first} | {f"b{i}": rigid_body(1.0 + i, inertia) for i in (1, 2, 3)}
    parts |= {f"w{i}": joint(kind, SE3.random(rng), SE3.random(rng)) for i in range(3)}
    return Pattern.from_text(text)(parts)


def two(link, gravity=WEIGHT, *, turned=False):
    """Two bodies, of which the second one is at the joint's first frame where they are turned."""
    ends = "p1=p2, p2=p1" if turned else "p1, p2"
    text = f"p1: body_momentum; p2: body_momentum; body1(p=p1); body2(p=p2); joint({ends})"
    return Pattern.from_text(text)(joint=link, **{f"body{i}": rigid_body(float(i), BRICK, gravity) for i in (1, 2)})


def found_again(done, start, near=1e-12):
    """States before a rewrite are those that they were; of both quaternions of a lost pose it is the given one."""
    lost = [path for path, value in start.items() if np.size(value) == 7 and path not in done.system.states]
    flipped = [{**start, path: np.concatenate([-start[path][:4], start[path][4:]])} for path in lost]
    for before in (start, *flipped):
        kept = done.states.forward(before)
        assert set(kept) == set(done.system.states)
        found = done.states.back(kept, before)
        assert set(found) == set(before)
        for path, value in before.items():
            assert largest(found[path] - value, initial=0.0) <= near * max(1.0, largest(value, initial=0.0)), path


# ---- what has no effect ------------------------------------------------------------------------------------------


def turn(rng):
    return SE3.exp(np.concatenate([rng.standard_normal(3), np.zeros(3)]))


def pose_of_two(rng, *, turned):
    """Of two bodies that float together one keeps its pose: where both are is known by it."""
    near, far, pose = (SE3.random(rng) for _ in range(3))
    element, rates = turn(rng), dict(zip((P1, P2), rng.standard_normal((2, 6)), strict=True))
    system = rewrite(two(joint("spherical", near, far), NONE, turned=turned), (FOLD, DROP_FRICTION)).system
    other = SE3.compose(SE3.compose(SE3.compose(pose, near), element), SE3.inverse(far))
    poses = {Q1: other, Q2: pose} if turned else {Q1: pose, Q2: other}
    return system, (DROP_POSE,), {"body2.pe", "body2.pkc"}, {**poses, **rates, Path.of("joint.pe.q_r"): element[:4]}


def pose_on_a_ball(rng):
    system, element = on_ground(body(gravity=NONE), joint("spherical", ASIDE, TURNED)), turn(rng)
    pose = SE3.compose(SE3.compose(ASIDE, element), SE3.inverse(TURNED))
    start = {"body.pe.q": pose, "joint.pe.q_r": element[:4], "body.ke.p": rng.standard_normal(6)}
    return system, (DROP_POSE,), {"body.pe", "body.pkc"}, system.state(start)


def free_joint(rng):
    """It holds nothing, and the ground nobody."""
    system, q = on_ground(body(), joint("free", ASIDE, TURNED)), SE3.random(rng)
    relative = SE3.compose(SE3.compose(SE3.inverse(ASIDE), q), TURNED)
    start = {"body.pe.q": q, "joint.pe.q_r": relative, "body.ke.p": rng.standard_normal(6)}
    lost = {"ground", *(f"joint.{part}" for part in ("o1", "o2", "hc", "pe", "pkc", "mf", "env"))}
    return system, (FOLD, DROP_FRICTION, DROP_JOINT), lost, system.state(start)


def friction(_rng):
    system = on_ground(body(), joint("revolute", ASIDE, None, 0.0, 2.0))
    return system, (DROP_FRICTION,), {"joint.mf", "joint.env"}, system.state({"joint.env.s": 3.0})


def friction_beside_heat(_rng):
    """Which heats nothing, and leaves the node."""
    pattern = Pattern.from_text(
        "g: body_momentum; p: body_momentum; s: entropy; ground(p=g); body(p); joint(p1=g, p2=p, s); node(s)"
    )
    link, node = joint("revolute", heat=True), thermal_node(10.0, 300.0)
    system = pattern(ground=ground(), body=body(), joint=link, node=node)
    return system, (DROP_FRICTION,), {"joint.mf"}, system.state()


DROPPED = {
    "friction": friction, "friction beside heat": friction_beside_heat, "pose on a ball": pose_on_a_ball,
    "pose of two": lambda rng: pose_of_two(rng, turned=False), "free joint": free_joint,
    "pose of two, turned": lambda rng: pose_of_two(rng, turned=True),
}  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("case", DROPPED)
def test_what_has_no_effect_is_dropped_and_its_states_are_found_again(case, seed):
    """The two relations agree on the kept rates and the outer ports."""
    system, rules, lost, start = DROPPED[case](np.random.default_rng(seed))
    done = rewrite(system, rules)
    assert paths(system) - paths(done.system) == lost
    one, other = (
        of.relation(Reference()).at({str(path): value for path, value in state.items()})
        for of, state in ((system, start), (done.system, done.states.forward(start)))
    )
    assert one.linear.onto(other.order).same(other.linear)
    found_again(done, start)


GYROSCOPIC = {
    "slides": (row(ground(), np.random.default_rng(3), "prismatic", SKEW), ["never turns"] * 3),
    "brick": (on_ground(body(), joint("revolute", stiffness=2.0, rest=0.7)), ["principal axis"]),
    "ball": (on_ground(body(BALL), joint("revolute", None, TURNED, stiffness=2.0, rest=0.7)), ["principal axis"]),
    "in world axes": (alone(BALL), ["world axes"]),
}


@pytest.mark.parametrize("folded", [False, True])
@pytest.mark.parametrize("case", GYROSCOPIC)
def test_gyroscopic_forces_that_vanish_are_dropped(case, folded):
    """Weight and springs set all in motion: the steps stay the same."""
    system, reasons = GYROSCOPIC[case]
    system = rewrite(system, [FOLD]).system if folded else system
    done = rewrite(system, [DROP_GYROSCOPIC])
    assert all(words in site.reason for words, site in zip(reasons, done.done, strict=True))
    one, other = (by_constant_steps(problem_of_system(of), 0.4, 0.02) for of in (system, done.system))
    assert max(largest(one[path][-1], initial=0.0) for path in one if path[-1] == "p") > 0.1
    for path in one:
        assert largest(one[path] - other[path], initial=0.0) <= 20 * 1e-13 * max(1.0, largest(one[path], initial=0.0))


def test_what_is_refused_would_change_the_motion():
    """The forces of a round body that turns and moves are as large as its momenta."""
    system = on_ground(rigid_body(2.0, BALL, NONE), joint("free"))
    u = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    lp = dict(system.leaves())[Path.of("body.lp")]
    force = lp.structure({Path.of("p"): np.array([0.4, 0.4, 0.4, 2.0, 2.0, 2.0]) * u})[0] @ u
    assert largest(force[:3]) <= 1e-15
    assert largest(force[3:]) == pytest.approx(2.0)


@settings(max_examples=15)
@given(scene=mechanisms(max_bodies=3, friction=False), floating=st.booleans())
def test_rewritten_systems_take_the_same_steps_and_every_state_is_found_again(scene, floating):
    scene = light(scene) if floating else scene
    system, start = scene.system(), initial_state(scene)
    done, step, steps = rewrite(system, SAME), 5e-3, 4
    before, after = (
        by_constant_steps(problem_of_system(of, {str(p): v for p, v in state.items()}), step * steps, step)
        for of, state in ((system, start), (done.system, done.states.forward(start)))
    )
    found, whole = done.states.back(after.state_at(steps), start), before.state_at(steps)
    assert set(found) == set(whole)
    for path, value in whole.items():
        scale = max(1.0, largest(value, initial=0.0))
        assert largest(value - found[path], initial=0.0) <= steps * 1e-12 * scale, path


# ---- what is refused ---------------------------------------------------------------------------------------------

PLANE, AXIS = "in planar motion, too, the transport term", "not only about a principal axis"
READER = ephs.gyrator(
    {"a": quantity.flux_linkage, "b": quantity.angular_momentum, "~x": quantity.momentum},
    lambda x: [[0.0, x], [-x, 0.0]],
)
READ = "; e: flux_linkage, exposed; d: angular_momentum, exposed; reader(a=e, b=d, x=~b)"
ELSEWHERE = joint("revolute", ASIDE, None, lambda x, u, theta: np.zeros((1, 1)))
REFUSED = [
    (FOLD, levers(said=", exposed"), "b is an outer port"),
    (FOLD, levers("; load(p=b)", load=library.point_mass(m=1.0)), "load stores a state at b"),
    (FOLD, levers(READ, reader=READER), "reader reads the state of b"),
    (DROP_GYROSCOPIC, body(BALL, group="SO3xR3"), "wrench from outside"),
    (DROP_GYROSCOPIC, alone(BRICK), AXIS),
    (DROP_GYROSCOPIC, on_ground(body(BALL), joint("free")), "about all axes the transport term p_υ × ω remains"),
    (DROP_GYROSCOPIC, on_ground(body(BALL), joint("spherical", None, ASIDE)), "the transport term p_υ × ω remains"),
    (DROP_GYROSCOPIC, on_ground(body(), joint("planar")), PLANE),
    (DROP_GYROSCOPIC, on_ground(body(), joint("revolute", None, ASIDE)), PLANE),
    *((DROP_GYROSCOPIC, on_ground(body(), joint(kind, None, TURNED)), AXIS) for kind in ("revolute", "cylindrical")),
    (DROP_GYROSCOPIC, on_ground(body(), joint("spherical")), AXIS),
    (DROP_FRICTION, on_ground(body(), joint("revolute", ASIDE, None, 0.1)), "its resistance is not zero"),
    (DROP_FRICTION, on_ground(body(), ELSEWHERE), "its resistance is not zero"),  # of a function one cannot know
    (DROP_POSE, on_ground(body(), joint("spherical")), "its potential changes with the pose"),
    (DROP_POSE, body(gravity=NONE), "it could not be computed from the others"),
    (DROP_JOINT, on_ground(body(), joint("free", stiffness=1.0)), "its spring pulls"),
    (DROP_JOINT, on_ground(body(), joint("free", friction=0.5)), "joint.mf acts on its rate"),
    (MERGE, rewrite(two(joint("fixed")), [FOLD]).system, "joint.mf comes first"),
]


@pytest.mark.parametrize(("rule", "system", "words"), REFUSED)
def test_what_would_change_the_meaning_is_refused(rule, system, words):
    sites = [site for site in sites_of(system, rule) if words in site.refusal]
    assert sites
    with pytest.raises(ephs.AssemblyError, match=f"would change the meaning.*{re.escape(words)}"):
        sites[0].apply(system)
    done = rewrite(system, [rule]).system
    assert str(sites[0].where) in paths(done)
    if rule is FOLD:
        same_relation(system.flatten(), done, 3)


def test_rules_wait_for_a_weld_of_their_own_body():
    """Of two weightless pairs, joined rigidly and by a hinge."""
    pairs = {"left": "fixed", "right": "revolute"}
    ends = [f"{name}{i}" for name in pairs for i in (1, 2)]
    text = "".join(f"{end}: body_momentum; body_{end}(p={end});" for end in ends)
    text += "".join(f"{name}(p1={name}1, p2={name}2);" for name in pairs)
    parts = {f"body_{end}": body(gravity=NONE) for end in ends} | {name: joint(kind) for name, kind in pairs.items()}
    system = rewrite(Pattern.from_text(text)(parts), (FOLD, DROP_FRICTION)).system
    for rule in (DROP_GYROSCOPIC, DROP_POSE):
        found = {str(site.where).split(".")[0]: site.refusal for site in sites_of(system, rule)}
        assert len(found) == 4
        for name, refusal in found.items():
            waits = refusal.startswith("left") and refusal.endswith("comes first")
            assert waits == ("left" in name), (rule.name, name, refusal)
            assert "left" not in refusal or waits
    assert not sites_of(rewrite(two(joint("revolute")), [FOLD]).system, MERGE)


# ---- order -------------------------------------------------------------------------------------------------------

ORDERED = {
    "levers": (lever_networks(), [FOLD], 60),
    "loops of levers": (lever_networks(loops=True), [FOLD], 60),
    "joints": (mechanisms(max_bodies=2).map(lambda scene: scene.system()), [FOLD], 10),
    "weightless": (
        mechanisms(max_bodies=3, friction=False, springs=False).map(
            lambda scene: rewrite(light(scene).system(), [FOLD]).system
        ),
        RULES, 15,
    ),
    "welds": (generators.map(lambda rng: row(body(), rng, "fixed", BRICK)), MERGING, 10),
}  # fmt: skip


@pytest.mark.parametrize(
    "case", [pytest.param(name, marks=[pytest.mark.long] * (name == "weightless")) for name in ORDERED]
)
def test_the_order_makes_no_difference(case):
    """Loops of levers may end in others: how a flow divides between two ports of a box is arbitrary."""
    systems, rules, count = ORDERED[case]

    @settings(max_examples=count)
    @given(system=systems, rng=generators)
    def law(system, rng):
        one, other = (in_order(system, rules, rng) for _ in range(2))
        for done in (other, rewrite(system, rules).system) if case != "loops of levers" else ():
            assert one.pattern.isomorphic(done.pattern, fix_interface=True)
        if rules == [FOLD]:
            seed = int(rng.integers(2**32))
            same_relation(one, other, seed)
            same_relation(system, one, seed)
        if case == "welds":
            inertias = [dict(done.leaves())[Path.of("b0.ke")].kernel.parameters for done in (one, other)]
            assert largest(np.subtract(*map(np.array, inertias))) <= 1e-12
            assert len([path for path in one.states if path[-1] == "p"]) == 1

    law()


# ---- bodies that are joined rigidly -----------------------------------------------------------------------------


def rates(system, state):
    d = system.flatten().descriptor()
    return instant(d, Reference(), d.pack(state)).rates


@settings(max_examples=40)
@given(scene=mechanisms(max_bodies=4, kinds=KINDS, loops=False, heat=False), weightless=st.booleans())
def test_merged_bodies_move_as_they_did(scene, weightless):
    """ṗ = ṗ₁ + Ad*_{x⁻¹}ṗ₂ where x is constant, and all other rates are what they were."""
    assume(any(j.kind == "fixed" and "ground" not in (j.body1, j.body2) for _, j in scene.all_joints()))
    scene = light(scene) if weightless else scene
    system, start = scene.system(), initial_state(scene)
    done = rewrite(system, MERGING)
    assert any(site.rule == MERGE.name for site in done.done)
    before, after = rates(system, start), rates(done.system, done.states.forward(start))
    # the map of momenta is linear, and so the map of their rates
    mapped = done.states.forward({path: before[path] if path[-1] == "p" else start[path] for path in start})
    scale = max(1.0, *(largest(value, initial=0.0) for value in before.values()))
    for path, value in after.items():
        expected = mapped[path] if path[-1] == "p" else before[path]
        assert largest(value - expected, initial=0.0) <= 1e-8 * scale, path
    found_again(done, start, 1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_two_bodies_are_one_to_rounding(seed):
    """p = p₁ + Ad*_{x⁻¹} p₂, both have one twist, and potentials add up for any step."""
    rng = np.random.default_rng(seed)
    frames = SE3.random(rng), SE3.random(rng)
    joined = rewrite(two(joint("fixed", *frames)), (FOLD, DROP_FRICTION)).system
    x, done = SE3.compose(frames[0], SE3.inverse(frames[1])), rewrite(joined, (MERGE,))
    assert [site.rule for site in done.done] == [MERGE.name]
    carried, twist, pose = SE3.adjoint(SE3.inverse(x)), rng.standard_normal(6), SE3.random(rng)
    momenta = [np.diag([*BRICK, m, m, m]) @ u for m, u in ((1.0, twist), (2.0, carried @ twist))]
    start = {P1: momenta[0], P2: momenta[1], Q1: pose, Q2: SE3.compose(pose, x)}
    start |= {path: np.zeros(0) for path in joined.states if path not in start}
    merged = done.states.forward(start)
    assert largest(merged[P1] - (start[P1] + carried.T @ start[P2])) <= 1e-13
    assert np.array_equal(merged[Q1], pose)
    found_again(done, start)
    one, other = (dict(joined.leaves())[Path.of(f"body{i}.pe")] for i in (1, 2))
    whole, q, v = dict(done.system.leaves())[Path.of("body1.pe")], Path.of("q"), rng.standard_normal(6)

    def energy(at):
        return one.energy({q: at}) + other.energy({q: SE3.compose(at, x)})

    assert whole.energy({q: pose}) == pytest.approx(energy(pose), rel=1e-13)
    rise = energy(SE3.retract(pose, v)) - energy(pose)
    assert whole.discrete_effort({q: pose}, v, Reference()) @ v == pytest.approx(rise, rel=1e-11)
    gradient = jacobian(lambda v: energy(SE3.retract(pose, v)), 6, 1e-6)
    assert largest(whole.energy_gradient({q: pose}) - gradient) <= 1e-7
