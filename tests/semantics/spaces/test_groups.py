"""The laws of a Lie group with exponential map, for every manifold."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.semantics.spaces import SE2, SE3, SO3, SO3xR3, vector_space
from tests.numerics import EPS, generators, largest

GROUPS = [
    vector_space("real", 1),
    vector_space("momentum*", 6),
    vector_space("nothing", 0),
    SO3,
    SE2,
    SE3,
    SO3xR3,
]


groups = pytest.mark.parametrize("group", GROUPS, ids=lambda g: f"{g.name}{g.dim}")

# Logarithms are principal below π, so displacements stay within; zero and the tiny ones test the series.
lengths = st.sampled_from([0.0, 1e-300, 1e-12, 1e-8, 1e-5, 1e-3, 0.1, 0.499, 0.501, 0.999, 1.001, 2.0, 3.0, 3.1415])


def close(a, b, scale=1.0):
    """Equal up to rounding relative to the size of the terms."""
    return np.all(np.abs(np.asarray(a) - np.asarray(b)) <= 64 * EPS * (1.0 + scale))


def same_point(group, a, b, scale=1.0):
    """Equal as elements; q and −q are one rotation."""
    if group.size > group.dim and a[:4] @ b[:4] < 0:
        b = np.concatenate((-b[:4], b[4:]))
    return close(a, b, scale)


def displacement(group, rng, length):
    """A tangent vector whose angular part, or whole, has the given length; linear parts are of size one."""
    v = rng.standard_normal(group.dim)
    angular = {4: 3, 7: 3}.get(group.size, 1 if group is SE2 else group.dim)
    if angular:
        v[:angular] *= length / np.linalg.norm(v[:angular])
    return v


@groups
@given(rng=generators)
def test_group_laws(group, rng):
    a, b, c = (group.random(rng) for _ in range(3))
    scale = float(sum(np.abs(x).sum() for x in (a, b, c)))
    left, right = group.compose(group.compose(a, b), c), group.compose(a, group.compose(b, c))
    assert same_point(group, left, right, scale)
    assert same_point(group, group.compose(a, group.identity()), a, scale)
    assert same_point(group, group.compose(group.identity(), a), a, scale)
    assert same_point(group, group.compose(a, group.inverse(a)), group.identity(), scale)
    assert same_point(group, group.compose(group.inverse(a), a), group.identity(), scale)
    inverse = group.compose(group.inverse(b), group.inverse(a))
    assert same_point(group, group.inverse(group.compose(a, b)), inverse, scale)
    assert same_point(group, group.normalise(3.0 * a if group.size > group.dim == 3 else a), a, scale)


@groups
@given(rng=generators, length=lengths)
def test_log_inverts_exp(group, rng, length):
    v = displacement(group, rng, length)
    assert close(group.log(group.exp(v)), v, np.abs(v).sum())


@groups
@given(rng=generators)
def test_exp_inverts_log(group, rng):
    x = group.random(rng)
    # V⁻¹ and V are each other's inverse only up to the condition of V, at most π within the principal angles.
    assert same_point(group, group.exp(group.log(x)), x, 10.0 * np.abs(x).sum())


@pytest.mark.parametrize("group", [SO3, SE3, SO3xR3], ids=lambda g: g.name)
@given(rng=generators, gap=st.sampled_from([0.0, 1e-15, 1e-12, 1e-8, 1e-4]))
def test_log_is_accurate_up_to_half_a_turn(group, rng, gap):
    v = displacement(group, rng, np.pi - gap)
    back = group.log(group.exp(v))
    assert np.linalg.norm(back[:3]) <= np.pi * (1 + EPS)
    if gap == 0.0 and back[:3] @ v[:3] < 0:
        # Exactly half a turn: the axis has no sign.
        assert close(back[:3], -v[:3], np.pi)
    else:
        assert close(back, v, np.abs(v).sum())


@groups
@given(rng=generators, length=lengths)
def test_retract_increment_midpoint(group, rng, length):
    x0, v = group.random(rng), displacement(group, rng, length)
    x1 = group.retract(x0, v)
    scale = 10.0 * float(np.abs(x0).sum() + np.abs(x1).sum() + np.abs(v).sum())
    assert close(group.increment(x0, x1), v, scale)
    middle = group.midpoint(x0, x1)
    assert same_point(group, middle, group.midpoint(x1, x0), scale)
    assert same_point(group, group.retract(middle, 0.5 * v), x1, scale)
    # Left translation changes nothing.
    a = group.random(rng)
    assert close(group.increment(group.compose(a, x0), group.compose(a, x1)), v, 2 * scale)


@groups
@given(rng=generators)
def test_adjoint_is_a_homomorphism_and_its_dual_reverses(group, rng):
    a, b = group.random(rng), group.random(rng)
    ad_a, ad_b, ad_ab = group.adjoint(a), group.adjoint(b), group.adjoint(group.compose(a, b))
    scale = float(np.abs(ad_a).sum() * np.abs(ad_b).sum())
    assert close(ad_a @ ad_b, ad_ab, scale)
    assert close(group.coadjoint(a) @ group.coadjoint(b), group.coadjoint(group.compose(b, a)), scale)
    assert close(group.adjoint(group.inverse(a)) @ ad_a, np.eye(group.dim), scale)


@pytest.mark.parametrize("group", [SO3, SE2, SE3, SO3xR3], ids=lambda g: g.name)
def test_the_dual_is_not_a_homomorphism(group):
    rng = np.random.default_rng(1)
    a, b = group.random(rng), group.random(rng)
    wrong = group.coadjoint(a) @ group.coadjoint(b) - group.coadjoint(group.compose(a, b))
    assert largest(wrong) > 0.1


@groups
@given(rng=generators)
def test_bracket(group, rng):
    u, v, w = (rng.standard_normal(group.dim) for _ in range(3))
    ad, scale = group.ad, 1.0 + np.abs(u).sum() * np.abs(v).sum() * np.abs(w).sum()
    assert close(ad(u) @ v, -ad(v) @ u, scale)
    assert close(ad(ad(u) @ v) @ w, ad(u) @ ad(v) @ w - ad(v) @ ad(u) @ w, 4 * scale)
    # Ad is an automorphism of the bracket.
    m = group.adjoint(group.random(rng))
    assert close(m @ ad(u) @ v, ad(m @ u) @ m @ v, scale * np.abs(m).sum() ** 2)


@groups
@given(rng=generators, length=lengths)
def test_adjoint_of_exp_is_exp_of_ad(group, rng, length):
    from scipy.linalg import expm

    v = displacement(group, rng, length)
    expected = expm(group.ad(v)) if group.dim else np.zeros((0, 0))
    assert close(group.adjoint(group.exp(v)), expected, 10 * np.abs(group.ad(v)).sum())


@groups
@given(rng=generators)
def test_conjugation_passes_through_exp(group, rng):
    a, v = group.random(rng), rng.standard_normal(group.dim)
    left = group.compose(group.compose(a, group.exp(v)), group.inverse(a))
    right = group.exp(group.adjoint(a) @ v)
    scale = 10 * (1.0 + np.abs(a).sum()) * (1.0 + np.abs(v).sum())
    assert same_point(group, left, right, scale)
