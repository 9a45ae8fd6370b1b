"""Differentials of exponential maps, against power series in many digits, differences and other libraries."""

import mpmath
import numpy as np
import pytest
from hypothesis import given

from ephs.semantics.spaces import SE2, SE3, SO3, SO3xR3, se3, so3
from ephs.semantics.spaces.differentials import dexp_left, dexp_left_inv
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.stage import PLAIN
from tests.numerics import EPS, generators, largest, slope
from tests.semantics.spaces.test_groups import displacement as of_length

GROUPS = [SO3, SE2, SE3, SO3xR3]
ANGLES = [0.0, 1e-12, 1e-6, 1e-3, 0.1, 0.499, 0.501, 0.999, 1.001, 2.0, 3.1]

# (ω, υ) here, (υ, ω) there.
SWAP = [3, 4, 5, 0, 1, 2]

groups = pytest.mark.parametrize("group", GROUPS, ids=lambda g: g.name)


def series(matrix, shift):
    """Σ Aᵏ / (k + shift)! with 40 digits: exp for 0, dexp for 1."""
    with mpmath.workdps(40):
        a = mpmath.matrix(matrix.tolist())
        power = mpmath.eye(a.rows)
        total = power / mpmath.factorial(shift)
        for k in range(1, 60):
            power = power * a
            total += power / mpmath.factorial(k + shift)
        return total


def error(found, exact):
    """Largest entry of found − exact, taken before rounding."""
    with mpmath.workdps(40):
        n, m = found.shape
        return float(max(abs(mpmath.mpf(float(found[i, j])) - exact[i, j]) for i in range(n) for j in range(m)))


def displacement(group, angle):
    return of_length(group, np.random.default_rng(7), angle)


@groups
@pytest.mark.parametrize("angle", ANGLES)
def test_dexp_to_the_last_digits(group, angle):
    v = displacement(group, angle)
    exact = series(group.ad(v), 1)
    with mpmath.workdps(40):
        inverse = exact**-1
    left, left_inv = dexp_left(group.code, -v), dexp_left_inv(group.code, -v)
    size = 1.0 + np.abs(v).sum()
    for found in (group.dexp(v), left):
        assert error(found, exact) <= 4 * EPS * size
    for found in (group.dexp_inv(v), left_inv):
        assert error(found, inverse) <= 8 * EPS * size


@pytest.mark.parametrize("angle", [4.0, 5.0, 6.0, 6.2])
def test_dexp_inv_beyond_half_a_turn(angle):
    v = displacement(SE3, angle)
    found = np.array(se3.dexp_inv(PLAIN, v.tolist()))
    with mpmath.workdps(40):
        exact = series(SE3.ad(v), 1) ** -1
    # Condition grows like the inverse square of the distance to a full turn.
    bound = 8 * EPS * float(mpmath.mnorm(exact, "f")) / (2 * np.pi - angle)
    assert error(found, exact) <= bound
    assert error(SE3.dexp_inv(v), exact) <= bound


@pytest.mark.parametrize("angle", ANGLES)
def test_exp_to_the_last_digits(angle):
    v = displacement(SE3, angle)
    matrix = np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3] = SO3.ad(v[:3]), v[3:]
    exact = series(matrix, 0)
    pose = se3.exp(PLAIN, v.tolist())
    assert error(np.column_stack((so3.matrix(pose[:4]), pose[4:])), exact[:3, :]) <= 8 * EPS * (1 + np.abs(v).sum())
    pose = SE3.exp(v)
    found = np.column_stack((quaternion_to_matrix(pose[:4]), pose[4:]))
    assert error(found, exact[:3, :]) <= 8 * EPS * (1 + np.abs(v).sum())


@groups
@given(rng=generators)
def test_relations_between_the_differentials(group, rng):
    v = rng.standard_normal(group.dim)
    eye, size = np.eye(group.dim), 100 * EPS * (1.0 + np.abs(v).sum()) ** 2
    assert largest(group.dexp(v) - group.adjoint(group.exp(v)) @ group.dexp_left(v)) <= size
    # Ad_exp(v) − 1 = ad_v dexp_v.
    assert largest(group.adjoint(group.exp(v)) - eye - group.ad(v) @ group.dexp(v)) <= size
    if np.linalg.norm(v[:3]) < 4.0:
        assert largest(group.dexp(v) @ group.dexp_inv(v) - eye) <= 10 * size
        assert largest(group.dexp_left_inv(v) @ group.dexp_left(v) - eye) <= 10 * size


@groups
@given(rng=generators)
def test_rates_along_a_motion(group, rng):
    q, u, w, p = group.random(rng), *(rng.standard_normal(group.dim) for _ in range(3))
    inverse = group.adjoint(group.inverse(q))
    rate = slope(lambda t: group.adjoint(group.inverse(group.retract(q, t * u))), 1e-5)
    size = 1e-9 * (1.0 + np.abs(u).sum()) ** 3 * (1.0 + np.abs(q).sum()) * (1.0 + np.abs(p).sum() + np.abs(w).sum())
    assert largest(rate + group.ad(u) @ inverse) <= size
    # d/dt (Ad*_{q⁻¹} p) = Ad*_{q⁻¹} (ṗ − ad*_u p), here with ṗ = w.
    change = slope(lambda t: group.coadjoint(group.inverse(group.retract(q, t * u))) @ (p + t * w), 1e-5)
    assert largest(change - group.coadjoint(group.inverse(q)) @ (w - group.ad(u).T @ p)) <= size


@groups
@given(rng=generators)
def test_variation_of_a_twist(group, rng):
    """δu = η̇ + ad_u η for q(t, s) with twist u along t and η along s."""
    q, a, b, c = group.random(rng), *(rng.standard_normal(group.dim) for _ in range(3))
    h = 1e-4

    def point(t, s):
        return group.retract(group.retract(q, t * a + t * s * c), s * b)

    def along_t(s):
        return group.increment(point(-h, s), point(h, s)) / (2 * h)

    def along_s(t):
        return group.increment(point(t, -h), point(t, h)) / (2 * h)

    size = (1.0 + np.abs(a).sum() + np.abs(b).sum() + np.abs(c).sum()) ** 3
    bracket = group.ad(along_t(0.0)) @ along_s(0.0)
    assert largest(slope(along_t, h) - slope(along_s, h) - bracket) <= 1e-6 * size


@given(rng=generators)
def test_agrees_with_pinocchio(rng):
    import pinocchio

    v = rng.standard_normal(6)
    v[:3] *= rng.uniform(1e-2, 3.0) / np.linalg.norm(v[:3])
    motion = pinocchio.Motion(v[3:], v[:3])
    placement, pose = pinocchio.exp6(motion), SE3.exp(v)
    size = 1e-12 * (1 + np.abs(v).sum()) ** 2
    assert largest(placement.rotation - quaternion_to_matrix(pose[:4])) <= size
    assert largest(placement.translation - pose[4:]) <= size
    assert largest(pinocchio.log6(placement).vector[SWAP] - SE3.log(pose)) <= size
    assert largest(placement.action[np.ix_(SWAP, SWAP)] - SE3.adjoint(pose)) <= size
    assert largest(motion.action[np.ix_(SWAP, SWAP)] - SE3.ad(v)) <= size
    assert largest(pinocchio.Jexp6(motion)[np.ix_(SWAP, SWAP)] - SE3.dexp_left(v)) <= 1e2 * size
    assert largest(pinocchio.Jlog6(placement)[np.ix_(SWAP, SWAP)] - SE3.dexp_left_inv(v)) <= 1e2 * size
