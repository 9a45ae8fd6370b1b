"""Folding: the same relation in fewer unknowns, at an instant and over a step, whatever is folded first."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import Path, System, quantity
from ephs.mechanics import joint
from ephs.mechanics.elements import components
from ephs.mechanics.rewrite.folding import FOLD
from ephs.mechanics.rewrite.rewrite import rewrite
from ephs.mechanics.scene.build import scene_system
from ephs.operad import PortType
from ephs.semantics import StructureError
from ephs.semantics.primitives.pullback import Map, pull_back
from ephs.semantics.spaces import PAIRS, SE3, pair
from ephs.semantics.verdicts.checks import random_point
from ephs.semantics.verdicts.search import search
from ephs.testing import mechanisms
from tests.mechanics.kernels import Draw, agreeing
from tests.mechanics.rewrite.rewriting import same_relation
from tests.numerics import generators, largest, seeds
from tests.scenes import of_all_scenes, shipped

MOMENTUM = PortType(quantity.body_momentum, True)


def joint_pair(kind):
    return pair(kind, **dict.fromkeys(PAIRS[kind].parameters, 0.3))


# ---- primitives through maps -----------------------------------------------------------------------------------


def pulled(kind, seed, first, second):
    """A joint's relation seen from the bodies; an end is at an offset, as it is, or on the ground."""
    rng = np.random.default_rng(seed)
    ends = {
        "offset": lambda: Map(SE3.adjoint(SE3.inverse(SE3.random(rng))), MOMENTUM),
        "plain": lambda: Map(np.eye(6), MOMENTUM),
        "ground": lambda: Map(np.zeros((6, 0)), None),
    }
    inner = components.holonomic(joint_pair(kind))
    maps = {Path.of("p_j1"): ends[first](), Path.of("p_j2"): ends[second]()}
    return inner, pull_back(inner, maps)


@pytest.mark.parametrize("kind", PAIRS)
@settings(max_examples=15)
@given(seed=seeds, ends=st.sampled_from(["offset offset", "plain offset", "ground offset", "offset ground"]))
def test_a_joint_seen_from_its_bodies_has_a_kernel_that_is_its_definition(kind, seed, ends):
    inner, outer = pulled(kind, seed, *ends.split())
    assert outer.verdict == "proved" and search(outer, 5)
    assert replace(outer.kernel.relation, maps=None) == inner.kernel.relation
    agreeing(Draw(outer, seed, 0.1))


@settings(max_examples=15)
@given(seed=seeds)
def test_friction_and_traced_constraints_keep_their_kernels(seed):
    rng = np.random.default_rng(seed)
    inner = components.joint_friction(joint_pair("spherical"), np.eye(3))
    momentum = PortType(quantity.joint_momentum("spherical"), True)
    outer = pull_back(inner, {Path.of("p_r"): Map(rng.standard_normal((3, 3)), momentum)})
    assert outer.verdict == "proved" and search(outer, 5)
    assert replace(outer.kernel.relation, maps=None) == inner.kernel.relation
    agreeing(Draw(outer, seed, 0.1))
    traced = ephs.constraint(
        {"p": quantity.body_momentum, "p2": quantity.momentum, "~q": quantity.pose},
        lambda q: [[q[1] * q[0], q[2] ** 2, 0.0, q[4], 0.0, 1.0, q[5]]],
    )
    agreeing(Draw(pull_back(traced, {Path.of("p"): Map(rng.standard_normal((6, 6)), MOMENTUM)}), seed, 0.1))


@given(rng=generators)
def test_maps_in_series_multiply(rng):
    """Pulling back twice is pulling back by the product, in the plain relation and in the numbers of the kernel."""
    inner = components.holonomic(joint_pair("cylindrical"))
    first, second = rng.standard_normal((2, 6, 6))
    port = Path.of("p_j1")
    twice = pull_back(pull_back(inner, {port: Map(first, MOMENTUM)}), {port: Map(second, MOMENTUM)})
    once = pull_back(inner, {port: Map(first @ second, MOMENTUM)})
    assert replace(twice.kernel.relation, maps=None) == inner.kernel.relation
    assert np.allclose(twice.kernel.parameters, once.kernel.parameters, rtol=1e-13, atol=1e-13)
    x = random_point(twice.bundle, twice.reads, rng)
    one, other = twice.structure(x)[1], once.structure(x)[1]
    assert largest(one - other) <= 1e-13 * largest(one)


def test_a_map_of_entropy_ports_is_checked():
    """Half the temperature elsewhere is no frame to see friction from."""
    inner = components.joint_friction(joint_pair("revolute"), np.eye(1))
    with pytest.raises(StructureError):
        pull_back(inner, {Path.of("s"): Map(np.array([[0.5]]), PortType(quantity.entropy, True))})


# ---- systems ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", PAIRS)
@settings(max_examples=5)
@given(seed=seeds)
def test_a_folded_joint_has_the_relation_and_the_matrix_of_the_literature(kind, seed):
    """C' = [Ad_{I⁻¹}Ad_{o₁⁻¹}, −Ad_{o₂⁻¹}, B]."""
    rng = np.random.default_rng(seed)
    of = joint_pair(kind)
    o1, o2 = SE3.random(rng), SE3.random(rng)
    pitch = dict(of.parameters).get("pitch", 0.0)
    system = joint(kind, o1, o2, 0.2, 1.5, pitch=pitch)
    done = rewrite(system, [FOLD])
    same_relation(system, done.system, seed)
    left = dict(done.system.leaves())
    assert {str(path) for path in left} == {"hc", "pe", "pkc", "mf", "env"}
    x = random_point(left[Path.of("hc")].bundle, left[Path.of("hc")].reads, rng)
    (pose,) = (of.include(value) for value in x.values())
    ad = [SE3.adjoint(SE3.inverse(o)) for o in (pose, o1, o2)]
    expected = np.hstack([ad[0] @ ad[1], -ad[2], of.basis])
    _, found = left[Path.of("hc")].structure(x)
    assert largest(found - expected) <= 1e-14 * max(1.0, largest(expected))


