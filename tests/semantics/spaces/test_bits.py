"""Differentials of exponential maps: floats and machine code give the same bits, whatever the size of the argument."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ephs.semantics.spaces import codes
from ephs.semantics.spaces.differentials import DIMENSIONS, differentials
from tests.numerics import generators
from tests.staged import run_both

pytestmark = pytest.mark.optimised


@settings(max_examples=10)
@given(rng=generators, size=st.sampled_from([0.0, 1e-9, 0.1, 1.0, 3.0]))
@pytest.mark.parametrize("code", DIMENSIONS)
def test_differentials(code, rng, size):
    v = size * rng.standard_normal(DIMENSIONS[code])
    for name in (f"dexp_left_{code}", f"dexp_left_inv_{code}"):
        run_both(differentials(), name, v, np.zeros((v.size, v.size)), signed=False)


def test_every_group_but_vectors_has_differentials():
    assert set(DIMENSIONS) == {codes.SO3, codes.SE2, codes.SE3, codes.SO3xR3}
