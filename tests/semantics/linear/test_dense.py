"""Dense factors within their backward error bounds, and the same bits by floats and by machine code."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ephs.semantics.linear.dense import backward, cholesky, forward, lu, lu_solve
from ephs.semantics.stage import Entry, Program, indices, matrix, vector
from tests.numerics import EPS, largest, seeds


def whole(on, a, factor):
    return cholesky(on, a, factor)


PROGRAM = Program(
    "dense",
    lu=Entry(lu, a=matrix(), pivots=indices()),
    lu_solve=Entry(lu_solve, factors=matrix(), pivots=indices(), x=vector()),
    cholesky=Entry(whole, a=matrix(), factor=matrix()),
    forward=Entry(forward, factor=matrix(), x=vector()),
    backward=Entry(backward, factor=matrix(), x=vector()),
)
RUNS = {"compiled": PROGRAM.compiled(), "plain": PROGRAM.plain()}
U = EPS / 2.0


def bound(n):
    """γ of Higham, *Accuracy and Stability of Numerical Algorithms*, for n roundings in a row."""
    return n * U / (1.0 - n * U)


@st.composite
def matrices(draw):
    """Square matrices whose rows have sizes from 1e-6 to 1e6."""
    n = draw(st.integers(1, 9))
    rng = np.random.default_rng(draw(seeds))
    return rng.standard_normal((n, n)) * 10.0 ** rng.uniform(-6, 6, n)[:, None]


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
@given(matrices())
@settings(max_examples=25)
def test_lu_solves_within_its_backward_error(run, a):
    """Higham, theorem 9.4: |b − A x| ≤ γ(3 n) Pᵀ|L||U||x|."""
    n = len(a)
    factors, pivots, x = a.copy(), np.zeros(n, dtype=np.int64), np.arange(1.0, n + 1.0)
    assert run["lu"](factors, pivots)
    run["lu_solve"](factors, pivots, x)
    size = (np.abs(np.tril(factors, -1)) + np.eye(n)) @ np.abs(np.triu(factors)) @ np.abs(x)
    for k in reversed(range(n)):
        size[[k, pivots[k]]] = size[[pivots[k], k]]
    assert np.all(np.abs(a @ x - np.arange(1.0, n + 1.0)) <= (bound(3 * n) + bound(n)) * size)
    assert largest(np.tril(factors, -1)) <= 1.0 + 2.0 * U  # partial pivoting


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
@given(matrices())
@settings(max_examples=25)
def test_cholesky_and_triangular_solutions_within_their_backward_errors(run, b):
    """Higham, theorems 10.3 and 8.5: |A − L Lᵀ| ≤ γ(n + 1)|L||Lᵀ|, |b − L x| ≤ γ(n)|L||x|."""
    n = len(b)
    a, factor = np.tril(b @ b.T + np.diag(np.sum(b * b, axis=1))), np.zeros((n, n))
    a += np.tril(a, -1).T
    assert run["cholesky"](a, factor) == 0
    assert np.all(np.abs(a - factor @ factor.T) <= (bound(n + 1) + bound(n)) * np.abs(factor) @ np.abs(factor.T))
    for name, triangle in (("forward", factor), ("backward", factor.T)):
        longer = np.arange(1.0, n + 3.0)  # what follows is not touched
        run[name](factor, longer)
        x, rest = longer[:n], longer[n:]
        assert np.array_equal(rest, [n + 1.0, n + 2.0])
        assert np.all(
            np.abs(triangle @ x - np.arange(1.0, n + 1.0)) <= 2.0 * bound(n + 1) * np.abs(triangle) @ np.abs(x)
        )


@given(matrices())
@settings(max_examples=25)
def test_floats_and_machine_code_give_the_same_bits(a):
    n = len(a)
    found = []
    for run in RUNS.values():
        factors, pivots, x = a.copy(), np.zeros(n, dtype=np.int64), np.ones(n)
        good = run["lu"](factors, pivots)
        run["lu_solve"](factors, pivots, x)
        factor, y = np.zeros((n, n)), np.ones(n)
        failed = run["cholesky"](a @ a.T, factor)
        run["forward"](factor, y)
        found.append((good, failed, factors.tobytes(), pivots.tobytes(), x.tobytes(), factor.tobytes(), y.tobytes()))
    assert found[0] == found[1]


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
def test_singular_and_indefinite_matrices_are_refused(run):
    assert not run["lu"](np.array([[1.0, 2.0], [2.0, 4.0]]), np.zeros(2, dtype=np.int64))
    indefinite = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
    assert run["cholesky"](indefinite, np.zeros((3, 3))) == 2
    assert run["cholesky"](np.zeros((0, 0)), np.zeros((0, 0))) == 0
