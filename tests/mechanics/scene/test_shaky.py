"""Mechanisms that move to first order only, against rows of bars whose closing is known by hand."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.scene.meant import is_shaky
from examples.failing import scene
from tests.scenes import shipped


def row(points, gravity=9.81):
    """Bars between these points of the plane, pinned to each other and to the ground at both ends."""
    points, out = np.array(points, dtype=float), []
    for k, (a, b) in enumerate(pairwise(points)):
        angle, middle = 0.5 * np.arctan2(*(b - a)[::-1]), 0.5 * (a + b)
        rotation = [float(np.cos(angle)), 0.0, 0.0, float(np.sin(angle))]
        out.append(
            f"[bodies.b{k}]\nmass = 1.0\ninertia = [0.01, 0.1, 0.1]\n"
            f"position = {[*middle.tolist(), 0.0]}\nrotation = {rotation}\n"
        )
    names = ["ground", *(f"b{k}" for k in range(len(points) - 1)), "ground"]
    for k, at in enumerate(points):
        out.append(
            f'[joints.j{k}]\ntype = "revolute"\nbodies = ["{names[k]}", "{names[k + 1]}"]\n'
            f"at = {[*at.tolist(), 0.0]}\naxis = [0.0, 0.0, 1.0]\n"
        )
    return scene("".join(out), f"[world]\ngravity = [0.0, {-gravity}, 0.0]\n")


@settings(max_examples=3, deadline=None)
@given(lengths=st.lists(st.floats(0.3, 3.0), min_size=2, max_size=3))
def test_bars_stretched_to_their_whole_length_are_shaky(lengths):
    """The distance of the ends is the greatest that there is: no other configuration has it."""
    assert is_shaky(row([(x, 0.0) for x in (0.0, *np.cumsum(lengths))]))


@settings(max_examples=3, deadline=None)
@given(x=st.floats(0.2, 1.8), y=st.floats(0.2, 1.0), end=st.floats(0.5, 1.5))
def test_bars_out_of_line_are_not(x, y, end):
    """Two of them stand still, three move."""
    assert not is_shaky(row([(0.0, 0.0), (x, y), (2.0, 0.0)]))
    assert not is_shaky(row([(0.0, 0.0), (x, y), (2.0, end), (2.5, 0.0)]))


@pytest.mark.parametrize(
    "points", [[(0, 0), (1, 0), (3, 0), (2, 0)], [(0, 0), (1, 0), (2.5, 0), (1.3, 0)], [(0, 0), (1, 0), (0, 0)]]
)
def test_linkages_in_line_that_can_leave_it_are_not(points):
    """A parallelogram where its motions branch, a crank folded back, and two equal bars that turn as one."""
    assert not is_shaky(row(points))


@pytest.mark.parametrize("name", ["bricard", "four-bar", "slider-crank", "chain"])
def test_shipped_mechanisms_are_not(name):
    assert not is_shaky(shipped(name))


def test_without_a_load_it_stands_still():
    still = row([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)], gravity=0.0)
    assert ephs.simulate(still, 0.1, step=0.01).body("b0").position[-1] == pytest.approx([0.5, 0.0, 0.0], abs=0.0)
