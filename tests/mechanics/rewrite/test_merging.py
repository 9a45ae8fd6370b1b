"""Bodies that are joined rigidly: the same accelerations as one body, and every state found again."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import ephs
from ephs import Path
from ephs.mechanics import joint, mbs_pattern, rigid_body
from ephs.mechanics.rewrite.dropping import DROP_FRICTION
from ephs.mechanics.rewrite.folding import FOLD
from ephs.mechanics.rewrite.merging import MERGE
from ephs.mechanics.rewrite.rewrite import rewrite, sites_of
from ephs.mechanics.scene.build import initial_state
from ephs.mechanics.scene.model import frozen
from ephs.semantics import Reference
from ephs.semantics.spaces import SE3
from ephs.solve.equations.instant import instant
from ephs.testing import mechanisms
from tests.numerics import generators, jacobian, largest

KINDS = (*4 * ("fixed",), "revolute", "spherical", "free")
"""Most joints are fixed, that there is something to merge."""
RULES = (FOLD, DROP_FRICTION, MERGE)


def rates(system, state):
    d = system.flatten().descriptor()
    return instant(d, Reference(), d.pack(state)).rates


@settings(max_examples=40)
@given(scene=mechanisms(max_bodies=4, kinds=KINDS, loops=False, heat=False), weightless=st.booleans())
def test_merged_bodies_move_as_they_did(scene, weightless):
    """ṗ = ṗ₁ + Ad*_{x⁻¹}ṗ₂ where x is constant, and all other rates are what they were."""
    assume(any(j.kind == "fixed" and "ground" not in (j.body1, j.body2) for _, j in scene.all_joints()))
    if weightless:
        scene = replace(scene, world=replace(scene.world, gravity=frozen([0.0, 0.0, 0.0])))
    # a fixed joint has nothing to rub and nothing to heat: its friction goes first
    system, start = scene.system(), initial_state(scene)
    done = rewrite(system, RULES)
    assert any(site.rule == MERGE.name for site in done.done)
    before, after = rates(system, start), rates(done.system, done.states.forward(start))
    # the map of momenta is linear, and so the map of their rates
    mapped = done.states.forward({path: before[path] if path[-1] == "p" else start[path] for path in start})
    scale = max(1.0, *(largest(value, initial=0.0) for value in before.values()))
    for path, value in after.items():
        expected = mapped[path] if path[-1] == "p" else before[path]
        assert largest(value - expected, initial=0.0) <= 1e-8 * scale, path
    found = done.states.back(done.states.forward(start), start)
    assert set(found) == set(start)
    for path, value in start.items():
        assert largest(found[path] - value, initial=0.0) <= 1e-9 * max(1.0, largest(value, initial=0.0)), path


def two(link):
    bodies = {f"body{i}": rigid_body(float(i), [0.3, 0.4, 0.5]) for i in (1, 2)}
    return mbs_pattern()(joint=link, **bodies)


def aside(seed):
    """Two bodies that are joined rigidly, at frames that are turned and moved; where the second one is, seen from 1."""
    rng = np.random.default_rng(seed)
    frames = SE3.random(rng), SE3.random(rng)
    bodies = {f"body{i}": rigid_body(float(i), [0.3, 0.4, 0.5], [0.3, -0.2, -9.81]) for i in (1, 2)}
    joined = rewrite(mbs_pattern()(joint=joint("fixed", *frames), **bodies), (FOLD, DROP_FRICTION)).system
    return joined, SE3.compose(frames[0], SE3.inverse(frames[1])), rng


@pytest.mark.parametrize("seed", range(4))
def test_potentials_of_merged_bodies_add_up_exactly_for_any_step(seed):
    joined, x, rng = aside(seed)
    parts = dict(joined.leaves())
    one, two = (parts[Path.of(f"body{i}.pe")] for i in (1, 2))
    whole = dict(rewrite(joined, (MERGE,)).system.leaves())[Path.of("body1.pe")]
    q, pose, v = Path.of("q"), SE3.random(rng), rng.standard_normal(6)

    def energy(at):
        return one.energy({q: at}) + two.energy({q: SE3.compose(at, x)})

    assert whole.energy({q: pose}) == pytest.approx(energy(pose), rel=1e-13)
    rise = energy(SE3.retract(pose, v)) - energy(pose)
    assert whole.discrete_effort({q: pose}, v, Reference()) @ v == pytest.approx(rise, rel=1e-11)
    gradient = jacobian(lambda v: energy(SE3.retract(pose, v)), 6, 1e-6)
    assert largest(whole.energy_gradient({q: pose}) - gradient) <= 1e-7


@pytest.mark.parametrize("seed", range(4))
def test_momenta_of_merged_bodies_are_taken_together_and_found_again(seed):
    """p = p₁ + Ad*_{x⁻¹} p₂; back, both bodies have the twist of the one."""
    joined, x, rng = aside(seed)
    done = rewrite(joined, (MERGE,))
    assert [site.rule for site in done.done] == [MERGE.name]
    carried = SE3.adjoint(SE3.inverse(x))
    p1, p2, q1, q2 = (Path.of(name) for name in ("body1.ke.p", "body2.ke.p", "body1.pe.q", "body2.pe.q"))
    inertias = [np.diag([0.3, 0.4, 0.5, m, m, m]) for m in (1.0, 2.0)]
    twist, pose = rng.standard_normal(6), SE3.random(rng)
    start = {p1: inertias[0] @ twist, p2: inertias[1] @ carried @ twist, q1: pose, q2: SE3.compose(pose, x)}
    start |= {path: np.zeros(0) for path in joined.states if path not in start}
    merged = done.states.forward(start)
    assert set(merged) == set(done.system.states) >= {p1, q1}
    assert largest(merged[p1] - (start[p1] + carried.T @ start[p2])) <= 1e-13
    assert np.array_equal(merged[q1], pose)
    flipped = {**start, q2: np.concatenate([-start[q2][:4], start[q2][4:]])}
    for before in (start, flipped):  # of both quaternions of a rotation the one that it had
        found = done.states.back(done.states.forward(before), before)
        assert set(found) == set(before)
        for path, value in before.items():
            assert largest(found[path] - value, initial=0.0) <= 1e-12, path


@settings(max_examples=10)
@given(rng=generators)
def test_the_order_of_merging_makes_no_difference(rng):
    momentum = ephs.quantity.body_momentum
    junctions = {f"p{i}": ephs.junction(momentum) for i in range(4)}
    boxes = {f"b{i}": {"p": f"p{i}"} for i in range(4)} | {
        f"w{i}": {"p1": f"p{i}", "p2": f"p{i + 1}"} for i in range(3)
    }
    parts = {f"b{i}": rigid_body(1.0 + i, [0.3, 0.4, 0.5]) for i in range(4)}
    parts |= {f"w{i}": joint("fixed", SE3.random(rng), SE3.random(rng)) for i in range(3)}
    start = rewrite(ephs.Pattern(junctions=junctions, boxes=boxes)(parts), (FOLD, DROP_FRICTION)).system
    found = []
    for _ in range(2):
        done = start
        while sites := [site for site in sites_of(done, MERGE) if not site.refusal]:
            done = sites[int(rng.integers(len(sites)))].apply(done).system
        found.append(done)
    assert found[0].pattern.isomorphic(found[1].pattern)
    inertias = [dict(one.leaves())[Path.of("b0.ke")].kernel.parameters for one in found]
    assert largest(np.subtract(*map(np.array, inertias))) <= 1e-12
    assert len(found[0].states) == 2


def test_what_is_not_rigid_or_not_alone_stays():
    assert not sites_of(rewrite(two(joint("revolute")), [FOLD]).system, MERGE)
    (site,) = sites_of(rewrite(two(joint("fixed")), [FOLD]).system, MERGE)
    assert site.refusal == "joint.mf comes first"
    with pytest.raises(ephs.AssemblyError, match="comes first"):
        site.apply(rewrite(two(joint("fixed")), [FOLD]).system)
