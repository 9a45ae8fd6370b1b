"""Rank of constraint rows, least corrections, multipliers: against their definitions; the same bits by both runs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ephs.semantics.linear.rows import row_program
from ephs.semantics.spaces.rank import EXPLICIT
from tests.numerics import EPS, generators, largest
from tests.staged import run_both


def run(entry, *arguments):
    return run_both(row_program(), entry, *arguments)


def solved(row, mass, target, run=run):
    """Rank, chosen and scaled rows, least correction and multipliers of rows, a mass matrix and targets.

    ``run`` gives the result of an entry function, and its arguments as they are left.
    """
    m, n = row.shape
    failed, _, factor = run("cholesky", mass, np.zeros((n, n)))
    assert failed == 0
    terms = np.abs(row) @ (1.0 / np.diag(factor)) if n else np.zeros(m)
    made = np.zeros((m, n)), np.zeros((m, n)), np.zeros((m, m)), np.zeros(m, dtype=np.int64)
    rank, *rows, _ = run("orthonormalise", row, terms, factor, *made, m)
    _, *rows, _, _, step, change = run("correct", *rows, rank, target, np.zeros(max(m, n)), np.zeros(n))
    *_, multiplier = run("multipliers", *rows, m, rank, step, np.zeros(m))
    return rank, rows[6], rows[3], change, multiplier


@st.composite
def problems(draw):
    """(rows, mass matrix, attainable targets, rank): rows are integer combinations of as many integer rows."""
    n, m = draw(st.integers(1, 7)), draw(st.integers(1, 6))
    rank = draw(st.integers(0, min(n, m)))
    rng = draw(generators)
    base = np.eye(rank, n)[:, rng.permutation(n)] * rng.choice([-2.0, 1.0], (rank, 1))
    mixed = np.eye(m, rank)[rng.permutation(m)] + np.where(rng.random((m, rank)) < 0.2, 1.0, 0.0)
    mixed[:rank] = np.eye(rank)
    row = mixed @ base
    root = np.eye(n) + 0.3 * rng.standard_normal((n, n)) / np.sqrt(n)
    return row, root @ root.T, row @ rng.standard_normal(n), rank


@settings(max_examples=80)
@given(problems())
def test_rank_least_corrections_and_multipliers_are_those_of_the_definition(problem):
    row, mass, target, rank = problem
    found, chosen, scaled, change, multiplier = solved(row, mass, target)
    assert found == rank
    # least in the mass metric: x = M⁻¹ Jᵀ (J M⁻¹ Jᵀ)⁺ target
    right = np.linalg.solve(mass, row.T)
    least = right @ np.linalg.pinv(row @ right, rcond=1e-9) @ target
    condition = np.linalg.cond(mass) * (1.0 + np.linalg.cond(row[chosen[:rank]]) ** 2 if rank else 1.0)
    scale = largest(least) + largest(target)
    assert largest(change - least) <= 100.0 * EPS * condition * scale
    assert largest(row.T @ multiplier - mass @ change) <= 100.0 * EPS * condition * scale
    assert not multiplier[chosen[rank:]].any()
    basis = scaled[chosen[:rank]]
    assert largest(basis @ basis.T - np.eye(rank), initial=0.0) <= 8.0 * len(mass) * EPS


@settings(max_examples=25)
@given(problems(), st.sampled_from([1e-13, 1e-9, 1e-5, 1e-3]))
def test_nearly_dependent_rows_have_the_same_bits_in_floats_and_machine_code(problem, size):
    row, mass, target, _ = problem
    solved(row + size * np.random.default_rng(0).standard_normal(row.shape), mass, target)


HEAVY = np.diag([1.0, 1e2 / EXPLICIT**2])
"""In this metric alone what moves the second body would be nothing; without masses rows have length one."""


@pytest.mark.parametrize(
    ("mass", "entry", "rank"),
    [(np.eye(2), 0.5 * EXPLICIT, 1), (np.eye(2), 2.0 * EXPLICIT, 2), (HEAVY, 1.0, 2), (HEAVY, 0.1 * EXPLICIT, 1)],
)
def test_rows_repeat_each_other_below_the_threshold(mass, entry, rank):
    assert solved(np.array([[1.0, 0.0], [1.0, entry]]), mass, np.zeros(2))[0] == rank


def test_a_row_that_cancels_to_rounding_is_no_equation():
    n, row = 3, np.full((1, 3), 1e-13)
    made = np.eye(n), np.zeros((1, n)), np.zeros((1, n)), np.zeros((1, 1)), np.zeros(1, dtype=np.int64), 1
    assert [run("orthonormalise", row, np.array([terms]), *made)[0] for terms in (1.0, 1e-13)] == [0, 1]
