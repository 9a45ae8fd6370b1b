"""Every compiled kernel equals the plain reference; none needs its outputs apart from its inputs."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.semantics.spaces import PAIRS, SE2, SE3, SO3, SO3xR3, pair, vector_space
from ephs.semantics.spaces import se3_kernels as kernels
from ephs.semantics.spaces.rotations import quaternion_to_matrix

GROUPS = [vector_space("real", 3), vector_space("nothing", 0), SO3, SE2, SE3, SO3xR3]
EPS = np.finfo(float).eps
seeds = st.integers(0, 2**32 - 1)
groups = pytest.mark.parametrize("group", GROUPS, ids=lambda g: f"{g.name}{g.dim}")


def turned(q, v):
    return quaternion_to_matrix(q) @ v


def back(q, v):
    return quaternion_to_matrix(q).T @ v


# kernel: (inputs, shape of the output, reference). Inputs: a rotation q, pose p, motion of the plane m,
# vectors of 3 (v) or 6 (u) numbers with principal angles.
TABLE: dict[str, tuple[str, tuple[int, ...], Callable[..., np.ndarray]]] = {
    "quat_multiply": ("qq", (4,), SO3.compose),
    "quat_rotate": ("qv", (3,), turned),
    "quat_rotate_back": ("qv", (3,), back),
    "quat_to_matrix": ("q", (3, 3), quaternion_to_matrix),
    "so3_exp_quat": ("v", (4,), SO3.exp),
    "so3_log_quat": ("q", (3,), SO3.log),
    "so3_left_jacobian": ("v", (3, 3), SO3.dexp),
    "so3_left_jacobian_inv": ("v", (3, 3), SO3.dexp_inv),
    "pose_compose": ("pp", (7,), SE3.compose),
    "pose_inverse": ("p", (7,), SE3.inverse),
    "pose_between": ("pp", (7,), lambda a, b: SE3.compose(SE3.inverse(a), b)),
    "pose_exp": ("u", (7,), SE3.exp),
    "pose_log": ("p", (6,), SE3.log),
    "pose_retract": ("pu", (7,), SE3.retract),
    "pose_increment": ("pp", (6,), SE3.increment),
    "adjoint": ("p", (6, 6), SE3.adjoint),
    "adjoint_inverse": ("p", (6, 6), lambda p: SE3.adjoint(SE3.inverse(p))),
    "adjoint_apply": ("pu", (6,), lambda p, u: SE3.adjoint(p) @ u),
    "coadjoint_apply": ("pu", (6,), lambda p, u: SE3.coadjoint(p) @ u),
    "ad": ("u", (6, 6), SE3.ad),
    "dexp": ("u", (6, 6), SE3.dexp),
    "dexp_inv": ("u", (6, 6), SE3.dexp_inv),
    "pose_dexp_left": ("u", (6, 6), SE3.dexp_left),
    "pose_dexp_left_inv": ("u", (6, 6), SE3.dexp_left_inv),
    "se2_compose": ("mm", (3,), SE2.compose),
    "se2_inverse": ("m", (3,), SE2.inverse),
    "se2_exp": ("v", (3,), SE2.exp),
    "se2_log": ("m", (3,), SE2.log),
    "se2_retract": ("mv", (3,), SE2.retract),
    "se2_increment": ("mm", (3,), SE2.increment),
    "se2_dexp": ("v", (3, 3), SE2.dexp),
    "se2_dexp_inv": ("v", (3, 3), SE2.dexp_inv),
    "se2_dexp_left": ("v", (3, 3), SE2.dexp_left),
    "se2_dexp_left_inv": ("v", (3, 3), SE2.dexp_left_inv),
}
# Tested on their own below.
OTHERS = {"retract", "increment", "midpoint", "dexp_left", "dexp_left_inv", "include", "pose_normalise"}
# Imported for use by the kernels of that file.
HELPERS = {"exp_quaternion", "log_quaternion", "polynomial", "product", "write_block", "beta", "cot", "gamma"}


def draw(letter, rng):
    match letter:
        case "q":
            return SO3.random(rng)
        case "p":
            return SE3.random(rng)
        case "m":
            return SE2.random(rng)
        case _:
            v = rng.standard_normal(3 if letter == "v" else 6)
            v[:3] *= rng.choice([0.0, 1e-12, 1e-4, 0.3, 0.7, 0.9999, 2.0, 3.1]) / np.linalg.norm(v[:3])
            return v


def same(found, expected, scale):
    """Equal up to rounding; quaternions up to their sign."""
    if found.shape in {(4,), (7,)} and found[:4] @ expected[:4] < 0:
        expected = np.concatenate((-expected[:4], expected[4:]))
    return np.all(np.abs(found - expected) <= 64 * EPS * (1.0 + scale))


def test_no_kernel_is_left_out():
    public = {name for name, value in vars(kernels).items() if callable(value) and not name.startswith("_")}
    assert public - HELPERS - {"kernel", "Array"} == TABLE.keys() | OTHERS


@pytest.mark.parametrize("name", TABLE)
@given(seed=seeds)
def test_kernel_is_the_reference(name, seed):
    letters, shape, reference = TABLE[name]
    rng = np.random.default_rng(seed)
    inputs = [draw(letter, rng) for letter in letters]
    kept, out = [x.copy() for x in inputs], np.full(shape, np.nan)
    getattr(kernels, name)(*inputs, out)
    scale = float(np.prod([1.0 + np.abs(x).sum() for x in inputs]))
    assert same(out, reference(*inputs), scale)
    assert all(np.array_equal(x, y) for x, y in zip(inputs, kept, strict=True))
    if shape in {(4,), (7,)}:
        assert abs(out[:4] @ out[:4] - 1.0) <= 8 * EPS
    for i, x in enumerate(kept):
        if x.shape == shape:
            aliased = [y.copy() for y in kept]
            getattr(kernels, name)(*aliased, aliased[i])
            assert np.array_equal(aliased[i], out)


@groups
@given(seed=seeds)
def test_kernels_by_code(group, seed):
    rng = np.random.default_rng(seed)
    x0 = group.random(rng)
    v = draw("u", rng)[: group.dim]
    x1, w, middle = np.empty(group.size), np.empty(group.dim), np.empty(group.size)
    scale = float((1.0 + np.abs(x0).sum()) * (1.0 + np.abs(v).sum()))
    kernels.retract(group.code, x0, v, x1)
    assert same(x1, group.retract(x0, v), scale)
    kernels.increment(group.code, x0, x1, w)
    assert np.abs(w - v).max(initial=0.0) <= 64 * EPS * scale
    kernels.midpoint(group.code, x0, x1, w, middle)
    assert same(middle, group.midpoint(x0, x1), scale)
    left, inverse = np.full((2, group.dim, group.dim), np.nan)
    kernels.dexp_left(group.code, v, left)
    kernels.dexp_left_inv(group.code, v, inverse)
    assert same(left, group.dexp_left(v), scale)
    assert same(inverse, group.dexp_left_inv(v), scale)
    aliased = x0.copy()
    kernels.retract(group.code, aliased, v, aliased)
    assert np.array_equal(aliased, x1)


@pytest.mark.parametrize("kind", PAIRS)
@given(seed=seeds)
def test_include(kind, seed):
    rng = np.random.default_rng(seed)
    joint = pair(kind, **dict.fromkeys(PAIRS[kind].parameters, 0.3))
    x, out = joint.manifold.random(rng), np.full(7, np.nan)
    kernels.include(joint.code, joint.basis, x, out)
    assert same(out, joint.include(x), np.abs(x).sum())


@given(seed=seeds)
def test_normalise(seed):
    pose = SE3.random(np.random.default_rng(seed))
    longer = np.concatenate((1.7 * pose[:4], pose[4:]))
    kernels.pose_normalise(longer)
    assert same(longer, pose, 1.0)


def test_unit_length_is_kept_over_many_steps():
    pose, step = SE3.identity(), np.array([0.3, -0.2, 0.1, 1.0, 0.0, 0.0])
    for _ in range(20_000):
        kernels.retract(SE3.code, pose, step, pose)
    assert abs(pose[:4] @ pose[:4] - 1.0) <= 8 * EPS