@settings(max_examples=25)
@given(scene=mechanisms(max_bodies=2), seed=seeds)
def test_a_folded_mechanism_has_the_same_relation(scene, seed):
    system = scene_system(scene, wrenches=[name for name, _ in scene.all_bodies()])
    done = rewrite(system, [FOLD])
    assert sum(path[-1] in ("o1", "o2") for path, _ in done.system.leaves()) == 0
    assert set(done.system.states) == set(system.states)
    same_relation(system, done.system, seed)


# ---- steps -----------------------------------------------------------------------------------------------------


def agree(scene, method, step, steps):
    """Paper and folded forms after some steps, relative to the states' sizes; 1e-12 a step, accurate or not."""
    paper, folded = (
        ephs.simulate(scene, steps * step, step=step, method=method, form=form, audit="off")
        for form in ("paper", "folded")
    )
    assert list(paper) == list(folded)
    for path in paper:
        scale = max(1.0, float(largest(paper[path], initial=0.0)))
        assert largest(paper[path] - folded[path], initial=0.0) <= steps * 1e-12 * scale, path
    fewer = paper.stats["unknowns"] - folded.stats["unknowns"]
    assert fewer > 0 if dict(scene.all_joints()) else fewer == 0  # a body alone has no frame but its own
    assert folded.summary()["unknowns"] == {"paper": paper.stats["unknowns"], "used": folded.stats["unknowns"]}
    scale = 1.0 + largest(paper.energy)
    for totals in ("energy", "heat", "work", "entropy", "kinetic", "potential"):
        assert largest(getattr(paper, totals) - getattr(folded, totals)) <= steps * 1e-12 * scale, totals
    return paper, folded


@pytest.mark.parametrize("method", ["natural", "natural4"])
@of_all_scenes
def test_folded_steps_are_the_same_steps(file, method):
    scene = ephs.load(file)
    agree(scene, method, 5e-4 if file.stem == "heavy-top" else 2e-3, 8)


@pytest.mark.parametrize("method", ["natural", "natural4"])
@pytest.mark.parametrize("stem", ["mbs", "chain"])
def test_coarse_steps_are_the_same_too(stem, method):
    """There the corrections are large: measured in the frames of the bodies they would be others."""
    agree(shipped(stem), method, 0.1 if stem == "mbs" else 0.05, 4)


@pytest.mark.parametrize("stem", ["four-bar", "universal"])
def test_everything_that_is_read_from_a_motion_is_there(stem):
    scene = shipped(stem)
    paper, folded = agree(scene, "natural", 2e-3, 2)
    for name, _ in scene.all_joints():
        one, other = paper.joint(name), folded.joint(name)
        assert np.allclose(one.coordinate, other.coordinate, atol=1e-11)
        assert np.allclose(one.rate, other.rate, atol=1e-9)
        assert np.allclose(one.wrench, other.wrench, atol=1e-6, equal_nan=True)
    for name, _ in scene.all_bodies():
        assert np.allclose(paper.body(name).velocity, folded.body(name).velocity, atol=1e-9)
    assert set(folded.ledger().parts) == set(paper.ledger().parts)
    assert folded.system == paper.system


@pytest.mark.parametrize("method", ["natural", "natural4"])
@settings(max_examples=6)
@given(scene=mechanisms(max_bodies=3))
def test_and_in_generated_mechanisms(method, scene):
    agree(scene, method, 5e-3, 4)


def test_chosen_steps_inputs_and_events_are_served():
    """What reads states reads the same states; the energies of dense output are the same too."""
    scene = shipped("four-bar")
    found = [
        ephs.simulate(
            scene,
            0.3,
            method="natural4",
            form=form,
            rtol=1e-6,
            atol=1e-6,
            save_at=[0.1, 0.25],
            inputs={"joints.main": lambda t, state: 0.1 - 0.01 * float(state["bodies.crank.ke.p"][0])},
            events=[ephs.Event(lambda t, state: t - 0.2, "then")],
        )
        for form in ("paper", "folded")
    ]
    for path in found[0]:
        assert np.allclose(found[0][path], found[1][path], rtol=1e-6, atol=1e-6)
    assert found[0].energy[-1] == pytest.approx(found[1].energy[-1], rel=1e-8)
    assert found[0].events[0].t == pytest.approx(0.2)
    states = [one.events[0].state["bodies.rocker.pe.q"] for one in found]
    assert np.allclose(*states, atol=1e-6)


def test_a_failed_run_keeps_the_papers_solution():
    scene = shipped("heavy-top")
    with pytest.raises(ephs.SimulationError) as failed:
        ephs.simulate(scene, 1.0, step=0.1, method="natural", form="folded")
    assert failed.value.partial["bodies.top.pe.q"].shape[1] == 7


def test_methods_in_joint_coordinates_have_no_folded_form():
    scene = shipped("mbs")
    with pytest.raises(ephs.OptionError, match="form is 'folded', expected reduced"):
        ephs.simulate(scene, 1.0, method="rk87", form="folded")
    assert ephs.simulate(scene, 0.01, form="folded").stats["method"] == "natural4"
    assert isinstance(ephs.simulate(scene, 0.01, form="folded").system, System)
