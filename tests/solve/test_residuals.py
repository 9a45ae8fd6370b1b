"""What residuals of the natural method are measured by, against the same over whole matrices."""

import numpy as np
import pytest
from hypothesis import given

from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.semantics.stage import Entry, Evaluator, Program, Vector, vector
from ephs.solve.methods.moves import tighten
from ephs.solve.methods.residuals import evaluation_program
from ephs.solve.methods.scales import SPREAD, TAKES_PART
from ephs.solve.running.snapshot import parts
from tests.numerics import generators, seeds
from tests.scenes import model_of, shipped

CALLS = evaluation_program().compiled()


@pytest.fixture(scope="module")
def model():
    """Joints with friction and with springs, heat, and a motor's torque."""
    problem = problem_of_scene(shipped("slider-crank"))
    return model_of(problem)


def measure(t, z, dropped, memory):
    return CALLS["measure"](parts(t), z, dropped, parts(memory))


def filled(model, seed):
    """(counts of rates and efforts, matrix, scale, memory): entries of any size, some of them zero."""
    rng = np.random.default_rng(seed)
    t, memory = model.tables, model.memory()
    memory.data[:] = rng.standard_normal(memory.data.size) * 10.0 ** rng.uniform(-5.0, 2.0, memory.data.size)
    memory.data[rng.random(memory.data.size) < 0.2] = 0.0
    memory.data[-model.unknowns :] = 0.0  # what the loop adds counts for nothing
    memory.scale[:] = 10.0 ** rng.uniform(-3.0, 3.0, memory.scale.size)
    matrix = np.zeros((model.unknowns, model.unknowns))
    np.maximum.at(matrix, (t.row, t.column), np.abs(memory.data))
    return int(t.counts[0]), int(t.counts[1]), matrix, memory.scale.copy(), memory


@given(seed=seeds)
def test_flows_that_there_could_be(model, seed):
    rates, count, matrix, scale, memory = filled(model, seed)
    t = model.tables
    efforts = slice(rates, rates + count)
    CALLS["reach"](parts(t), parts(memory))
    largest = matrix[:, efforts].max(axis=1)
    block = np.zeros(memory.block.size)
    np.maximum.at(block, t.block, scale)
    whole = np.zeros(count)
    for row in range(rates + count, model.unknowns):
        for effort in range(count):
            entry = matrix[row, rates + effort]
            if entry > TAKES_PART * largest[row]:
                whole[effort] = max(whole[effort], block[t.block[row]] / entry)
    expected = np.maximum(scale[efforts], (matrix[efforts, efforts] * whole).max(axis=1))
    assert np.allclose(memory.dense[:count], expected, rtol=1e-14, atol=0.0)


@given(seed=seeds)
def test_efforts_of_storages_are_known_to_the_rounding_of_their_balances(model, seed):
    rates, count, matrix, scale, memory = filled(model, seed)
    t = model.tables
    CALLS["weigh"](parts(t), parts(memory))
    expected = scale.copy()
    with np.errstate(divide="ignore"):
        least = np.where(matrix > 0.0, scale[:, None] / matrix, np.inf)[rates:, rates : rates + count].min(axis=0)
    for i, slot in enumerate(model.descriptor.components):
        for port in range(len(slot.efforts) if t.kind[i] == 0 else 0):
            row, effort = t.read_w[t.read_w_at[i] + port], t.e_index[t.e_at[i] + port]
            if np.isfinite(least[effort]):
                expected[row] = max(expected[row], least[effort])
    assert np.allclose(memory.scale, expected, rtol=1e-14, atol=0.0)
    assert (memory.scale > scale).any()


@given(seed=seeds)
def test_residuals_are_relative_to_their_blocks(model, seed):
    *_, scale, memory = filled(model, seed)
    t, rng = model.tables, np.random.default_rng(seed + 1)
    residual, z = rng.standard_normal((2, model.unknowns))
    dropped = (rng.random(model.unknowns) < 0.2).astype(np.int64)
    memory.residual[:] = residual
    block, group = np.zeros(memory.block.size), np.zeros(memory.group.size)
    np.maximum.at(block, t.block, scale)
    np.maximum.at(group, t.group[t.block], scale)
    ratio = np.abs(residual) / np.maximum(block[t.block], SPREAD * group[t.group[t.block]])
    assert measure(t, z, dropped, memory) == pytest.approx(ratio[dropped == 0].max(), rel=1e-14)
    assert memory.defect[0] == pytest.approx(ratio[dropped == 1].max(initial=0.0), rel=1e-14)
    assert np.array_equal(memory.residual, np.where(dropped == 1, z, residual))
    memory.residual[:], memory.scale[:] = residual, 0.0
    assert measure(t, z, dropped, memory) == memory.defect[0] == 0.0
    memory.residual[:], memory.scale[:] = np.nan, 1.0
    assert np.isnan(measure(t, z, dropped, memory))


@given(rng=generators)
def test_quaternions_that_are_off_by_rounding_come_back(rng):
    q = rng.standard_normal(4)
    unit = q / np.linalg.norm(q)
    off = unit * (1.0 + 1e-6)

    def tightened(_: Evaluator, q: Vector) -> None:
        tighten(q)

    Program("tight", tightened=Entry(tightened, q=vector(4))).plain()["tightened"](off)
    assert np.abs(off - unit).max() <= 1e-11
