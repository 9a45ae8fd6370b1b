"""Velocities and wrenches by the sweeps are those of the general form, which shares no table with them."""

import numpy as np
import pytest
from hypothesis import given, settings

import ephs
from benchmarks import families
from ephs.mechanics.motion.general import GeneralMotion
from ephs.mechanics.motion.reduced import ReducedMotion
from ephs.mechanics.tree.finding.frames import frames_of
from ephs.testing import mechanisms

# κ of the constraints of a few bodies, in the mass metric; see the rule for linear solves
BOUND = 1e-9


def same(one, other):
    size = max(1.0, float(np.nanmax(np.abs(other), initial=0.0)))
    np.testing.assert_allclose(one, other, rtol=0.0, atol=BOUND * size)


def compare(solution):
    swept = ReducedMotion.of(solution)
    frames = frames_of(solution.problem.descriptor)
    general = GeneralMotion(solution, frames)
    assert swept is not None
    for path, twist in general.twists.items():
        same(swept.twists[path], twist)
    for joint in frames.joints:
        same(swept.rate(joint.path), general.rate(joint.path))
        same(swept.wrench(joint.path), general.wrench(joint.path))


@pytest.mark.parametrize("family", families.FAMILIES)
def test_sweeps_find_what_the_general_form_finds(family):
    compare(ephs.simulate(families.scene(family, 3), 0.02, method="natural", step=0.01))


@settings(max_examples=8)
@given(mechanisms())
def test_on_drawn_mechanisms_too(scene):
    compare(ephs.simulate(scene, 0.02, method="natural", step=0.01))


def test_velocities_of_a_long_chain_keep_its_joints_closed():
    scene = families.scene("revolute-chain", 60)
    solution = ephs.simulate(scene, 0.02, method="natural", step=0.01)
    assert float(solution.velocity_error.max()) < BOUND
