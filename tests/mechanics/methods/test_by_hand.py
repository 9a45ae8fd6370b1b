"""Mechanisms made by hand: the same motion as from a file, and the rates of the general form."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import ephs
from ephs import Pattern, library, quantity
from ephs.mechanics import joint, rigid_body
from ephs.mechanics.elements import components
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.semantics.spaces import SE3
from ephs.testing import mechanisms
from tests.mechanics.mechanisms import on_ground
from tests.mechanics.methods.systems import renamed
from tests.mechanics.tree.general import held_to_the_general_form
from tests.numerics import EPS, largest, seeds
from tests.scenes import shipped


def four_bar():
    """The linkage of the scene: its system, initial state, and the moment that drives it."""
    scene = shipped("four-bar")
    friction = {"main": 0.05, "pivot": 0.2}
    pattern = Pattern.from_text(
        "ground: body_momentum; crank: body_momentum; coupler: body_momentum; rocker: body_momentum; "
        "motor: joint_momentum(revolute), exposed; bars.crank(p=crank); bars.coupler(p=coupler); bars.rocker(p=rocker);"
        "main(p1=ground, p2=crank, p_r=motor); pin(p1=crank, p2=coupler); knee(p1=coupler, p2=rocker); "
        "pivot(p1=ground, p2=rocker); base(p=ground)"
    )
    parts = {f"bars.{name}": rigid_body(b.mass, b.inertia, (0, -9.81, 0)) for name, b in scene.bodies.items()}
    for pin in scene.joints:
        frames = scene.joint(pin).frame1, scene.joint(pin).frame2
        parts[pin] = joint("revolute", *frames, friction.get(pin, 0.0), driven=pin == "main")
    poses = {f"bars.{name}.pe.q": b.pose for name, b in scene.bodies.items()}
    poses |= {f"{pin}.pe.q_r": 0.0 for pin in scene.joints}
    return scene, pattern(**parts, base=components.ground()), poses, {"motor": {"flow": 4.0}}


@pytest.mark.parametrize("method", ["rk87", "rk54", "radau", "variational", "auto"])
def test_a_four_bar_made_by_hand_moves_as_that_of_a_file(method):
    scene, system, poses, inputs = four_bar()
    how = {"step": 5e-3} if not METHODS.get(method, METHODS["rk87"]).adaptive else {"rtol": 1e-8, "atol": 1e-9}
    one = ephs.simulate(scene, 0.1, method=method, **how)
    other = ephs.simulate(system, 0.1, method=method, initial=poses, inputs=inputs, **how)
    assert one.stats["steps"] == other.stats["steps"]
    assert np.array_equal(one.t, other.t)
    for name in scene.bodies:
        for state in ("pe.q", "ke.p"):
            assert np.array_equal(one[f"bodies.{name}.{state}"], other[f"bars.{name}.{state}"])
    assert np.array_equal(one.heat, other.heat)
    control = ephs.simulate(system, 0.1, method=method, initial=poses, inputs={"motor": {"flow": 4.1}}, **how)
    assert not np.array_equal(control["bars.crank.pe.q"][-1], other["bars.crank.pe.q"][-1])


def test_what_joint_coordinates_have_no_place_for_is_refused_by_name():
    pattern = Pattern.from_text(
        "p: body_momentum; q: displacement; x: momentum; body(p); rope(p, x); spring(q); pkc(q, p=x)"
    )
    rope = ephs.transformer({"p": quantity.body_momentum, "x": quantity.momentum}, [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]])
    parts = {"rope": rope, "spring": library.spring(k=1.0), "pkc": library.pkc()}
    system = pattern(body=rigid_body(1.0, [1, 1, 1]), **parts)
    with pytest.raises(ephs.OptionError, match="'rk87', expected natural, natural4, radau: rope acts on the twist of"):
        ephs.simulate(system, 0.1, method="rk87")
    assert "rope acts on the twist" in ephs.simulate(system, 1e-3).stats["auto"]


# ---- the general form ------------------------------------------------------------------------------------------

KINDS = ("revolute", "prismatic", "screw", "cylindrical", "spherical", "planar", "fixed", "free")


@settings(max_examples=30)
@given(mechanisms(max_bodies=3, kinds=KINDS), st.sampled_from(["x", "pe"]), seeds)
def test_rates_in_joint_coordinates_are_those_of_the_general_form(scene, word, seed):
    problem, _ = renamed(scene, word, seed)
    equations = ReducedEquations(problem, 0.0)
    held_to_the_general_form(equations, problem, equations.start(0.0))


@pytest.mark.parametrize("method", ["natural", "natural4"])
@settings(max_examples=12)
@given(seed=seeds)
@example(seed=2)  # each of these found no solution, as forces that cancel had no scale but their rounding
@example(seed=12)
def test_a_body_on_a_slide_goes_on_as_it_began(method, seed):
    """Forces p × v vanish where nothing turns, in whatever frames; so the momentum stays, and the coordinate grows."""
    rng = np.random.default_rng(seed)
    frame1, frame2 = SE3.random(rng), SE3.random(rng)
    body = rigid_body(1.0, [0.3, 0.4, 0.5, 0.0, 0.1, 0.05], (0.0, 0.0, 0.0))
    system = on_ground(body, joint("prismatic", frame1, frame2))
    rate, place = rng.uniform(0.05, 1.0), rng.standard_normal()
    along = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    start = SE3.compose(SE3.compose(frame1, SE3.exp(place * along)), SE3.inverse(frame2))
    p = np.concatenate([np.zeros(3), rate * (SE3.adjoint(frame2) @ along)[3:]])
    sol = ephs.simulate(
        system, 0.02, step=5e-3, method=method, initial={"body.pe.q": start, "body.ke.p": p, "joint.pe.q_r": place}
    )
    rounding = 64 * EPS
    assert largest(sol["body.ke.p"] - p) <= rounding * rate
    assert largest(sol["joint.pe.q_r"][:, 0] - (place + rate * sol.t)) <= rounding * (1.0 + abs(place))
