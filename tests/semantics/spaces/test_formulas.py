"""The staged formulas of the groups equal the plain references, in floats and, bit for bit, as machine code."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ephs.semantics.spaces import PAIRS, SE2, SE3, SO3, SO3xR3, codes, pair, se2, se3, so3, vector_space
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.spaces.staged_groups import STAGED, included
from ephs.semantics.spaces.vectors import symmetric_inverse, upper
from ephs.semantics.stage import PLAIN, Entry, Program, vector
from tests.numerics import EPS, generators, largest
from tests.staged import run_both

GROUPS = {codes.VECTOR: vector_space("real", 3), codes.SO3: SO3, codes.SE2: SE2, codes.SE3: SE3, codes.SO3xR3: SO3xR3}


def alone(function):
    """A function of numbers that needs no evaluator."""
    return lambda on, *arguments: function(*arguments)


# name: (function, inputs, reference). Inputs: a rotation q, pose p, planar motion m, vectors of 3 (v) or 6 (u).
FORMULAS = {
    "so3_multiply": (so3.multiply, "qq", SO3.compose),
    "so3_rotate": (alone(so3.rotate), "qv", lambda q, v: quaternion_to_matrix(q) @ v),
    "so3_matrix": (alone(so3.matrix), "q", quaternion_to_matrix),
    "so3_exp": (so3.exp, "v", SO3.exp),
    "so3_log": (so3.log, "q", SO3.log),
    "so3_dexp": (so3.dexp, "v", SO3.dexp),
    "so3_dexp_inv": (so3.dexp_inv, "v", SO3.dexp_inv),
    "so3_difference": (so3.difference, "qq", SO3.increment),
    "se3_compose": (se3.compose, "pp", SE3.compose),
    "se3_inverse": (alone(se3.inverse), "p", SE3.inverse),
    "se3_between": (se3.between, "pp", lambda a, b: SE3.compose(SE3.inverse(a), b)),
    "se3_exp": (se3.exp, "u", SE3.exp),
    "se3_log": (se3.log, "p", SE3.log),
    "se3_adjoint": (alone(se3.adjoint), "pu", lambda p, u: SE3.adjoint(p) @ u),
    "se3_bracket": (alone(se3.bracket), "uu", lambda u, w: SE3.ad(u) @ w),
    "se3_cobracket": (alone(se3.cobracket), "uu", lambda u, p: SE3.ad(u).T @ p),
    "se3_dexp": (se3.dexp, "u", SE3.dexp),
    "se3_dexp_inv": (se3.dexp_inv, "u", SE3.dexp_inv),
    "se2_compose": (se2.compose, "mm", SE2.compose),
    "se2_exp": (se2.exp, "v", SE2.exp),
    "se2_log": (se2.log, "m", SE2.log),
    "se2_increment": (se2.increment, "mm", SE2.increment),
    "se2_dexp": (se2.dexp, "v", SE2.dexp),
    "se2_dexp_inv": (se2.dexp_inv, "v", SE2.dexp_inv),
}
SIZES = {"q": 4, "p": 7, "m": 3, "v": 3, "u": 6}
QUATERNIONS = {"so3_multiply": 4, "so3_exp": 4, "se3_compose": 4, "se3_inverse": 4, "se3_between": 4, "se3_exp": 4}
"""Results that begin with a quaternion, whose sign means nothing."""


def draw(letter, rng, size):
    match letter:
        case "q":
            return SO3.exp(size * rng.standard_normal(3))
        case "p":
            return SE3.exp(size * rng.standard_normal(6))
        case _:
            return size * rng.standard_normal(SIZES[letter])


def flat(result):
    return [x for row in result for x in (row if isinstance(row, list) else [row])]


def entry(function, letters):
    sizes = [SIZES[letter] for letter in letters]

    def run(on, one, two, out):
        inputs = [[x[j] for j in range(n)] for x, n in zip((one, two), sizes, strict=False)]
        for k, value in enumerate(flat(function(on, *inputs))):
            out[k] = value

    return Entry(run, one=vector(), two=vector(), out=vector())


PROGRAM = Program("formulas", **{name: entry(function, letters) for name, (function, letters, _) in FORMULAS.items()})


@pytest.mark.parametrize("name", FORMULAS)
@settings(max_examples=20)
@given(rng=generators, size=st.sampled_from([0.0, 1e-9, 1e-4, 0.1, 0.5, 1.0]))
def test_a_formula_is_what_the_group_says(name, rng, size):
    _, letters, reference = FORMULAS[name]
    inputs = [draw(letter, rng, size) for letter in letters]
    expected = np.ravel(reference(*inputs))
    rest = [*[np.zeros(1)] * (2 - len(inputs)), np.zeros(expected.size)]
    *_, found = run_both(PROGRAM, name, *inputs, *rest, signed=False)
    k = QUATERNIONS.get(name, 0)
    found[:k] *= np.sign(found[:k] @ expected[:k]) if k else 1.0
    scale = max(1.0, *(largest(x) for x in inputs)) ** 2
    assert largest(found - expected) <= 100 * EPS * scale * max(1.0, largest(expected))


@pytest.mark.parametrize("code", STAGED)
@given(rng=generators)
def test_increments_and_differentials_undo_each_other(code, rng):
    group, formulas = GROUPS[code], STAGED[code]
    a, v = group.random(rng), 0.5 * rng.standard_normal(group.dim)
    b = formulas.retract(PLAIN, list(a), list(v))
    assert np.allclose(formulas.increment(PLAIN, list(a), b), v, atol=1e-13)
    assert np.allclose(group.increment(a, np.array(b)), v, atol=1e-13)
    inverse = np.array(formulas.dexp_left_inv(PLAIN, list(v)))
    assert np.allclose(inverse @ np.array(formulas.dexp(PLAIN, list(-v))), np.eye(group.dim), atol=1e-13)
    assert np.allclose(inverse, group.dexp_inv(-v), atol=1e-13)


@pytest.mark.parametrize("name", [*PAIRS])
@given(rng=generators)
def test_the_frame_of_a_joint_is_its_pose(name, rng):
    joint = pair(name, **{parameter: 0.3 for parameter in PAIRS[name].parameters})
    x = joint.manifold.random(rng)
    rotation, place = included(PLAIN, joint.code, joint.basis.T.tolist(), list(x))
    pose = joint.include(x)
    assert np.allclose(rotation, quaternion_to_matrix(pose[:4]), atol=1e-14)
    assert np.allclose(place, pose[4:], atol=1e-14 * max(1.0, largest(x, initial=0.0)))


@pytest.mark.parametrize("size", range(1, 7))
@given(rng=generators)
def test_a_symmetric_matrix_is_inverted_where_it_is_positive(size, rng):
    values = np.exp(rng.uniform(-3.0, 3.0, size))
    turn = np.linalg.qr(rng.standard_normal((size, size)))[0]
    inverse, sound = symmetric_inverse(PLAIN, (turn * values @ turn.T).tolist())
    exact = turn / values @ turn.T
    condition = values.max() / values.min()
    assert sound
    assert np.array_equal(upper(inverse), upper(np.transpose(inverse)))
    assert largest(np.array(inverse) - exact) <= 100 * EPS * condition * largest(exact)
    values[rng.integers(size)] *= -1.0
    assert not symmetric_inverse(PLAIN, (turn * values @ turn.T).tolist())[1]
