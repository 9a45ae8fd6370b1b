"""Rank of constraint rows, least corrections, multipliers: against their definitions; the same bits by both runs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ephs.semantics.linear.rows import row_program
from ephs.semantics.spaces.rank import EXPLICIT
from tests.numerics import EPS, largest, seeds

RUNS = {"compiled": row_program().compiled(), "plain": row_program().plain()}


class Solved:
    """Everything that one run makes of rows, a mass matrix and targets."""

    def __init__(self, run, row, mass, target):
        m, n = row.shape
        factor = np.zeros((n, n))
        assert run["cholesky"](mass, factor) == 0
        terms = np.abs(row) @ (1.0 / np.diag(factor)) if n else np.zeros(m)
        self.chosen, self.step = np.zeros(m, dtype=np.int64), np.zeros(max(m, n))
        self.scaled, self.triangle = np.zeros((m, n)), np.zeros((m, m))
        rows = (row, terms, factor, self.scaled, np.zeros((m, n)), self.triangle, self.chosen)
        self.rank = run["orthonormalise"](*rows, m)
        self.change, self.multiplier = np.zeros(n), np.zeros(m)
        run["correct"](*rows, self.rank, target, self.step, self.change)
        run["multipliers"](*rows, m, self.rank, self.step, self.multiplier)


@st.composite
def problems(draw):
    """(rows, mass matrix, attainable targets, rank): rows are integer combinations of as many integer rows."""
    n, m = draw(st.integers(1, 7)), draw(st.integers(1, 6))
    rank = draw(st.integers(0, min(n, m)))
    rng = np.random.default_rng(draw(seeds))
    base = np.eye(rank, n)[:, rng.permutation(n)] * rng.choice([-2.0, 1.0], (rank, 1))
    mixed = np.eye(m, rank)[rng.permutation(m)] + np.where(rng.random((m, rank)) < 0.2, 1.0, 0.0)
    mixed[:rank] = np.eye(rank)
    row = mixed @ base
    root = np.eye(n) + 0.3 * rng.standard_normal((n, n)) / np.sqrt(n)
    return row, root @ root.T, row @ rng.standard_normal(n), rank


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
@given(problems())
@settings(max_examples=40)
def test_rank_least_corrections_and_multipliers_are_those_of_the_definition(run, problem):
    row, mass, target, rank = problem
    found = Solved(run, row, mass, target)
    assert found.rank == rank
    # least in the mass metric: x = M⁻¹ Jᵀ (J M⁻¹ Jᵀ)⁺ target
    right = np.linalg.solve(mass, row.T)
    least = right @ np.linalg.pinv(row @ right, rcond=1e-9) @ target
    condition = np.linalg.cond(mass) * (1.0 + np.linalg.cond(row[found.chosen[:rank]]) ** 2 if rank else 1.0)
    scale = largest(least) + largest(target)
    assert largest(found.change - least) <= 100.0 * EPS * condition * scale
    assert largest(row.T @ found.multiplier - mass @ found.change) <= 100.0 * EPS * condition * scale
    assert not found.multiplier[found.chosen[rank:]].any()
    basis = found.scaled[found.chosen[:rank]]
    assert largest(basis @ basis.T - np.eye(rank), initial=0.0) <= 8.0 * len(mass) * EPS


@given(problems(), st.sampled_from([0.0, 1e-13, 1e-9, 1e-5, 1e-3]))
@settings(max_examples=25)
def test_floats_and_machine_code_give_the_same_bits(problem, size):
    row, mass, target, _ = problem
    row = row + size * np.random.default_rng(0).standard_normal(row.shape)
    one, two = (Solved(run, row, mass, target) for run in RUNS.values())
    assert one.rank == two.rank
    for name in ("chosen", "triangle", "scaled", "change", "multiplier"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
@pytest.mark.parametrize(("angle", "rank"), [(0.5 * EXPLICIT, 1), (2.0 * EXPLICIT, 2)])
def test_rows_repeat_each_other_below_the_threshold(run, angle, rank):
    row = np.array([[1.0, 0.0], [1.0, angle]])
    assert Solved(run, row, np.eye(2), np.zeros(2)).rank == rank


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
def test_rows_that_differ_only_by_what_moves_heavy_bodies_are_two(run):
    """In the mass metric alone the second would be nothing; without masses both are rows of length one."""
    row = np.array([[1.0, 0.0], [1.0, 1.0]])
    heavy = np.diag([1.0, 1e2 / EXPLICIT**2])
    assert Solved(run, row, heavy, np.zeros(2)).rank == 2
    assert Solved(run, np.array([[1.0, 0.0], [1.0, 1e-1 * EXPLICIT]]), heavy, np.zeros(2)).rank == 1


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
def test_a_row_that_cancels_to_rounding_is_no_equation(run):
    n = 3
    row, factor = np.full((1, n), 1e-13), np.eye(n)
    arrays = (row, np.array([1.0]), factor, np.zeros((1, n)), np.zeros((1, n)), np.zeros((1, 1)))
    assert run["orthonormalise"](*arrays, np.zeros(1, dtype=np.int64), 1) == 0
    assert run["orthonormalise"](row, np.array([1e-13]), *arrays[2:], np.zeros(1, dtype=np.int64), 1) == 1
