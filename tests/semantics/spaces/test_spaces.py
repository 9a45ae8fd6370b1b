"""The registry of manifolds, the material form, and what importing costs."""

import pickle
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given

from ephs.semantics.spaces import (
    SE3,
    SO3,
    PairEntry,
    SO3xR3,
    SpaceError,
    codes,
    covector_of_gradient,
    manifold,
    material_covector,
    material_velocity,
    pair,
    register_manifold,
    register_pair,
    twist_of_velocity,
    vector_space,
)
from tests.numerics import EPS, generators, largest, slope
from tests.processes import printed


@dataclass(frozen=True)
class Space:
    name: str
    dim: int
    size: int
    parameters: tuple[tuple[str, float], ...] = ()


@pytest.mark.parametrize(
    ("space", "expected"),
    [
        (Space("real", 1, 1), codes.VECTOR),
        (Space("se(3)*", 6, 6), codes.VECTOR),
        (Space("so(3)xR3*", 6, 6), codes.VECTOR),
        (Space("anything*", 4, 4), codes.VECTOR),
        (Space("SE(3)", 6, 7), codes.SE3),
        (Space("SO(3)xR3", 6, 7), codes.SO3xR3),
        (Space("SO(3)", 3, 4), codes.SO3),
        (Space("SE(2)", 3, 3), codes.SE2),
        (Space("screw", 1, 1, (("pitch", 0.1),)), codes.VECTOR),
        (Space("planar", 3, 3), codes.SE2),
        (Space("spherical", 3, 4), codes.SO3),
        (Space("free", 6, 7), codes.SE3),
        (Space("fixed", 0, 0), codes.VECTOR),
    ],
)
def test_spaces_by_name(space, expected):
    found = manifold(space)
    assert (found.dim, found.size, found.code) == (space.dim, space.size, expected)
    assert found.identity().shape == (space.size,)
    assert manifold(space) is found


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: manifold(Space("SE(4)", 10, 14)), ["SE(4)", "SE(3)", "register_manifold"]),
        (lambda: manifold(Space("SE(3)", 6, 6)), ["SE(3)", "(6, 6)", "(6, 7)"]),
        (lambda: manifold(Space("real", 2, 3)), ["real", "(2, 3)", "(2, 2)"]),
        (lambda: register_manifold("SE(3)", lambda space: SE3), ["SE(3)", "registered already"]),
        (lambda: register_manifold("x*", lambda space: SE3), ["x*", "dual"]),
        (lambda: material_velocity(SO3, SO3.identity(), np.zeros(3)), ["SO(3)", "SE(3)", "SO(3)xR3"]),
        (lambda: pair("hinge"), ["hinge", "revolute", "register_pair"]),
        (lambda: pair("screw"), ["screw", "pitch", "[]"]),
        (lambda: pair("revolute", pitch=1.0), ["revolute", "pitch"]),
        (lambda: pair("planar").element(np.zeros(2)), ["planar", "(2,)", "(3,)"]),
        (lambda: register_pair(PairEntry("fixed", "1", np.zeros)), ["fixed", "registered already"]),
    ],
)
def test_faults_say_what_to_do(act, words):
    with pytest.raises(SpaceError) as caught:
        act()
    assert all(word in str(caught.value) for word in words)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_a_new_manifold_is_one_entry():
    register_manifold("the line of this test", lambda space: vector_space(space.name, 1))
    assert manifold(Space("the line of this test", 1, 1)).dim == 1


@pytest.mark.parametrize("group", [SE3, SO3xR3], ids=lambda g: g.name)
@given(rng=generators)
def test_material_form(group, rng):
    pose, u, f = group.random(rng), rng.standard_normal(6), rng.standard_normal(6)
    gradient = rng.standard_normal((3, 3)), rng.standard_normal(3)
    velocity = material_velocity(group, pose, u)
    scale = 64 * EPS * (1.0 + np.abs(u).sum()) * (1.0 + np.abs(f).sum() + np.abs(gradient[0]).sum())
    assert largest(twist_of_velocity(group, pose, velocity) - u) <= scale
    assert largest(covector_of_gradient(group, pose, material_covector(group, pose, f)) - f) <= scale
    # The two are dual: pairing on either side is the same number.
    ambient = np.sum(gradient[0] * velocity[0]) + gradient[1] @ velocity[1]
    terms = np.abs(gradient[0]).sum() * np.abs(velocity[0]).sum() + np.abs(gradient[1]).sum() * np.abs(u).sum()
    assert abs(covector_of_gradient(group, pose, gradient) @ u - ambient) <= 64 * EPS * (1 + terms)
    # The velocity is the one of the curve that the twist makes.
    from ephs.semantics.spaces.rotations import quaternion_to_matrix

    size = 1e-9 * (1.0 + np.abs(u).sum()) ** 3
    assert largest(slope(lambda t: quaternion_to_matrix(group.retract(pose, t * u)[:4]), 1e-5) - velocity[0]) <= size
    assert largest(slope(lambda t: group.retract(pose, t * u)[4:], 1e-5) - velocity[1]) <= size


def test_the_reference_needs_numpy_only():
    code = "import sys, ephs.semantics.spaces\nprint([m for m in ('llvmlite', 'scipy', 'sympy') if m in sys.modules])"
    assert printed(code) == "[]\n"
