"""The subgroups that twists generate: names, dimensions, axes, translations and pitch of each conjugacy class."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.mechanics.constraints.subgroup import generated
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rank import ASSEMBLY
from tests.numerics import generators, largest

X, Y, Z = np.eye(3)
ZERO = np.zeros(3)
CLASSES = {
    "1": ([np.zeros(6)], 0, 0),
    "ℝ": ([np.r_[ZERO, X]], 0, 1),
    "ℝ²": ([np.r_[ZERO, X], np.r_[ZERO, X + Y]], 0, 2),
    "ℝ³": ([np.r_[ZERO, X], np.r_[ZERO, Y], np.r_[ZERO, Z + X]], 0, 3),
    "SO(2)": ([np.r_[Z, ZERO]], 1, 0),
    "H": ([np.r_[Z, 0.3 * Z]], 1, 0),
    "SO(2)×ℝ": ([np.r_[Z, ZERO], np.r_[ZERO, Z]], 1, 1),
    "SE(2)": ([np.r_[Z, ZERO], np.r_[Z, np.cross(X, Z)]], 1, 2),
    "H⋉ℝ²": ([np.r_[Z, 0.3 * Z], np.r_[ZERO, X]], 1, 2),
    "SE(2)×ℝ": ([np.r_[Z, 0.3 * Z], np.r_[ZERO, X + Z]], 1, 3),
    "SO(3)": ([np.r_[Z, ZERO], np.r_[X, ZERO]], 3, 0),
    "SE(3)": ([np.r_[Z, ZERO], np.r_[X, -Z]], 3, 3),
}


def contains(group, twist):
    """Whether a twist of size about one belongs to the group's algebra."""
    off = twist - group.basis @ (group.basis.T @ twist)
    return float(largest(off)) < ASSEMBLY * max(1.0, float(largest(twist)))


@pytest.mark.parametrize("name", CLASSES)
@given(rng=generators)
def test_a_class_is_known_in_any_frame(name, rng):
    twists, turns, shifts = CLASSES[name]
    carried = SE3.adjoint(SE3.random(rng))
    group = generated(np.array([carried @ twist for twist in twists]))
    assert group.name == name
    assert (group.turning.shape, group.translations.shape) == ((3, turns), (3, shifts))
    assert group.dim == turns + shifts
    for columns in (group.turning, group.translations, group.basis):
        assert np.allclose(columns.T @ columns, np.eye(columns.shape[1]), atol=1e-12)
    for twist in twists:
        assert contains(group, carried @ twist)
    # what is in it is closed under brackets, and what is not is not contained
    for one in group.basis.T:
        assert all(contains(group, SE3.ad(one) @ other) for other in group.basis.T)
    if group.dim < 6:
        outside = np.linalg.svd(group.basis)[0][:, -1] if group.dim else np.eye(6)[0]
        assert not contains(group, outside) and not contains(group, 1e-6 * outside + group.basis.sum(axis=1))


@given(rng=generators, pitch=st.sampled_from([-0.7, 0.02, 1.3]), slides=st.booleans())
def test_pitch_is_the_advance_along_the_axis_in_any_frame(rng, pitch, slides):
    carried = SE3.adjoint(SE3.random(rng))
    twists = [np.r_[Z, pitch * Z], *([np.r_[ZERO, X]] if slides else [])]
    assert generated(np.array([carried @ t for t in twists])).pitch() == pytest.approx(pitch, abs=1e-12)
