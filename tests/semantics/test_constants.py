"""Constant structures are decided: whatever is beside it, a leak is refuted; whatever the rounding, a law is not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import quantity as Q
from ephs.semantics import StructureError
from tests.numerics import generators

PORTS = {"q": Q.displacement, "p": Q.momentum, "c": Q.charge, "b": Q.flux_linkage}
PARITY = np.array([1.0, -1.0, 1.0, -1.0])
ODD = np.multiply.outer(PARITY, PARITY) < 0.0
sizes = st.sampled_from([1e-9, 1e-3, 1.0, 1e3, 1e9])
numbers = st.floats(0.1, 10.0).flatmap(lambda a: st.sampled_from([a, -a])).flatmap(lambda a: sizes.map(lambda s: a * s))


@st.composite
def skews(draw):
    """Skew matrices that join even to odd ports, with entries of all sizes."""
    upper = np.triu([[draw(numbers) for _ in range(4)] for _ in range(4)]) * ODD
    return upper - upper.T


def judged(matrix, ports=PORTS):
    return ephs.gyrator(ports, matrix).verdict


@given(skews())
def test_what_is_right_is_proved(matrix):
    assert judged(matrix) == "proved"
    assert all(c.how == ("expansion", "as given") for c in judged(matrix).conditions)


@given(skews(), st.sampled_from([(0, 1), (2, 1), (0, 3), (2, 3)]), st.sampled_from([1e-13, 1e-9, 1e-4, 1.0]))
def test_a_leak_of_energy_is_refuted_whatever_is_beside_it(matrix, place, part):
    spoilt = matrix.copy()
    spoilt[place] *= 1.0 + part
    with pytest.raises(StructureError, match="not reversible") as caught:
        judged(spoilt)
    assert sorted(caught.value.witness.entry) == sorted(place)


@given(skews(), st.sampled_from([(0, 2), (1, 3)]), sizes)
def test_so_is_what_time_reversal_does_not_allow(matrix, place, size):
    spoilt = matrix.copy()
    spoilt[place], spoilt[place[::-1]] = size, -size
    with pytest.raises(StructureError, match="time reversal"):
        judged(spoilt)


@given(sizes, st.sampled_from([1e-13, 1e-4]), st.sampled_from(["entropy", "volume"]))
def test_so_is_a_leak_of_what_is_conserved(size, leak, kind):
    """One row has large entries that cancel, another one a small sum."""
    ports = {"p": Q.momentum, "r": Q.flux_linkage, "s": getattr(Q, kind), "t": getattr(Q, kind)}
    row = np.array([[size, -size], [leak, leak]]) if leak > 1e-9 else np.array([[size, -size], [1.0, -1.0 - leak]])
    matrix = np.zeros((4, 4))
    matrix[:2, 2:], matrix[2:, :2] = row, -row.T
    with pytest.raises(StructureError, match=f"{kind} is not conserved"):
        judged(matrix, ports)
    row[1] = leak, -leak
    matrix[:2, 2:], matrix[2:, :2] = row, -row.T
    assert judged(matrix, ports) == "proved"


def test_sums_are_read_in_decimals():
    """0.1 + 0.2 − 0.3 is 5.6e-17 of floats, and zero of what is written."""
    ports = {"p": Q.momentum, "r": Q.entropy, "s": Q.entropy, "t": Q.entropy}
    matrix = np.zeros((4, 4))
    matrix[0, 1:] = 0.1, 0.2, -0.3
    found = judged(matrix - matrix.T, ports)
    assert found == "proved" and "decimals" in found.text


@settings(max_examples=100)
@given(generators, sizes)
def test_products_of_matrices_are_never_refuted(rng, size):
    """T J Tᵀ is skew but for rounding, among numbers of the same units."""
    ports = {"q": Q.relative_pose("planar"), "p": Q.joint_momentum("planar")}
    turn = np.kron(np.eye(2), rng.standard_normal((3, 3)))
    matrix = size * turn @ np.kron([[0.0, -1.0], [1.0, 0.0]], np.eye(3)) @ turn.T
    found = judged(matrix, ports)
    assert {c.statement for c in found.open} <= {"L + Lᵀ = 0"}


@given(generators)
def test_constraints_that_mix_parities_are_compared_as_relations(rng):
    """Rows (1, 1, 1, 1) and (1, −1, 1, −1) span what is even and what is odd; one of them alone does not."""
    basis = np.array([[1.0, 0.0, rng.integers(1, 9), 0.0], [0.0, rng.integers(1, 9), 0.0, 1.0]])
    rows = np.array([[1.0, 1.0], [1.0, -1.0]]) @ basis
    found = ephs.constraint(PORTS, rows).verdict
    assert found == "proved"
    with pytest.raises(StructureError, match="time reversal"):
        ephs.constraint(PORTS, rows[:1])


def test_matrices_that_are_not_matrices_are_refused():
    with pytest.raises(StructureError, match="finite numbers"):
        judged([[0.0, np.nan], [0.0, 0.0]], {"q": Q.displacement, "p": Q.momentum})
