"""Velocities on the joints: sparse matrices find those of the dense pseudoinverse, and leave the joints closed."""

import numpy as np
import pytest
from hypothesis import given, settings

import ephs
from benchmarks import families
from ephs.mechanics.motion import motion
from ephs.testing import mechanisms

# κ of the constraints of a few bodies, in the mass metric; see the rule for linear solves
BOUND = 1e-9


def twists_by(monkeypatch, solution, most):
    """Twists and rates with sparse matrices for more than so many joints."""
    monkeypatch.setattr(motion, "MANY", most)
    problem = solution.problem
    read = problem.motion(solution)
    return read.twists, read.rates


def same(one, other):
    for name in one:
        size = max(1.0, float(np.abs(one[name]).max(initial=0.0)))
        np.testing.assert_allclose(one[name], other[name], rtol=0.0, atol=BOUND * size)


@pytest.mark.parametrize("family", families.FAMILIES)
def test_sparse_matrices_find_what_dense_ones_find(family, monkeypatch):
    solution = ephs.simulate(families.scene(family, 4), 0.1, method="natural", step=0.02)
    for one, other in zip(twists_by(monkeypatch, solution, 1000), twists_by(monkeypatch, solution, 0), strict=True):
        same(one, other)


@settings(deadline=None, max_examples=15)
@given(mechanisms())
def test_on_drawn_mechanisms_too(scene):
    solution = ephs.simulate(scene, 0.02, method="natural", step=0.01)
    with pytest.MonkeyPatch.context() as patch:
        dense, sparse = twists_by(patch, solution, 1000), twists_by(patch, solution, 0)
    for one, other in zip(dense, sparse, strict=True):
        same(one, other)


def test_velocities_of_a_long_chain_keep_its_joints_closed():
    scene = families.scene("revolute-chain", 60)
    solution = ephs.simulate(scene, 0.02, method="natural", step=0.01)
    assert float(solution.velocity_error.max()) < BOUND
