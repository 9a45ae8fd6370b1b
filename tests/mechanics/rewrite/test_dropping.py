"""What has no effect is dropped, what has one is not: relations, steps and states before and after, and refusals."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import Path, Pattern, System, junction, quantity
from ephs.mechanics import joint, mbs_pattern, rigid_body
from ephs.mechanics.elements.components import ground
from ephs.mechanics.rewrite.dropping import DROP_FRICTION, DROP_GYROSCOPIC, DROP_JOINT, DROP_POSE
from ephs.mechanics.rewrite.folding import FOLD
from ephs.mechanics.rewrite.rewrite import Strength, rewrite, sites_of
from ephs.mechanics.rewrite.rules import RULES
from ephs.mechanics.runs.running import by_constant_steps
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.scene.build import initial_state
from ephs.mechanics.scene.model import frozen
from ephs.semantics import Reference
from ephs.semantics.spaces import SE3
from ephs.testing import mechanisms
from tests.mechanics.mechanisms import on_ground
from tests.numerics import generators, largest

NONE = (0.0, 0.0, 0.0)
TURNED = SE3.exp(np.array([0.3, 0.4, 0.1, 0.0, 0.0, 0.0]))
BALL, BRICK, SKEW = [0.4, 0.4, 0.4], [0.3, 0.4, 0.5], [0.3, 0.4, 0.5, 0.0, 0.1, 0.05]


def refusals(system, rule):
    return [site.refusal for site in sites_of(system, rule) if site.refusal]


def paths(system):
    return {str(path) for path, _ in system.flatten().leaves()}


def same_on_what_is_kept(before, done, state):
    """The two relations agree on the kept rates and the outer ports, at a state."""
    one = before.relation(Reference()).at({str(p): v for p, v in state.items()})
    other = done.system.relation(Reference()).at({str(p): v for p, v in done.states.forward(state).items()})
    assert one.linear.onto(other.order).same(other.linear)


# ---- gyroscopic forces ------------------------------------------------------------------------------------------


def slides(count):
    """Bodies that slide one on the other, in directions of their own."""
    momentum = quantity.body_momentum
    junctions = {f"p{i}": junction(momentum) for i in range(count + 1)}
    boxes = {"ground": {"p": "p0"}}
    parts = {"ground": ground()}
    rng = np.random.default_rng(3)
    for i in range(1, count + 1):
        boxes[f"body{i}"], parts[f"body{i}"] = {"p": f"p{i}"}, rigid_body(1.0, SKEW)
        boxes[f"joint{i}"] = {"p1": f"p{i - 1}", "p2": f"p{i}"}
        parts[f"joint{i}"] = joint("prismatic", SE3.random(rng), SE3.random(rng))
    return Pattern(junctions=junctions, boxes=boxes)(parts)


@pytest.mark.parametrize("folded", [False, True])
@pytest.mark.parametrize(
    ("system", "dropped"),
    [
        (slides(3), 3),
        (on_ground(rigid_body(1.0, BRICK), joint("revolute", stiffness=2.0, rest=0.7)), 1),
        (on_ground(rigid_body(1.0, BALL), joint("revolute", None, TURNED, stiffness=2.0, rest=0.7)), 1),
        (rigid_body(1.0, BALL, group="SO3xR3"), 0),
    ],
)
def test_gyroscopic_forces_that_vanish_are_dropped(system, dropped, folded):
    """Weight and springs set all in motion: the steps stay the same."""
    system = rewrite(system, [FOLD]).system if folded else system
    done = rewrite(system, [DROP_GYROSCOPIC])
    assert len(done.done) == dropped
    if not dropped:
        assert "wrench from outside" in refusals(system, DROP_GYROSCOPIC)[0]
        return
    one, other = (by_constant_steps(problem_of_system(of), 0.4, 0.02) for of in (system, done.system))
    assert max(largest(one[path][-1], initial=0.0) for path in one if path[-1] == "p") > 0.1
    for path in one:
        assert largest(one[path] - other[path], initial=0.0) <= 20 * 1e-13 * max(1.0, largest(one[path], initial=0.0))


def test_in_world_axes_a_round_inertia_is_enough():
    body = rigid_body(1.0, BALL, group="SO3xR3")
    momentum = quantity.direct_momentum
    alone = Pattern(junctions={"p": junction(momentum)}, boxes={"body": {"p": "p"}})
    (site,) = sites_of(alone(body=body), DROP_GYROSCOPIC)
    assert "world axes" in site.reason
    assert not site.refusal
    (site,) = sites_of(alone(body=rigid_body(1.0, BRICK, group="SO3xR3")), DROP_GYROSCOPIC)
    assert site.refusal


AXIS = TURNED
ASIDE = SE3.exp(np.array([0.0, 0.0, 0.0, 0.5, 0.0, 0.0]))
PLANE = "in planar motion, too, the transport term"


@pytest.mark.parametrize(
    ("body", "link", "words"),
    [
        (rigid_body(1.0, BALL), joint("free"), "same about all axes the transport term p_υ × ω remains"),
        (rigid_body(1.0, BALL), joint("spherical", None, ASIDE), "the transport term p_υ × ω remains"),
        (rigid_body(1.0, BRICK), joint("planar"), PLANE),
        (rigid_body(1.0, BRICK), joint("revolute", None, ASIDE), PLANE),
        (rigid_body(1.0, BRICK), joint("revolute", None, AXIS), "not only about a principal axis"),
        (rigid_body(1.0, BRICK), joint("spherical"), "not only about a principal axis"),
        (rigid_body(1.0, BRICK), joint("cylindrical", None, AXIS), "not only about a principal axis"),
    ],
)
def test_gyroscopic_forces_are_not_dropped_for_a_round_inertia_or_a_plane(body, link, words):
    system = on_ground(body, link)
    (site,) = sites_of(system, DROP_GYROSCOPIC)
    assert words in site.refusal
    with pytest.raises(ephs.AssemblyError, match="would change the meaning of the system"):
        site.apply(system)
    assert not rewrite(system, [DROP_GYROSCOPIC]).done


def test_what_is_refused_would_change_the_motion():
    """The forces of a round body that turns and moves are as large as its momenta."""
    system = on_ground(rigid_body(2.0, BALL, NONE), joint("free"))
    u = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    lp = dict(system.leaves())[Path.of("body.lp")]
    force = lp.structure({Path.of("p"): np.array([0.4, 0.4, 0.4, 2.0, 2.0, 2.0]) * u})[0] @ u
    assert largest(force[:3]) <= 1e-15
    assert largest(force[3:]) == pytest.approx(2.0)


# ---- friction, poses, joints --------------------------------------------------------------------------------------


def test_friction_without_resistance_goes_with_its_environment():
    system = on_ground(rigid_body(1.0, BRICK), joint("revolute", ASIDE, None, 0.0, 2.0))
    done = rewrite(system, [DROP_FRICTION])
    assert paths(system) - paths(done.system) == {"joint.mf", "joint.env"}
    same_on_what_is_kept(system, done, system.state({"body.ke.p": np.zeros(6)}))
    start = system.state({"joint.env.s": 3.0})
    assert done.states.back(done.states.forward(start), start)[Path.of("joint.env.s")] == 3.0


@pytest.mark.parametrize("friction", [0.1, lambda x, u, theta: np.zeros((1, 1))], ids=["number", "function"])
def test_friction_that_may_resist_stays(friction):
    """Of a function one cannot know: it is zero where it was asked, and may not be elsewhere."""
    system = on_ground(rigid_body(1.0, BRICK), joint("revolute", ASIDE, None, friction))
    assert refusals(system, DROP_FRICTION) == ["it may dissipate: its resistance is not zero"]


def test_friction_that_heats_nothing_leaves_the_node():
    pattern = Pattern.from_text(
        "g: body_momentum; p: body_momentum; s: entropy; ground(p=g); body(p); joint(p1=g, p2=p, s); node(s)"
    )
    node = ephs.mechanics.elements.components.thermal_node(10.0, 300.0)
    system = pattern(ground=ground(), body=rigid_body(1.0, BRICK), joint=joint("revolute", heat=True), node=node)
    done = rewrite(system, [DROP_FRICTION])
    assert paths(system) - paths(done.system) == {"joint.mf"}
    same_on_what_is_kept(system, done, system.state())


def test_a_pose_goes_where_no_potential_depends_on_it():
    system = on_ground(rigid_body(1.0, BRICK, NONE), joint("spherical", ASIDE, AXIS))
    done = rewrite(system, [DROP_POSE])
    assert paths(system) - paths(done.system) == {"body.pe", "body.pkc"}
    same_on_what_is_kept(system, done, system.state())


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (on_ground(rigid_body(1.0, BRICK), joint("spherical")), "its potential changes with the pose"),
        (rigid_body(1.0, BRICK, NONE), "it could not be computed from the others"),
        (
            mbs_pattern()(
                body1=rigid_body(1.0, BRICK, NONE), body2=rigid_body(1.0, BRICK, NONE), joint=joint("revolute")
            ),
            "",
        ),
    ],
)
def test_a_pose_stays_where_it_matters_or_would_be_lost(system, words):
    """Of two bodies that float together one keeps its pose: where they are is known by it."""
    done = rewrite(system, [DROP_POSE])
    kept = [path for path in done.system.states if path[-1] == "q"]
    assert len(kept) == 1
    if words:
        assert any(words in refusal for refusal in refusals(system, DROP_POSE))
    else:
        assert len(done.done) == 1


def test_a_joint_that_holds_nothing_goes_and_its_coordinates_are_found_again():
    system = on_ground(rigid_body(1.0, BRICK), joint("free", ASIDE, AXIS))
    done = rewrite(system, [FOLD, DROP_FRICTION, DROP_JOINT])
    assert paths(done.system) == {"body.pe", "body.pkc", "body.ke", "body.lp"}
    rng = np.random.default_rng(5)
    q = SE3.random(rng)
    relative = SE3.compose(SE3.compose(SE3.inverse(ASIDE), q), AXIS)
    start = system.state({"body.pe.q": q, "joint.pe.q_r": relative, "body.ke.p": rng.standard_normal(6)})
    found = done.states.back(done.states.forward(start), start)
    assert largest(found[Path.of("joint.pe.q_r")] - start[Path.of("joint.pe.q_r")]) <= 1e-14
    same_on_what_is_kept(system, done, start)


@pytest.mark.parametrize(
    ("link", "words"),
    [
        (joint("free", stiffness=1.0), "its spring pulls"),
        (joint("free", friction=0.5), "joint.mf acts on its rate"),
    ],
)
def test_a_joint_that_does_something_stays(link, words):
    assert words in refusals(on_ground(rigid_body(1.0, BRICK), link), DROP_JOINT)[0]


# ---- all together ----------------------------------------------------------------------------------------------


def light(scene):
    """Without gravity, so that poses matter to nobody."""
    return replace(scene, world=replace(scene.world, gravity=frozen([0.0, 0.0, 0.0])))


@settings(max_examples=15)
@given(scene=mechanisms(max_bodies=3, friction=False), floating=st.booleans())
def test_reduced_systems_take_the_same_steps_and_every_state_is_found_again(scene, floating):
    scene = light(scene) if floating else scene
    system = scene.system()
    done = rewrite(system, [rule for rule in RULES if rule.strength == Strength.RELATION])
    start = initial_state(scene)
    step, steps = 5e-3, 4
    runs = []
    for of, state in ((system, start), (done.system, done.states.forward(start))):
        problem = problem_of_system(of, {str(p): v for p, v in state.items()})
        runs.append(by_constant_steps(problem, step * steps, step))
    before, after = (run.state_at(steps) for run in runs)
    found = done.states.back(after, start)
    assert set(found) == set(before)
    for path, value in before.items():
        scale = max(1.0, largest(value, initial=0.0))
        assert largest(value - found[path], initial=0.0) <= steps * 1e-12 * scale, path


@settings(max_examples=15)
@given(scene=mechanisms(max_bodies=3, friction=False, springs=False), rng=generators)
def test_the_order_of_dropping_makes_no_difference(scene, rng):
    start = rewrite(light(scene).system(), [FOLD]).system
    found = []
    for _ in range(2):
        done = start
        while sites := [site for rule in RULES for site in sites_of(done, rule) if not site.refusal]:
            done = sites[int(rng.integers(len(sites)))].apply(done).system
        found.append(done)
    assert isinstance(found[0], System)
    assert found[0].pattern.isomorphic(found[1].pattern, fix_interface=True)
    assert rewrite(start, RULES).system.pattern.isomorphic(found[0].pattern, fix_interface=True)
