"""Dry friction of joints: closed forms of sliding, stopping and creeping, its heat, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ephs
from ephs.mechanics.elements.joints import joint
from ephs.mechanics.scene.parameters import read, varied
from ephs.mechanics.shapes.dry import Dry
from tests.written import scene_of_text

SCENE = """
format = 1
[world]
gravity = [0, 0, 0]
[bodies.block]
mass = 1.0
inertia = [1, 1, 1]
[joints.rail]
type = "prismatic"
bodies = ["ground", "block"]
frame1 = {{ position = [0, 0, 0] }}
frame2 = {{ position = [0, 0, 0] }}
{joint}
"""
FORCE, SLIP = 2.0, 1e-2


def block(text):
    return scene_of_text(SCENE.format(joint=text))


@pytest.mark.parametrize(
    ("method", "step", "near"),
    [
        ("auto", None, 1e-6), ("rk54", None, 1e-6), ("rk87", None, 1e-6), ("radau", None, 1e-6),
        ("natural", 1e-3, 1e-6), ("natural4", 1e-3, 1e-9), ("variational", 1e-3, 1e-6),
    ],
)  # fmt: skip
def test_a_block_slides_as_far_as_its_energy_lasts(method, step, near):
    """From v to rest: x = (v √(v² + ε²)/2 + ε²/2 asinh(v/ε)) m/c; all its energy becomes heat."""
    scene = block(f"rate = 1.0\ndry = {{ coulomb = {FORCE}, slip = {SLIP} }}")
    sol = ephs.simulate(scene, 1.0, method=method, step=step, rtol=1e-8, atol=1e-10)
    way = (0.5 * np.hypot(1.0, SLIP) + 0.5 * SLIP**2 * np.arcsinh(1.0 / SLIP)) / FORCE
    assert abs(sol.joint("rail").coordinate[-1, 0] - way) <= near
    assert abs(sol.joint("rail").rate[-1, 0]) <= 1e-9
    assert sol.heat[-1] == pytest.approx(0.5, abs=1e-14)
    assert np.all(np.diff(sol.heat) >= 0.0)


def test_without_it_the_block_slides_on():
    sol = ephs.simulate(block("rate = 1.0"), 1.0)
    assert sol.joint("rail").coordinate[-1, 0] == pytest.approx(1.0, abs=1e-12) and sol.heat[-1] == 0.0


@pytest.mark.parametrize("push", [0.5, 1.9])
def test_below_the_limit_it_creeps_and_above_it_accelerates(push):
    law = f"dry = {{ coulomb = {FORCE}, slip = {SLIP} }}\n"
    sol = ephs.simulate(block(law + f"drive = {push}"), 5.0, rtol=1e-9, atol=1e-12)
    creep = SLIP * push / np.sqrt(FORCE**2 - push**2)
    assert sol.joint("rail").rate[-1, 0] == pytest.approx(creep, rel=1e-6)
    assert sol.heat[-1] == pytest.approx(sol.work[-1] - 0.5 * creep**2, rel=1e-9)
    beyond = ephs.simulate(block(law + "drive = 3.0"), 1.0)
    assert beyond.joint("rail").rate[-1, 0] == pytest.approx(1.0, abs=0.02)  # (3 − 2) N on 1 kg


def test_a_pushed_joint_breaks_away_at_the_static_force():
    """Of c = 1 N and a = 2 N: under 1.5 N a block at rest creeps, a block that slides faster than s goes on."""
    law = "drive = 1.5\ndry = { coulomb = 1.0, static = 2.0, stribeck = 0.05, slip = 1e-3 }\n"
    held = ephs.simulate(block(law), 0.5, method="radau")
    sliding = ephs.simulate(block(law + "rate = 0.5"), 0.5, method="radau")
    assert abs(held.joint("rail").rate[-1, 0]) < 2e-3
    assert sliding.joint("rail").rate[-1, 0] == pytest.approx(0.75, abs=1e-3)  # (1.5 − 1) N on 1 kg


def test_stops_and_dry_friction_of_one_joint():
    text = "rate = 1.0\nlimits = [-1.0, 0.1]\nlimit_stiffness = 1e4\ndry = { coulomb = 2.0, slip = 0.01 }"
    sol = ephs.simulate(block(text), 1.0, method="radau")
    assert sol.joint("rail").coordinate.max() < 0.12
    assert sol.heat[-1] == pytest.approx(0.5, abs=1e-12)
    assert sol.joint("rail").coordinate[-1, 0] < 0.1  # it came back


@given(
    st.floats(-1e3, 1e3), st.floats(0.0, 1e3), st.floats(1.0, 3.0), st.floats(1e-3, 1.0), st.floats(1e-4, 1.0),
    st.floats(0.1, 10.0), st.floats(0.1, 10.0),
)  # fmt: skip
def test_the_force_is_even_bounded_and_independent_of_units(rate, coulomb, more, stribeck, slip, force, speed):
    law = Dry(coulomb, more * coulomb, stribeck, slip)
    found = law.resistance(rate)
    assert found >= 0.0 and found == law.resistance(-rate)
    assert found * abs(rate) <= law.start * (1.0 + 1e-15)
    other = law.rescaled(force, speed).resistance(rate * speed) * speed
    assert other == pytest.approx(found * force, rel=1e-13 * (1.0 + (rate / stribeck) ** 2), abs=1e-300)


def test_its_numbers_are_parameters():
    scene = block("rate = 1.0\ndry = { coulomb = 2.0 }")
    assert read(scene, "joints.rail.dry.coulomb") == read(scene, "joints.rail.dry.static") == 2.0
    assert varied(scene, {"joints.rail.dry.slip": 0.1}).joint("rail").dry.slip == 0.1
    found = ephs.sensitivity(varied(scene, {"joints.rail.dry.slip": 0.1}), ["joints.rail.dry.coulomb"], 0.2)
    apart = [
        ephs.simulate(
            varied(scene, {"joints.rail.dry.slip": 0.1, "joints.rail.dry.coulomb": 2.0 + e}), 0.2, method="rk87",
            rtol=1e-12, atol=1e-12,
        ).joint("rail").coordinate[-1, 0]
        for e in (1e-4, -1e-4)
    ]  # fmt: skip
    assert found["joints.rail.coordinate"][-1, 0, 0] == pytest.approx((apart[0] - apart[1]) / 2e-4, rel=1e-6)


def test_joints_of_several_freedoms_are_refused():
    with pytest.raises(ephs.StructureError, match="dry friction of a joint with 3 degrees of freedom"):
        joint("spherical", dry=Dry(1.0))
