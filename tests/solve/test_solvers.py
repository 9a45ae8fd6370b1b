"""Linear systems of implicit steps: one solution whatever the shape; singular ones are refused by name."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csc_array

from ephs.solve.methods import solvers
from ephs.solve.methods.solvers import DENSE, NARROW, Solvers
from ephs.solve.posing.errors import SolveError
from tests.numerics import EPS, generators


def made():
    return Solvers(lambda unknown: f"unknown {unknown}", {})


@st.composite
def matrices(draw):
    """Diagonally dominant matrices of some diagonals in a hidden order, real or complex; and how many there are."""
    n = draw(st.integers(1, 3 * DENSE))
    below, above = (draw(st.integers(0, min(n - 1, NARROW))) for _ in range(2))
    rng = draw(generators)
    i, j = np.indices((n, n))
    dense = np.where((i - j <= below) & (j - i <= above), rng.uniform(-1.0, 1.0, (n, n)), 0.0)
    dense = dense + np.diag(np.full(n, 2.0 + below + above))
    if draw(st.booleans()):
        dense = dense * (1.0 + 0.5j)
    hidden = rng.permutation(n)
    return dense[hidden][:, hidden]


@given(matrices(), generators)
@settings(max_examples=50)
def test_all_shapes_solve_as_a_dense_solver(dense, rng):
    family = made()
    for part in (dense, 2.0 * dense):  # the second one meets the order that the first one made
        right = rng.standard_normal(len(dense)).astype(dense.dtype)
        x = family.of(csc_array(part))(right)
        scale = np.abs(part) @ np.abs(x) + np.abs(right)
        assert np.all(np.abs(part @ x - right) <= 8 * (2 * NARROW + 1) * EPS * scale.max())


@given(matrices(), matrices(), st.booleans(), generators)
@settings(max_examples=50)
def test_sums_are_solved_as_the_sum(one, other, turning, rng):
    """Also one after the other of two patterns, with zeros that the sum leaves."""
    n, family = min(len(one), len(other)), made()
    a, b = np.real(one)[:n, :n] + 9.0 * np.eye(n), np.where(rng.random((n, n)) < 0.1, np.real(other)[:n, :n], 0.0)
    weight = 0.01 + 0.02j if turning else 0.01
    for left, right in (
        (a, b),
        (a, b.T),
        (2.0 * a, b.T),
        (a - weight.real * np.diag(b.diagonal()), np.diag(b.diagonal())),
    ):
        whole = left + weight * right
        wanted = rng.standard_normal(n).astype(whole.dtype)
        x = family.of_sum(csc_array(left), weight, csc_array(right))(wanted)
        scale = np.abs(whole) @ np.abs(x) + np.abs(wanted)
        growth = np.abs(np.linalg.inv(whole)).sum(axis=1).max() * np.abs(whole).sum(axis=1).max()
        assert np.all(np.abs(whole @ x - wanted) <= 8 * n * growth * EPS * scale.max())


def chain(n, open_at=None):
    """A chain of conductances in a drawn order, singular where an unknown is in no equation."""
    dense = np.diag(np.full(n, 3.0)) - np.eye(n, k=1) - np.eye(n, k=-1)
    hidden = np.random.default_rng(1).permutation(n)
    dense = dense[hidden][:, hidden]
    if open_at is not None:
        dense[:, open_at] = 0.0
    return csc_array(dense)


@pytest.mark.parametrize("n", [DENSE, 4 * DENSE])
def test_singular_matrices_are_refused_by_the_name_of_an_unknown(n):
    with pytest.raises(SolveError) as caught:
        made().of(chain(n, open_at=7))
    assert caught.value.equation.startswith("unknown ")


def test_numbers_that_are_not_finite_are_refused():
    broken = chain(4 * DENSE)
    broken.data[5] = np.nan
    with pytest.raises(SolveError):
        made().of(broken)


def test_a_chain_is_banded_and_a_plate_is_left_to_superlu(monkeypatch):
    """Each shape takes its own way: the other one, spoiled, is not called."""

    def refuse(*_args, **_options):
        raise AssertionError("the other way was taken")

    side = 20
    chained = np.kron(np.eye(side), np.eye(side, k=1) + np.eye(side, k=-1))
    plate = csc_array(4.5 * np.eye(side**2) - chained - np.kron(np.eye(side, k=1) + np.eye(side, k=-1), np.eye(side)))
    with monkeypatch.context() as patch:
        patch.setattr(solvers._Band, "solver", refuse)
        made().of(plate)
    with monkeypatch.context() as patch:
        patch.setattr(solvers, "splu", refuse)
        made().of(chain(4 * DENSE))
