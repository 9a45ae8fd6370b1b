"""The fixed-order factorisation solves what a dense solver solves, and watches its pivots."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import sparse

from ephs.semantics.linear.sparse import sparse_lu
from ephs.solve.equations.sparse import PARTS, order, paired
from tests.numerics import generators, largest, seeds

RUNS = {"compiled": sparse_lu().compiled(), "plain": sparse_lu().plain()}
factorise, solve = RUNS["compiled"]["factorise"], RUNS["compiled"]["solve"]


@st.composite
def matrices(draw):
    """Sparse invertible matrices with a zero-free diagonal in a hidden order: rows and columns are shuffled."""
    n = draw(st.integers(1, 12))
    rng = np.random.default_rng(draw(seeds))
    dense = np.where(rng.random((n, n)) < 0.3, rng.standard_normal((n, n)), 0.0)
    dense += np.diag(rng.choice([-4.0, 4.0], n) * np.exp(rng.standard_normal(n)))
    return dense[rng.permutation(n)][:, rng.permutation(n)]


def factors(dense, values=None):
    n = dense.shape[0]
    row, column = np.nonzero(dense)
    plan = order(n, row, column, dense[row, column])
    value, scratch, ratio = np.zeros(plan.fill), np.zeros(n), np.zeros(n)
    data = dense[row, column] if values is None else values[row, column]
    good = factorise(plan.place, plan.start, plan.column, plan.diagonal, data, value, scratch, np.zeros(n), ratio)
    return plan, value, good, ratio


@given(matrices(), generators)
def test_solves_as_a_dense_solver(dense, rng):
    n = dense.shape[0]
    right = rng.standard_normal(n)
    plan, value, good, _ = factors(dense)
    x = np.empty(n)
    solve(plan.rows, plan.columns, plan.start, plan.column, plan.diagonal, value, right, x, np.zeros(n))
    assert good
    scale = np.abs(dense) @ np.abs(x) + np.abs(right)
    assert np.all(np.abs(dense @ x - right) <= 1e-11 * scale.max())


@given(matrices(), seeds)
def test_rows_are_paired_with_columns_so_that_no_entry_of_the_diagonal_is_small(dense, seed):
    """As large as the largest part allows that any pairing does."""
    n = min(5, dense.shape[0])
    part = dense[:n, :n] + np.diag(np.full(n, 1e-3))
    part *= 10.0 ** np.random.default_rng(seed).uniform(-10.0, 0.0, part.shape)
    row, column = np.nonzero(part)
    rows = paired(n, row, column, part[row, column])
    assert sorted(rows) == list(range(n))
    size = np.abs(part)
    best = max(size[list(order), np.arange(n)].min() for order in permutations(range(n)))
    allowed = max(level for level in PARTS if level * size.max() < best)
    assert size[rows, np.arange(n)].min() > allowed * size.max()


def test_a_matrix_that_no_values_make_regular_is_refused():
    with pytest.raises(RuntimeError, match="singular by its pattern"):
        paired(3, np.array([0, 1, 2, 2]), np.array([0, 0, 1, 2]), np.ones(4))


@given(matrices(), st.floats(0.5, 2.0))
def test_the_order_serves_other_numbers_in_the_same_places(dense, factor):
    n = dense.shape[0]
    changed = dense * factor ** np.sign(dense)
    plan, value, good, _ = factors(dense, changed)
    x, right = np.empty(n), np.ones(n)
    solve(plan.rows, plan.columns, plan.start, plan.column, plan.diagonal, value, right, x, np.zeros(n))
    if good and np.linalg.cond(changed) < 1e6:
        assert largest(changed @ x - right) <= 1e-7 * (np.abs(changed) @ np.abs(x)).max()


@given(matrices(), generators)
@settings(max_examples=25)
def test_floats_and_machine_code_give_the_same_bits(dense, rng):
    n = dense.shape[0]
    row, column = np.nonzero(dense)
    plan = order(n, row, column, dense[row, column])
    floor = rng.random(n) * 0.3  # some pivots are refused
    found = []
    for run in RUNS.values():
        value, scratch, ratio, x = np.zeros(plan.fill), np.zeros(n), np.zeros(n), np.zeros(n)
        arrays = (plan.start, plan.column, plan.diagonal)
        good = run["factorise"](plan.place, *arrays, dense[row, column], value, scratch, floor, ratio)
        if good:
            run["solve"](plan.rows, plan.columns, *arrays, value, np.ones(n), x, scratch)
        found.append((good, value.tobytes(), ratio.tobytes(), x.tobytes()))
    assert found[0] == found[1]


@given(matrices(), st.integers(0, 8))
@settings(max_examples=25)
def test_the_pattern_holds_what_elimination_fills(dense, room):
    n = dense.shape[0]
    pattern = (dense != 0.0) | np.eye(n, dtype=bool)
    filled = pattern.copy()
    for k in range(n):
        filled[k + 1 :] |= filled[k + 1 :, k, None] & (filled[k] & (np.arange(n) > k))
    assume(room <= filled.sum())
    first = np.concatenate([[0], np.cumsum(pattern.sum(axis=1))])
    for run in RUNS.values():
        start, out = np.zeros(n + 1, dtype=np.int64), np.zeros(int(filled.sum()) - room, dtype=np.int64)
        scratch = np.zeros(n + 1, dtype=np.int64), np.zeros(n, dtype=np.int64)
        count = run["fill"](first, np.nonzero(pattern)[1].copy(), start, out, *scratch)
        assert count == (-1 if room else filled.sum())
        if not room:
            assert np.array_equal(np.repeat(np.arange(n), np.diff(start)) * n + out, np.flatnonzero(filled))


def test_a_singular_matrix_is_refused():
    dense = np.array([[1.0, 2.0], [3.0, 4.0]])
    _, _, good, _ = factors(dense, np.array([[1.0, 2.0], [2.0, 4.0]]))
    assert not good


def test_a_pivot_below_its_floor_is_refused():
    dense = np.array([[1.0, 2.0], [3.0, 4.0]])
    row, column = np.nonzero(dense)
    plan = order(2, row, column, dense[row, column])
    floor, ratio = np.full(2, 0.9), np.zeros(2)
    data = np.array([1.0, 2.0, 2.0, 4.1])
    arrays = (plan.place, plan.start, plan.column, plan.diagonal)
    assert not factorise(*arrays, data, np.zeros(plan.fill), np.zeros(2), floor, ratio)
    assert factorise(*arrays, data, np.zeros(plan.fill), np.zeros(2), 0.0 * floor, ratio)


def test_an_exactly_singular_sample_has_no_order():
    with pytest.raises(RuntimeError):
        order(2, np.array([0, 0]), np.array([0, 1]), np.array([1.0, 1.0]))


def test_the_search_for_large_entries_ends():
    """SciPy's matching never ends on these values where their logarithms are taken as they are."""
    rng = np.random.default_rng(1)
    pattern = (sparse.random(300, 300, 0.05, random_state=1) + sparse.eye(300)).tocsr().tocoo()
    size = 2.0 ** -rng.integers(0, 8, pattern.nnz) * np.where(rng.random(pattern.nnz) < 0.5, 1.0, 1.0 / 3.0)
    assert np.array_equal(np.sort(paired(300, pattern.row, pattern.col, size)), np.arange(300))
