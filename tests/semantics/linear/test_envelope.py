"""Factors of real and complex matrices with zeros: the bits of dense ones, and within their backward error bound."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ephs.semantics.linear.dense import lu
from ephs.semantics.linear.envelope import envelope_lu, envelope_solve
from ephs.semantics.stage import Entry, Program, indices, matrix, vector
from tests.numerics import EPS, seeds


def of_real(on, a, pivots, ends):
    envelope_lu(on, [a], pivots, ends)


def of_complex(on, real, imaginary, pivots, ends):
    envelope_lu(on, [real, imaginary], pivots, ends)


def solve(on, a, pivots, ends, x):
    envelope_solve(on, [a], pivots, ends, [x])


def solve_complex(on, real, imaginary, pivots, ends, x, y):
    envelope_solve(on, [real, imaginary], pivots, ends, [x, y])


ROWS = {"pivots": indices(), "ends": indices()}
PROGRAM = Program(
    "envelope",
    lu=Entry(lu, a=matrix(), pivots=indices()),
    of_real=Entry(of_real, a=matrix(), **ROWS),
    of_complex=Entry(of_complex, real=matrix(), imaginary=matrix(), **ROWS),
    solve=Entry(solve, a=matrix(), **ROWS, x=vector()),
    solve_complex=Entry(solve_complex, real=matrix(), imaginary=matrix(), **ROWS, x=vector(), y=vector()),
)
RUNS = {"compiled": PROGRAM.compiled(), "plain": PROGRAM.plain()}
U = EPS / 2.0


@st.composite
def matrices(draw):
    """Complex matrices, half of whose entries or all beyond a band are zero, with rows of sizes from 1e-3 to 1e3."""
    n = draw(st.integers(1, 9))
    rng = np.random.default_rng(draw(seeds))
    a = (rng.standard_normal((n, n)) + 1j * rng.standard_normal((n, n))) * 10.0 ** rng.uniform(-3, 3, n)[:, None]
    i, j = np.indices((n, n))
    return np.where(np.abs(i - j) <= 2 if draw(st.booleans()) else rng.random((n, n)) < 0.5, a, 0.0)


def integers(n):
    return np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
@given(matrices())
@settings(max_examples=25)
def test_factors_have_the_bits_of_those_without_leaving_anything_out(run, a):
    """-0.0 and 0.0 are the same number."""
    factors, (pivots, ends) = a.real.copy(), integers(len(a))
    others, rows = a.real.copy(), np.zeros(len(a), dtype=np.int64)
    assume(run["lu"](others, rows))
    run["of_real"](factors, pivots, ends)
    assert np.array_equal(factors, others) and np.array_equal(pivots, rows)
    for i, end in enumerate(ends):
        assert i < end <= len(a) and not factors[i, end:].any()


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
@given(matrices(), st.booleans())
@settings(max_examples=50)
def test_solutions_are_within_their_backward_error(run, a, real):
    """Higham, theorem 9.4: |b − A x| ≤ γ(4 n) Pᵀ|L||U||x|, with 2√2 u for a complex product, and twice that beside an
    inverse (lemma 3.5): 8 u covers both."""
    n = len(a)
    (pivots, ends), b = integers(n), np.arange(1.0, n + 1.0) + (0.0 if real else 1j)
    if real:
        a, factors, x = a.real, a.real.copy(), b.copy()
        assume(np.linalg.matrix_rank(a / np.abs(a).max(axis=1, initial=1e-300)[:, None]) == n)
        run["of_real"](factors, pivots, ends)
        run["solve"](factors, pivots, ends, x)
    else:
        assume(np.linalg.matrix_rank(a / np.abs(a).max(axis=1, initial=1e-300)[:, None]) == n)
        parts, (x, y) = (a.real.copy(), a.imag.copy()), (b.real.copy(), b.imag.copy())
        run["of_complex"](*parts, pivots, ends)
        run["solve_complex"](*parts, pivots, ends, x, y)
        factors, x = parts[0] + 1j * parts[1], x + 1j * y
    size = (np.abs(np.tril(factors, -1)) + np.eye(n)) @ np.abs(np.triu(factors)) @ np.abs(x)
    for k in reversed(range(n)):
        size[[k, pivots[k]]] = size[[pivots[k], k]]
    assert np.all(np.abs(a @ x - b) <= 8.0 * U * 4 * n * size)
