"""Tangents of explicit steps are exact: to rounding those of a complex step, and of the dense equations."""

from functools import partial

import numpy as np
import pytest

import ephs
from ephs.mechanics.methods.explicit import tableau
from ephs.mechanics.scene.parameters import read
from ephs.mechanics.sensitivity import explicit
from ephs.mechanics.sensitivity.explicit import ExplicitTangent
from ephs.mechanics.sensitivity.family import ParameterFamily, relation_of
from ephs.mechanics.tree.engine.tangents import DIRECTIONS, StepTangent
from ephs.mechanics.tree.equations.tangent import Linearised
from tests.mechanics.ball import BALL
from tests.mechanics.tree.engine.test_engine import moved
from tests.numerics import largest
from tests.scenes import equations_of, shipped
from tests.written import scene_of_text

EXACT = 1e-12
"""Part of the largest derivative: 10 κ ε of some hundred operations."""
PENDULUM = """
format = 1
name = "pendulum"
[world]
gravity = [0.0, -9.81, 0.0]
[bodies.rod]
mass = 2.0
inertia = [0.2, 0.2, 0.3]
position = [0.0, -0.7, 0.0]
[joints.pin]
type = "revolute"
bodies = ["ground", "rod"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
friction = 0.2
stiffness = 1.5
coordinate = 0.0
rate = 0.0
"""


def pendulum(numbers, method, h, steps):
    """(angle, rate) after Runge-Kutta steps, of any numbers that multiply and add."""
    m, inertia, length, friction, stiffness, gravity, angle, rate = numbers
    whole, a = inertia + m * length * length, tableau(method).arrays["a"]

    def f(y):
        force = -m * gravity * length * np.sin(y[0]) - stiffness * y[0] - friction * y[1]
        return np.array([y[1], force / whole])

    y = np.array([angle, rate])
    for _ in range(steps):
        k = []
        for row in a:
            at = y + h * sum((w * x for w, x in zip(row, k, strict=False)), 0.0 * y)
            k.append(f(at))
        y = at
    return y


@pytest.mark.parametrize("method", ["rk54", "rk87"])
def test_a_pendulum_as_a_complex_step_says(method, monkeypatch):
    """f(x + i ε)/ε has no difference in which digits cancel: derivatives by eight numbers, to rounding.

    Of the method's plain steps, without the correction that keeps the balance.
    """
    monkeypatch.setattr(explicit, "StepTangent", lambda *given, corrected: StepTangent(*given, corrected=False))
    scene = scene_of_text(PENDULUM).with_state({"pin": 0.6}, {"pin": 1.1})
    values = [2.0, 0.3, 0.7, 0.2, 1.5, 9.81, 0.6, 1.1]
    paths = ["bodies.rod.mass", "bodies.rod.inertia[2]", "joints.pin.frame2.position[1]", "joints.pin.friction",
             "joints.pin.stiffness", "world.gravity[1]", "joints.pin.coordinate", "joints.pin.rate"]  # fmt: skip
    signs = {"world.gravity[1]": -1.0}
    found = ephs.sensitivity(scene, paths, 0.4, method=method, step=0.05)
    for number, path in enumerate(paths):
        assert abs(read(scene, path)) == pytest.approx(values[number])
        unit = np.eye(len(values))[number]
        expected = pendulum(np.array(values) + 1e-40j * unit, method, 0.05, 8).imag / 1e-40
        mine = [found[f"joints.pin.{key}"][-1, 0, number] for key in ("coordinate", "rate")]
        assert largest(signs.get(path, 1.0) * np.array(mine) - expected) < EXACT * largest(expected), path


@pytest.mark.parametrize("name", ["four-bar", "slider-crank", "heavy-top"])
def test_rates_along_directions_as_the_dense_equations_say(name):
    """Derivatives of the accelerations by elements and rates: through sweeps, and through the mass matrix."""
    eq = equations_of(shipped(name))
    state = moved(eq)
    linear = Linearised(eq)
    linear.forward(state.q, state.r, eq.heats.entropies(state.heats))
    expected = linear.columns(solve=True)[: eq.n]
    tangent = StepTangent(
        eq.engine, partial(relation_of, eq.problem.descriptor), tableau("rk54").arrays, corrected=False
    )
    base, start = tangent.pairs["base"], tangent.pairs["start"]
    base[0][:], start[0][:] = state.q, eq.vector(state)
    for k in range(2 * eq.n):
        start[1][:] = 0.0
        start[1][k if k < eq.n else eq.nv + k - eq.n, 0] = 1.0
        assert tangent.rates() == 0
        mine = tangent.stage[1][eq.nv : eq.nv + eq.n, 0]
        column = expected[:, k if k < eq.n else eq.nv + k - eq.n]
        assert largest(mine - column) < EXACT * max(1.0, largest(expected))
        assert not tangent.stage[1][:, 1:].any()


def test_all_directions_are_the_same_whatever_their_place():
    """More parameters than directions of one call: each derivative is what it is alone."""
    scene = shipped("four-bar")
    paths = [
        "bodies.coupler.mass",
        "joints.main.friction",
        "bodies.rocker.mass",
        "joints.main.drive",
        "world.gravity[1]",
    ]
    assert len(paths) > DIRECTIONS
    run = {"until": 0.1, "method": "rk54", "step": 0.02}
    every = ephs.sensitivity(scene, paths, **run)["joints.knee.rate"]
    for number, path in enumerate(paths):
        assert np.array_equal(ephs.sensitivity(scene, [path], **run)["joints.knee.rate"][..., 0], every[..., number])


def test_inputs_of_time_are_taken_stage_by_stage():
    """A constant given as a function of time changes nothing; one that reads the state is refused."""
    scene = shipped("four-bar")
    family = [
        ParameterFamily(scene, ["bodies.coupler.mass"], None, {"joints.main": u}, None, joints=True)
        for u in (2.0, lambda t, s: [2.0])
    ]
    ends = []
    for one in family:
        steps = ExplicitTangent(one, 0.0, tableau("rk87"))
        ends.append(steps.step(steps.start(), 0.04))
    assert largest(ends[0].y - ends[1].y) < EXACT * largest(ends[0].y)
    with pytest.raises(ephs.OptionError, match="functions of time"):
        ephs.sensitivity(
            scene, ["bodies.coupler.mass"], 0.1, inputs={"joints.main": lambda t, s: -s.joints.main.rate}, method="rk54"
        )


def test_loads_in_world_axes_are_refused():
    """They read how bodies turn."""
    load = '\n[loads.push]\nbody = "ball"\nforce = [1.0, 0.0, 0.0]\n'
    scene = scene_of_text(BALL.format(slip=0.01) + load)
    with pytest.raises(ephs.OptionError, match="loads in world axes"):
        ephs.sensitivity(scene, ["bodies.ball.mass"], 0.01, method="rk54")
    assert ephs.sensitivity(scene_of_text(BALL.format(slip=0.01)), ["bodies.ball.mass"], 0.01, method="rk54")
