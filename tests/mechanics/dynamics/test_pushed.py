"""Loads and inputs of a scene in its dynamics: those of runs, with exact derivatives, wherever they turn or keep to."""

import itertools

import numpy as np
import pytest

import ephs
from tests.numerics import jacobian, largest
from tests.written import scene_of_text

ARMS = """
format = 1
[bodies.one]
mass = 2.0
inertia = [0.1, 0.2, 0.15]
position = [0.3, 0.0, 0.0]
rotation = { rpy = [0.3, 0.2, 0.1] }
[bodies.two]
mass = 1.0
inertia = [0.1, 0.05, 0.1]
position = [0.6, 0.1, 0.0]
[joints.pin]
type = "spherical"
bodies = ["ground", "one"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
[joints.knee]
type = "revolute"
bodies = ["one", "two"]
at = [0.5, 0.0, 0.0]
axis = [0.2, 1.0, 0.3]
friction = 0.1
[markers.tip]
body = "one"
at = [0.1, -0.2, 0.3]
"""
LOADS = {
    "none": "",
    "world": '[loads.a]\nbody = "one"\nforce = [1.0, -2.0, 3.0]\nmoment = [0.3, 0.1, -0.2]\n',
    "follower": '[loads.a]\nbody = "one"\nforce = [1.0, -2.0, 3.0]\nfollower = true\n',
    "both": '[loads.a]\nbody = "one"\nforce = [1.0, -2.0, 3.0]\nfollower = true\n'
    '[loads.b]\nbody = "one"\nmoment = [0.3, 0.1, -0.2]\n',
}
INPUTS = {
    "none": {},
    "body": {"bodies.one": [0.1, 0.2, -0.3, 1.0, 2.0, 3.0], "bodies.two": [0.0, 0.4, 0.0, 0.0, 0.0, 1.0]},
    "marker": {"markers.tip": [1.0, 0.7, 3.0], "joints.knee": [0.5]},
}


def at(scene, inputs):
    """Dynamics, and a state elsewhere that moves."""
    model = ephs.dynamics(scene, inputs=inputs)
    change = np.random.default_rng(1).standard_normal((2, model.layout.n))
    q, r, s = model.layout.split(model.moved(model.state0, 0.5 * change[0]).array)
    return model, model.unpack(np.concatenate([q, r + change[1], s]))


@pytest.mark.parametrize(("load", "given"), [*itertools.product(LOADS, INPUTS)])
def test_accelerations_are_those_of_a_run(load, given):
    scene = scene_of_text(ARMS + LOADS[load])
    model = ephs.dynamics(scene, inputs=INPUTS[given])
    there = scene.with_state({"pin": [0.3, -0.2, 0.4], "knee": 0.7}, {"pin": [1.0, 0.5, -0.3], "knee": -0.4})
    state = model.state({"pin": [0.3, -0.2, 0.4], "knee": 0.7}, {"pin": [1.0, 0.5, -0.3], "knee": -0.4})
    h = 1e-4
    run = ephs.simulate(there, h, inputs=INPUTS[given], method="rk87", step=h / 2.0)
    found = model.acceleration(state)
    for name in ("pin", "knee"):
        rate = run.joint(name).rate
        differenced = (-3.0 * rate[0] + 4.0 * rate[1] - rate[2]) / h  # off by h²/12 of the third derivative
        assert largest(found[name] - differenced) <= 1e-5 * (1.0 + largest(found[name])), name


@pytest.mark.parametrize(("load", "given"), [*itertools.product(LOADS, INPUTS)])
def test_derivatives_and_inverse_dynamics_are_those_of_accelerations(load, given):
    model, state = at(scene_of_text(ARMS + LOADS[load]), INPUTS[given])
    n, h, zero = model.layout.n, 1e-5, np.zeros(model.layout.n)  # ∛ε: truncation and rounding are equally small
    a = model.acceleration(state, zero)
    assert largest(model.inverse_dynamics(state, a)) <= 1e-11 * largest(a)
    found = model.derivatives(state).acceleration_q
    differenced = jacobian(lambda v: model.acceleration(model.moved(state, v), zero), n, h)
    assert largest(found - differenced) <= 1e-8 * largest(differenced)
    pushed = load != "none" or given != "none"  # the control: they act
    bare, _ = at(scene_of_text(ARMS), {})
    assert (largest(bare.acceleration(state, zero) - a) > 1e-3) == pushed


def test_inputs_of_systems_are_numbers():
    system = scene_of_text(ARMS).system(driven=["knee"])
    model = ephs.dynamics(system, inputs={"drives.knee": {"flow": 0.5}})
    zero = np.zeros(model.layout.n)
    a = model.acceleration(model.state0, zero)
    assert largest(model.inverse_dynamics(model.state0, a)) <= 1e-11 * largest(a)
    with pytest.raises(ephs.OptionError, match=r"drives\.knee.*a number or numbers"):
        ephs.dynamics(system, inputs={"drives.knee": {"flow": lambda t, state: 0.5}})
