"""Pinocchio computes the same, to 1e-11: accelerations, forces, mass matrices, Jacobians, and their derivatives."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import ephs
from ephs.testing import mechanisms
from tests.mechanics.dynamics.pinocchio_models import KINDS, PinModel
from tests.numerics import generators, largest

ALIKE = 1e-11


@st.composite
def trees(draw, kinds):
    """(dynamics, Pinocchio's model, a state, generator)."""
    scene = draw(mechanisms(max_bodies=6, kinds=kinds, loops=False, friction=False, springs=False, heat=False))
    dynamics = ephs.dynamics(scene)
    assume(dynamics.layout.n > 0)
    state, other = dynamics.state0, PinModel(scene, dynamics)
    q, v = other.configuration(dynamics, state), other.vector(flat(dynamics, state.rates))
    return dynamics, other, state, q, v, draw(generators)


def alike(found, expected, scale=1.0):
    assert largest(found - expected) <= ALIKE * max(scale, largest(expected))


def flat(dynamics, by_joint):
    out = np.zeros(dynamics.layout.n)
    for name, where in dynamics.freedoms.items():
        out[where] = by_joint[name]
    return out


def whole(matrix):
    """A symmetric matrix of which Pinocchio fills the upper half."""
    return np.triu(matrix) + np.triu(matrix, 1).T


FAMILIES = pytest.mark.parametrize("kinds", [*((kind,) for kind in KINDS), tuple(KINDS)], ids="-".join)


@FAMILIES
@settings(max_examples=15)
@given(data=st.data())
def test_pinocchio_computes_the_same(kinds, data):
    dynamics, other, state, q, v, rng = data.draw(trees(kinds))
    n, model = dynamics.layout.n, other.model
    tau, a = rng.standard_normal((2, n))
    mass = other.matrix(whole(pin.crba(model, other.data, q)))
    alike(dynamics.mass_matrix(state), mass)
    condition = np.linalg.cond(mass)
    found = flat(dynamics, dynamics.acceleration(state, dynamics.layout.by_joint(tau)))
    expected = other.back(pin.aba(model, other.data, q, v, other.vector(tau)))
    alike(found, expected, condition)
    forces = flat(dynamics, dynamics.inverse_dynamics(state, dynamics.layout.by_joint(a)))
    alike(forces, other.back(pin.rnea(model, other.data, q, v, other.vector(a))))
    alike(dynamics.bias(state), other.back(pin.nonLinearEffects(model, other.data, q, v)))
    alike(dynamics.gravity(state), other.back(pin.computeGeneralizedGravity(model, other.data, q)))
    for name in dynamics.bodies(state):
        alike(dynamics.jacobian(state, name), other.body_jacobian(name, q))


@FAMILIES
@settings(max_examples=15)
@given(data=st.data())
def test_pinocchio_differentiates_the_same(kinds, data):
    dynamics, other, state, q, v, rng = data.draw(trees(kinds))
    n, model = dynamics.layout.n, other.model
    tau = rng.standard_normal(n)
    exact = dynamics.derivatives(state, dynamics.layout.by_joint(tau))
    by_q, by_v, by_force = pin.computeABADerivatives(model, other.data, q, v, other.vector(tau))
    condition = np.linalg.cond(exact.force_a)
    size = max(largest(other.matrix(by_q)), condition)
    alike(exact.acceleration_q, other.matrix(by_q), size)
    alike(exact.acceleration_r, other.matrix(by_v), size)
    alike(exact.acceleration_force, other.matrix(whole(by_force)), size)
    a = other.vector(flat(dynamics, dynamics.acceleration(state, dynamics.layout.by_joint(tau))))
    by_q, by_v, _ = pin.computeRNEADerivatives(model, other.data, q, v, a)
    alike(exact.force_q, other.matrix(by_q))
    alike(exact.force_r, other.matrix(by_v))
