"""Factors, dense, without the zeros outside of an envelope or a skyline: within their backward error bounds."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ephs.semantics.linear.dense import backward, cholesky, forward, lu, lu_solve
from ephs.semantics.linear.envelope import envelope_lu, envelope_solve
from ephs.semantics.linear.skyline import skyline_solve, skyline_times
from ephs.semantics.stage import Entry, Program, indices, matrix, vector
from tests.numerics import EPS, generators, largest
from tests.staged import run_both

U = EPS / 2.0
ROWS = {"pivots": indices(), "ends": indices()}
PROGRAM = Program(
    "factors",
    lu=Entry(lu, a=matrix(), pivots=indices()),
    lu_solve=Entry(lu_solve, factors=matrix(), pivots=indices(), x=vector()),
    cholesky=Entry(lambda on, a, factor: cholesky(on, a, factor), a=matrix(), factor=matrix()),
    forward=Entry(forward, factor=matrix(), x=vector()),
    backward=Entry(backward, factor=matrix(), x=vector()),
    envelope=Entry(lambda on, a, pivots, ends: envelope_lu(on, [a], pivots, ends), a=matrix(), **ROWS),
    envelope_solve=Entry(
        lambda on, a, pivots, ends, x: envelope_solve(on, [a], pivots, ends, [x]), a=matrix(), **ROWS, x=vector()
    ),
    complex_envelope=Entry(
        lambda on, a, b, pivots, ends: envelope_lu(on, [a, b], pivots, ends), a=matrix(), b=matrix(), **ROWS
    ),
    complex_solve=Entry(
        lambda on, a, b, pivots, ends, x, y: envelope_solve(on, [a, b], pivots, ends, [x, y]),
        a=matrix(), b=matrix(), **ROWS, x=vector(), y=vector(),
    ),
    skyline=Entry(lambda on, a, first: cholesky(on, a, a, first), a=matrix(), first=indices()),
    skyline_solve=Entry(skyline_solve, factor=matrix(), first=indices(), x=vector()),
    skyline_times=Entry(skyline_times, a=matrix(), first=indices(), x=vector(), out=vector()),
)  # fmt: skip


def run(entry, *arguments):
    return run_both(PROGRAM, entry, *arguments)


def bound(n):
    """γ of Higham, *Accuracy and Stability of Numerical Algorithms*, for n roundings in a row."""
    return n * U / (1.0 - n * U)


def none(n):
    return np.zeros(n, dtype=np.int64)


def lu_terms(factors, pivots, x):
    """Pᵀ|L||U||x|."""
    size = (np.abs(np.tril(factors, -1)) + np.eye(len(x))) @ np.abs(np.triu(factors)) @ np.abs(x)
    for k in reversed(range(len(x))):
        size[[k, pivots[k]]] = size[[pivots[k], k]]
    return size


@st.composite
def matrices(draw):
    """Square matrices whose rows have sizes from 1e-6 to 1e6."""
    n = draw(st.integers(1, 9))
    rng = draw(generators)
    return rng.standard_normal((n, n)) * 10.0 ** rng.uniform(-6, 6, n)[:, None]


@st.composite
def matrices_with_zeros(draw):
    """Complex matrices, half of whose entries or all beyond a band are zero, with rows of sizes from 1e-3 to 1e3."""
    n = draw(st.integers(1, 9))
    rng = draw(generators)
    a = (rng.standard_normal((n, n)) + 1j * rng.standard_normal((n, n))) * 10.0 ** rng.uniform(-3, 3, n)[:, None]
    i, j = np.indices((n, n))
    return np.where(np.abs(i - j) <= 2 if draw(st.booleans()) else rng.random((n, n)) < 0.5, a, 0.0)


@st.composite
def skylines(draw):
    """Definite matrices whose rows begin anywhere, rows of sizes from 1e-3 to 1e3; where rows begin; a vector."""
    n = draw(st.integers(1, 9))
    rng = draw(generators)
    first = np.array([rng.integers(0, i + 1) for i in range(n)])
    factor = rng.standard_normal((n, n)) * (np.arange(n) >= first[:, None])
    factor = np.tril(factor, -1) + np.diag(rng.uniform(0.5, 2.0, n))
    factor *= 10.0 ** rng.uniform(-3, 3, n)[:, None]
    return factor @ factor.T, first, rng.standard_normal(n)


@given(matrices())
def test_lu_solves_within_its_backward_error(a):
    """Higham, theorem 9.4: |b − A x| ≤ γ(3 n) Pᵀ|L||U||x|."""
    n = len(a)
    good, factors, pivots = run("lu", a, none(n))
    *_, x = run("lu_solve", factors, pivots, np.arange(1.0, n + 1.0))
    assert good
    assert np.all(np.abs(a @ x - np.arange(1.0, n + 1.0)) <= (bound(3 * n) + bound(n)) * lu_terms(factors, pivots, x))
    assert largest(np.tril(factors, -1)) <= 1.0 + 2.0 * U  # partial pivoting


@given(matrices())
def test_cholesky_and_triangular_solutions_within_their_backward_errors(b):
    """Higham, theorems 10.3 and 8.5: |A − L Lᵀ| ≤ γ(n + 1)|L||Lᵀ|, |b − L x| ≤ γ(n)|L||x|."""
    n = len(b)
    a = np.tril(b @ b.T + np.diag(np.sum(b * b, axis=1)))
    a += np.tril(a, -1).T
    failed, _, factor = run("cholesky", a, np.zeros((n, n)))
    assert failed == 0
    assert np.all(np.abs(a - factor @ factor.T) <= (bound(n + 1) + bound(n)) * np.abs(factor) @ np.abs(factor.T))
    for name, triangle in (("forward", factor), ("backward", factor.T)):
        *_, longer = run(name, factor, np.arange(1.0, n + 3.0))  # what follows is not touched
        x, rest = longer[:n], longer[n:]
        assert np.array_equal(rest, [n + 1.0, n + 2.0])
        missed = np.abs(triangle @ x - np.arange(1.0, n + 1.0))
        assert np.all(missed <= 2.0 * bound(n + 1) * np.abs(triangle) @ np.abs(x))


@settings(max_examples=25)
@given(matrices())
def test_what_is_hardly_definite_fails_alike_in_floats_and_machine_code(a):
    run("cholesky", a @ a.T, np.zeros(a.shape))


@given(matrices_with_zeros())
def test_factors_within_an_envelope_are_those_without_leaving_anything_out(a):
    """-0.0 and 0.0 are the same number."""
    good, others, rows = run("lu", a.real.copy(), none(len(a)))
    assume(good)
    _, factors, pivots, ends = run("envelope", a.real.copy(), none(len(a)), none(len(a)))
    assert np.array_equal(factors, others) and np.array_equal(pivots, rows)
    for i, end in enumerate(ends):
        assert i < end <= len(a) and not factors[i, end:].any()


@settings(max_examples=100)
@given(matrices_with_zeros(), st.booleans())
def test_solutions_within_an_envelope_are_within_their_backward_error(a, real):
    """Higham, theorem 9.4: |b − A x| ≤ γ(4 n) Pᵀ|L||U||x|, with 2√2 u for a complex product, and twice that beside an
    inverse (lemma 3.5): 8 u covers both."""
    n = len(a)
    a, b = (a.real if real else a), np.arange(1.0, n + 1.0) + (0.0 if real else 1j)
    assume(np.linalg.matrix_rank(a / largest(a, axis=1, initial=1e-300)[:, None]) == n)
    if real:
        _, factors, *rows = run("envelope", a.copy(), none(n), none(n))
        *_, x = run("envelope_solve", factors, *rows, b)
    else:
        _, one, other, *rows = run("complex_envelope", a.real.copy(), a.imag.copy(), none(n), none(n))
        *_, x, y = run("complex_solve", one, other, *rows, b.real.copy(), b.imag.copy())
        factors, x = one + 1j * other, x + 1j * y
    assert np.all(np.abs(a @ x - b) <= 8.0 * U * 4 * n * lu_terms(factors, rows[0], x))


@given(skylines())
def test_skylines_solve_and_multiply_as_the_whole_matrix(drawn):
    """Only the lower triangle from where rows begin is read: all else is not a number."""
    a, first, x = drawn
    n, (i, j) = len(a), np.indices(a.shape)
    hidden = np.where((j <= i) & (j >= first[:, None]), a, np.nan)
    *_, product = run("skyline_times", hidden, first, x, np.full(n, np.nan))
    assert np.all(np.abs(product - a @ x) <= 2 * n * U * np.abs(a) @ np.abs(x))
    failed, factor, _ = run("skyline", hidden, first)
    assert failed == 0
    lower = np.nan_to_num(factor)
    assert np.all(np.abs(lower @ lower.T - a) <= 2 * (n + 1) * U * (np.abs(lower) @ np.abs(lower.T)))
    *_, found = run("skyline_solve", factor, first, x)
    allowed = 2 * (3 * n + 1) * U * (np.abs(lower) @ (np.abs(lower.T) @ np.abs(found)))
    assert np.all(np.abs(a @ found - x) <= allowed + 4 * n * U * np.abs(a) @ np.abs(found))


def test_singular_and_indefinite_matrices_are_refused():
    """Those that are not definite by the row."""
    assert not run("lu", np.array([[1.0, 2.0], [2.0, 4.0]]), none(2))[0]
    indefinite = np.diag([1.0, -1.0, 1.0])
    assert run("cholesky", indefinite, np.zeros((3, 3)))[0] == run("skyline", indefinite, np.arange(3))[0] == 2
    assert run("cholesky", np.zeros((0, 0)), np.zeros((0, 0)))[0] == 0
