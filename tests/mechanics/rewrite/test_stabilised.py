"""Stabilised joints: closed after every step, with second multipliers of the method's order that supply energy."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

import ephs
from benchmarks.stabilised import drifting
from ephs.mechanics.rewrite.stabilised import stabilised
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.geometry import coupling_of
from ephs.operad import Path
from ephs.semantics import AssemblyError, Reference
from ephs.semantics.meaning.step import step as plain_step
from ephs.semantics.spaces import SE3, manifold
from ephs.solve.equations.model import compile_model
from ephs.solve.methods.natural import Natural
from ephs.solve.posing.errors import OptionError
from tests.numerics import EPS, largest
from tests.scenes import shipped

UNTIL = 0.2
LENGTHS = (0.01, 5e-3, 2.5e-3)
NAMES = ("chain", "n-four-bar")
"""A tree, and loops of which three equations follow from the others."""
ROUNDING = 10.0 * 1e2 * EPS
"""Of what was solved for: ten times the condition of a step's equations, scaled, times the rounding."""


def prepared(name, make):
    problem = problem_of_scene(shipped(name))
    system = make(problem.system)
    inputs = problem.inputs(0.0, problem.initial)
    return system, problem.initial, inputs


@dataclass(frozen=True)
class Run:
    """States, largest γ of the last step, change of energy, energies turned over, sums of the ledgers, and workers."""

    states: dict
    gamma: float
    change: float
    gross: float
    sums: np.ndarray
    workers: list


def stepped(name, make, h):
    system, initial, inputs = prepared(name, make)
    model = compile_model(system.descriptor(), Reference(), inputs)
    method, d = Natural(model), model.descriptor
    x = d.pack(initial)
    after, chunk = method.advance(method.init(x), h, round(UNTIL / h))
    assert chunk.failure is None
    first = d.rate_size + d.effort_size
    workers = [i for i, slot in enumerate(d.components) if slot.primitive.name == "closing"]
    at = [first + d.components[i].multiplier + k for i in workers for k in range(6)]
    stored = np.array([slot.primitive.kind == "storage" for slot in d.components])
    changes = (chunk.rows.energies - method.energies(x))[:, stored]
    return Run(
        d.unpack(after.x), float(largest(after.z[0, at], initial=0.0)), float(changes[-1].sum()),
        float(np.abs(changes).sum(axis=1).max()), after.sums, workers,
    )  # fmt: skip


def largest_gap(name, states):
    """Largest entry of log of where two bodies put a joint's frame, from the scene's own offsets."""
    scene = shipped(name)
    worst = 0.0
    for joint in scene.joints.values():
        ends = []
        for body, frame in ((joint.body1, joint.frame1), (joint.body2, joint.frame2)):
            pose = SE3.identity() if body == "ground" else states[Path.of(f"bodies.{body}.pe.q")]
            ends.append(SE3.compose(pose, frame))
        relative = coupling_of(joint).pair.include(states[Path.of(f"joints.{joint.name}.pe.q_r")])
        gap = SE3.log(SE3.compose(SE3.inverse(ends[1]), SE3.compose(ends[0], relative)))
        worst = max(worst, float(largest(gap)))
    return worst


@pytest.mark.parametrize("name", NAMES)
def test_joints_stay_closed_and_without_second_multipliers_they_open(name):
    assert largest_gap(name, stepped(name, stabilised, LENGTHS[0]).states) <= ROUNDING
    opened = [largest_gap(name, stepped(name, drifting, h).states) for h in LENGTHS]
    assert opened[-1] > 1e3 * ROUNDING
    for one, other in pairwise(opened):
        assert one / other == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize("name", NAMES)
def test_second_multipliers_fall_with_the_order_of_the_method(name):
    found = [stepped(name, stabilised, h).gamma for h in LENGTHS]
    assert found[-1] > 0.0
    for one, other in pairwise(found):
        assert one / other == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize("name", NAMES)
def test_the_energy_changes_by_what_second_multipliers_supply(name):
    run = stepped(name, stabilised, LENGTHS[0])
    supplied = run.sums[4:][run.workers]
    rounding = np.sqrt(UNTIL / LENGTHS[0]) * ROUNDING * run.gross
    assert abs(run.change - supplied.sum()) <= rounding
    assert abs(run.change) > 1e2 * rounding  # without what they supply the balance would fail
    assert run.sums[1] == pytest.approx(float(supplied.sum()), abs=8.0 * len(supplied) * EPS * np.abs(supplied).sum())


def test_a_step_is_that_of_the_definition():
    """The compiled step and the plain one, Newton's method on the components' own Python definitions."""
    system, initial, inputs = prepared("mbs", stabilised)
    h = 0.05
    new, solved = plain_step(system, initial, h, Reference(), inputs)
    assert solved.residual <= 1e-9
    model = compile_model(system.descriptor(), Reference(), inputs)
    method = Natural(model)
    after, chunk = method.advance(method.init(model.descriptor.pack(initial)), h, 1)
    assert chunk.failure is None
    for path, value in model.descriptor.unpack(after.x).items():
        assert largest(value - new[path], initial=0.0) <= 1e-9


def test_in_continuous_time_the_closing_components_are_empty():
    """At an instant no flow and no condition, a Dirac structure; over a step it is none."""
    system, _, _ = prepared("chain", stabilised)
    closings = [part for _, part in system.flatten().leaves() if part.name == "closing"]
    assert len(closings) == 4
    for part in closings:
        skew, constraint = part.structure({})
        assert not skew.any() and not constraint.any()
        assert part.verdict.conditions and part.working
        rng = np.random.default_rng(0)
        x0 = {port: manifold(part.interface[port].quantity.space).random(rng) for port in part.reads}
        v = {port: 0.01 * rng.standard_normal(part.interface[port].quantity.space.dim) for port in part.reads}
        e = rng.standard_normal(part.bundle.size)
        moved, closed = part.discrete(0.01, x0, v, e)
        assert largest(moved @ e - closed) > 0.1  # C_h e = F would be a Dirac structure


def test_frames_without_mass_are_refused():
    with pytest.raises(AssemblyError, match="no body with inertia"):
        prepared("universal", stabilised)


def test_methods_whose_stages_close_nothing_are_refused():
    system, initial, _ = prepared("chain", stabilised)
    start = {str(path): value for path, value in initial.items()}
    for method in ("natural4", "rk87"):
        with pytest.raises(OptionError, match="natural"):
            ephs.simulate(system, 0.1, initial=start, method=method)
