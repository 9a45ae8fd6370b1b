"""The fixed-order factorisation solves what a dense solver solves, and watches its pivots."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import sparse

from ephs.semantics.linear.sparse import sparse_lu
from ephs.solve.equations.sparse import PARTS, order, paired
from tests.numerics import generators, largest
from tests.staged import run_both


def run(entry, *arguments):
    return run_both(sparse_lu(), entry, *arguments)


@st.composite
def matrices(draw):
    """Sparse invertible matrices with a zero-free diagonal in a hidden order: rows and columns are shuffled."""
    n = draw(st.integers(1, 12))
    rng = draw(generators)
    dense = np.where(rng.random((n, n)) < 0.3, rng.standard_normal((n, n)), 0.0)
    dense += np.diag(rng.choice([-4.0, 4.0], n) * np.exp(rng.standard_normal(n)))
    return dense[rng.permutation(n)][:, rng.permutation(n)]


def factors(dense, values=None, floor=0.0):
    """The plan made of a matrix, whether it served the same places with other values, factors, ratios of pivots."""
    n = dense.shape[0]
    row, column = np.nonzero(dense)
    plan = order(n, row, column, dense[row, column])
    data = (dense if values is None else values)[row, column]
    arrays = plan.place, plan.start, plan.column, plan.diagonal, data, np.zeros(plan.fill), np.zeros(n)
    good, *_, value, _, _, ratio = run("factorise", *arrays, np.full(n, floor), np.zeros(n))
    return plan, good, value, ratio


def solution(plan, value, right):
    arrays = plan.rows, plan.columns, plan.start, plan.column, plan.diagonal, value, right, 0.0 * right, 0.0 * right
    return run("solve", *arrays)[-2]


@given(matrices(), generators)
def test_solves_as_a_dense_solver(dense, rng):
    right = rng.standard_normal(dense.shape[0])
    plan, good, value, _ = factors(dense)
    x = solution(plan, value, right)
    assert good
    scale = np.abs(dense) @ np.abs(x) + np.abs(right)
    assert np.all(np.abs(dense @ x - right) <= 1e-11 * scale.max())


@given(matrices(), generators)
def test_rows_are_paired_with_columns_so_that_no_entry_of_the_diagonal_is_small(dense, rng):
    """As large as the largest part allows that any pairing does."""
    n = min(5, dense.shape[0])
    part = dense[:n, :n] + np.diag(np.full(n, 1e-3))
    part *= 10.0 ** rng.uniform(-10.0, 0.0, part.shape)
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
    changed = dense * factor ** np.sign(dense)
    plan, good, value, _ = factors(dense, changed)
    if good and np.linalg.cond(changed) < 1e6:
        x = solution(plan, value, np.ones(dense.shape[0]))
        assert largest(changed @ x - 1.0) <= 1e-7 * (np.abs(changed) @ np.abs(x)).max()


@settings(max_examples=25)
@given(matrices(), generators)
def test_pivots_below_their_floors_have_the_same_bits_in_floats_and_machine_code(dense, rng):
    factors(dense, floor=0.3 * rng.random(dense.shape[0]))


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
    made = [np.zeros(size, dtype=np.int64) for size in (n + 1, int(filled.sum()) - room, n + 1, n)]
    count, _, _, start, out, *_ = run("fill", first, np.nonzero(pattern)[1].copy(), *made)
    assert count == (-1 if room else filled.sum())
    if not room:
        assert np.array_equal(np.repeat(np.arange(n), np.diff(start)) * n + out, np.flatnonzero(filled))


@pytest.mark.parametrize(("last", "floor", "good"), [(4.0, 0.0, False), (4.1, 0.0, True), (4.1, 0.9, False)])
def test_a_pivot_of_zero_or_below_its_floor_is_refused(last, floor, good):
    values = np.array([[1.0, 2.0], [2.0, last]])
    assert bool(factors(np.array([[1.0, 2.0], [3.0, 4.0]]), values, floor)[1]) == good


def test_an_exactly_singular_sample_has_no_order():
    with pytest.raises(RuntimeError):
        order(2, np.array([0, 0]), np.array([0, 1]), np.array([1.0, 1.0]))


def test_the_search_for_large_entries_ends():
    """SciPy's matching never ends on these values where their logarithms are taken as they are."""
    rng = np.random.default_rng(1)
    pattern = (sparse.random(300, 300, 0.05, random_state=1) + sparse.eye(300)).tocsr().tocoo()
    size = 2.0 ** -rng.integers(0, 8, pattern.nnz) * np.where(rng.random(pattern.nnz) < 0.5, 1.0, 1.0 / 3.0)
    assert np.array_equal(np.sort(paired(300, pattern.row, pattern.col, size)), np.arange(300))
