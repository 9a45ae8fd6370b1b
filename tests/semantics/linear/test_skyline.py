"""Factors and products of symmetric matrices by skylines are those of dense ones, within backward error bounds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ephs.semantics.linear.dense import cholesky
from ephs.semantics.linear.skyline import skyline_solve, skyline_times
from ephs.semantics.stage import Entry, Program, indices, matrix, vector
from tests.numerics import EPS, seeds


def in_place(on, a, first):
    return cholesky(on, a, a, first)


PROGRAM = Program(
    "skyline",
    cholesky=Entry(in_place, a=matrix(), first=indices()),
    solve=Entry(skyline_solve, factor=matrix(), first=indices(), x=vector()),
    times=Entry(skyline_times, a=matrix(), first=indices(), x=vector(), out=vector()),
)
RUNS = {"compiled": PROGRAM.compiled(), "plain": PROGRAM.plain()}
U = EPS / 2.0


@st.composite
def definite(draw):
    """Definite matrices whose rows begin anywhere, rows of sizes from 1e-3 to 1e3; where rows begin."""
    n = draw(st.integers(1, 9))
    rng = np.random.default_rng(draw(seeds))
    first = np.array([rng.integers(0, i + 1) for i in range(n)])
    factor = rng.standard_normal((n, n)) * (np.arange(n) >= first[:, None])
    factor = np.tril(factor, -1) + np.diag(rng.uniform(0.5, 2.0, n))
    factor *= 10.0 ** rng.uniform(-3, 3, n)[:, None]
    return factor @ factor.T, first


def hidden(a, first):
    """The lower triangle from where rows begin; all else is not a number."""
    i, j = np.indices(a.shape)
    return np.where((j <= i) & (j >= first[:, None]), a, np.nan)


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
@given(definite(), seeds)
@settings(max_examples=25)
def test_solutions_solve(run, given_one, seed):
    a, first = given_one
    n, factor, x = len(a), hidden(a, first), np.random.default_rng(seed).standard_normal(len(a))
    assert run["cholesky"](factor, first) == 0
    lower = np.nan_to_num(factor)
    assert np.all(np.abs(lower @ lower.T - a) <= 2 * (n + 1) * U * (np.abs(lower) @ np.abs(lower.T)))
    found = x.copy()
    run["solve"](factor, first, found)
    bound = 2 * (3 * n + 1) * U * (np.abs(lower) @ (np.abs(lower.T) @ np.abs(found)))
    assert np.all(np.abs(a @ found - x) <= bound + 4 * n * U * np.abs(a) @ np.abs(found))


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
@given(definite(), seeds)
@settings(max_examples=25)
def test_products_are_those_of_the_whole_matrix(run, given_one, seed):
    a, first = given_one
    x, out = np.random.default_rng(seed).standard_normal(len(a)), np.full(len(a), np.nan)
    run["times"](hidden(a, first), first, x, out)
    assert np.all(np.abs(out - a @ x) <= 2 * len(a) * U * np.abs(a) @ np.abs(x))


@pytest.mark.parametrize("run", RUNS.values(), ids=RUNS)
def test_what_is_not_definite_is_told_by_its_row(run):
    assert run["cholesky"](np.diag([1.0, -1.0, 1.0]), np.arange(3)) == 2
