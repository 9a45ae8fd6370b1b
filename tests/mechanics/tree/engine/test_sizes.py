"""References of tolerances, rounding of balances, and what components made, as steps of mechanisms take them."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.tree.engine.programs import of_motion
from ephs.semantics.stage import Program, real, vector
from ephs.solve.march.account import ROUNDING
from ephs.testing import mechanisms
from tests.mechanics.tree.engine.test_engine import SCENES
from tests.numerics import EPS, largest
from tests.scenes import equations_of


def sized(on, motion, y0, y1, out):
    motion.sizes(on, y0, y1, out)


def rounded(on, motion, anchor, y, out):
    out[0] = motion.rounding(on, anchor, y)


PROGRAM = Program(
    "sizes_of_steps",
    sizes=of_motion(sized, looped=False, y0=vector(), y1=vector(), out=vector()),
    rounding=of_motion(rounded, looped=False, anchor=real(), y=vector(), out=vector(1)),
)


@cache
def equations(name):
    return equations_of(ephs.load(SCENES[name]))


def called(eq, name, *arguments):
    PROGRAM.compiled()[name].bind(*arguments, first=eq.engine._first)()


@settings(max_examples=15)
@given(scene=mechanisms(max_bodies=3), seed=st.integers(0, 99))
def test_rates_of_a_joint_count_as_its_largest(scene, seed):
    """Increments count as 1 rad or m, heats as their larger end."""
    eq = equations_of(scene)
    y0, y1 = np.random.default_rng(seed).standard_normal((2, eq.size))
    found, larger = np.zeros(2 * eq.n + eq.ns), np.maximum(np.abs(y0), np.abs(y1))[eq.nv : eq.nv + eq.n + eq.ns]
    called(eq, "sizes", y0, y1, found)
    tables, counted = eq.reduced.tables, 0
    for first, dim in zip(tables.r_at[: eq.reduced.links].tolist(), tables.dim.tolist(), strict=False):
        joint = larger[first : first + dim]
        assert np.all(found[eq.n + first : eq.n + first + dim] == joint.max(initial=0.0))
        counted += dim
    assert counted == eq.n
    assert np.all(found[: eq.n] == 1.0)
    assert np.array_equal(found[2 * eq.n :], larger[eq.n :])


@pytest.mark.parametrize("name", ["hot-brake", "slider-crank", "screw-press"])
def test_rounding_is_that_of_the_anchor_the_work_and_the_heat(name):
    eq, found = equations(name), np.zeros(1)
    y = np.arange(1.0, eq.size + 1.0)
    heat, work = y[eq.nv + eq.n + eq.ns :][:2]
    called(eq, "rounding", -1000.0, y, found)
    assert found[0] == ROUNDING * (1000.0 + work + heat)  # whole numbers


@pytest.mark.parametrize("name", ["hot-brake", "motor-four-bar", "screw-press"])
@given(seed=st.integers(0, 99))
@settings(max_examples=10)
def test_totals_count_from_wherever_a_step_finds_them(name, seed):
    """What a step adds to heat, work and flows does not depend on what they were."""
    eq = equations(name)
    rng, at = np.random.default_rng(seed), eq.nv + eq.n + eq.ns
    start = eq.vector(eq.start(0.0))
    end, shift = start + 1e-3 * rng.random(start.size), np.zeros(start.size)
    shift[at:] = rng.standard_normal(start.size - at)
    one, other = eq.settled(start, end.copy()), eq.settled(start + shift, end + shift)
    assert largest(other - shift - one) <= 64.0 * EPS * (1.0 + largest(one) + largest(shift))
