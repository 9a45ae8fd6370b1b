"""Twists along which islands move: complements of what bars them."""

import tracemalloc

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ephs.mechanics.tree.engine.islands import complement
from tests.numerics import EPS, generators, largest


@given(rank=st.integers(0, 6), count=st.integers(0, 12), rng=generators)
def test_a_complement_is_orthonormal_and_across_all_columns(rank, count, rng):
    columns = np.linalg.qr(rng.normal(size=(6, 6)))[0][:, :rank] @ rng.normal(size=(rank, count))
    free = complement(columns)
    assert free.shape == (6, 6 - min(rank, count))
    assert largest(free.T @ free - np.eye(free.shape[1]), initial=0.0) <= 8 * 6 * EPS
    assert largest(free.T @ columns, initial=0.0) <= 8 * 6 * EPS * largest(columns, initial=0.0)


def test_memory_is_linear_in_the_number_of_contact_points():
    columns = np.tile(np.eye(6), 300)
    tracemalloc.start()
    complement(columns)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 8 * columns.nbytes
