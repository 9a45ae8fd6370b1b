"""Gears: constant relations of the rates of joints, by every method and against the general form."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import ephs
from ephs.mechanics.tree.finding.frames import Unplaced
from tests.mechanics.tree.general import held_to_the_general_form
from tests.mechanics.tree.machines import GRAVITY, WHEEL, train
from tests.mechanics.tree.test_attached import assert_dense_rates_agree, equations_of

UNTIL = 0.5
AWAY, MESHED = 0.4, 0.7


@cache
def pair():
    """The second wheel meshes where it is, at an angle."""
    system, start = train([(False, AWAY), (False, 0.0)], [((0, 1), (2.0, -1.0))])
    turned = np.array([np.cos(0.5 * MESHED), 0.0, 0.0, np.sin(0.5 * MESHED), *start["w1.pe.q"][4:]])
    return system, start | {"w1.pe.q": turned, "h1.pe.q_r": np.array([MESHED])}


def pair_by_hand():
    """(angle, rate) of the first wheel, whose gear turns the second one twice as fast."""
    inertia = 0.5 + WHEEL * AWAY**2 + 4.0 * 0.5
    run = solve_ivp(
        lambda t, y: [y[1], -WHEEL * GRAVITY * AWAY * np.cos(y[0]) / inertia], (0.0, UNTIL), [0.0, 0.0],
        method="DOP853", rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    return run.y[:, -1]


@pytest.mark.parametrize("method", ["rk54", "rk87", "radau", "auto", "natural", "variational"])
def test_two_wheels_on_a_gear_turn_as_one_inertia_does(method):
    system, start = pair()
    second = method in ("natural", "variational")
    options = {"step": 1e-3} if second else {"rtol": 1e-11, "atol": 1e-12}
    run = ephs.simulate(system, UNTIL, initial=start, method=method, save_at=[0.0, UNTIL], audit="off", **options)
    angle, _ = pair_by_hand()
    found, other = run["h0.pe.q_r"][-1, 0], run["h1.pe.q_r"][-1, 0]
    assert np.isclose(found, angle, rtol=1e-6 if second else 1e-9)
    assert abs(other - MESHED - 2.0 * found) <= 1e-13
    assert run.energy_error.max() < (1e-5 if second else 1e-11)


TREES = st.lists(st.tuples(st.booleans(), st.floats(0.05, 0.5)), min_size=2, max_size=5)


@st.composite
def trains(draw):
    """Gears of two or three wheels each, each with a wheel that the others have not: no gear contradicts others."""
    bodies = draw(TREES)
    ratio = st.sampled_from([-2.0, -0.5, 0.75, 1.0, 3.0])
    gears = []
    for k in range(1, len(bodies)):
        if draw(st.booleans()):
            before = draw(st.lists(st.integers(0, k - 1), min_size=1, max_size=2, unique=True))
            gears.append(((*before, k), tuple(draw(ratio) for _ in range(len(before) + 1))))
    return bodies, gears


@settings(max_examples=10)
@given(trains(), st.integers(0, 10**6))
def test_gears_accelerate_joints_as_the_general_form_says(made, seed):
    system, start = train(*made)
    _, gears = made
    eq = equations_of(system, start)
    assert len(eq.reduced.attaching.ties) == len(gears)
    state, rng = eq.start(0.0), np.random.default_rng(seed)
    state = eq.closed(replace(state, r=rng.standard_normal(eq.n)))
    by_joint = eq.layout.by_joint(state.r)
    for wheels, ratios in gears:
        assert abs(sum(g * by_joint[f"h{k}"][0] for k, g in zip(wheels, ratios, strict=True))) <= 1e-12
    assert_dense_rates_agree(eq, state)
    held_to_the_general_form(eq, eq.problem, state)


@pytest.mark.parametrize("off", [1e-3, -0.1])
def test_wheels_out_of_mesh_are_turned_to_where_they_mesh(off):
    system, start = pair()
    eq = equations_of(system, start)
    state = eq.start(0.0)
    apart = replace(state, q=eq.advance(state.q, np.array([0.0, off])))
    found = eq.closed(apart).q
    assert apart.q.tolist() == [0.0, MESHED + off]
    assert abs(found[1] - MESHED - 2.0 * found[0]) <= 1e-12


def test_gears_of_a_loop_contradict_each_other_or_repeat():
    def equations(ratio):
        system, start = train([(False, 0.1)] * 3, [((0, 1), (1, -2)), ((1, 2), (1, -3)), ((0, 2), (1, -ratio))])
        return equations_of(system, start)

    assert len(equations(6).reduced.attaching.ties) == 2
    with pytest.raises(Unplaced, match=r"gear\d.*contradicts the other gears"):
        equations(5)
