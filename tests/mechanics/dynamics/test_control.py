"""States by joint, forces in one array, computed torques and tasks: each against what the dynamics say."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import ephs
from ephs.solve.posing.errors import OptionError
from tests.mechanics.dynamics.drawn import moving
from tests.numerics import EPS, largest, slope
from tests.scenes import shipped


def near(found, expected, model, state, forces):
    """To 10 κ ε, and 8 n ε with n = 6 sums a joint, of the terms: what each of the forces accelerates by itself."""
    mass = model.mass_matrix(state)
    terms = np.abs(forces) + np.abs(model.bias(state)) + np.abs(model.applied(state)) + np.abs(mass) @ np.abs(expected)
    size = float((np.abs(np.linalg.inv(mass)) @ terms).max())
    return largest(found - expected) <= (10.0 * np.linalg.cond(mass) + 48.0 * len(model.joints)) * EPS * size


@settings(max_examples=6)
@given(moving(loops=False))
def test_states_by_joint_are_those_of_the_scene(found):
    """Without a scene made anew the same places and speeds, by name or as arrays; differences lead there."""
    scene, model, state, rng = found
    assume(model.free)
    made = model.state(state.coordinates, state.rates)
    slow = ephs.dynamics(scene.with_state(state.coordinates, state.rates)).state0
    arrays = np.zeros(model.layout.n), np.zeros(model.layout.n)
    for name, where in model.freedoms.items():
        assert np.allclose(made.coordinates[name], slow.coordinates[name], rtol=0.0, atol=1e-12)
        assert np.allclose(made.rates[name], slow.rates[name], rtol=0.0, atol=1e-11)
        arrays[0][where], arrays[1][where] = state.coordinates[name], state.rates[name]
    assert np.array_equal(model.state(*arrays).array, made.array)
    v = 0.5 * rng.standard_normal(model.layout.n)
    assert largest(model.difference(state, model.moved(state, v)) - v) <= 1e-12
    assert largest(model.difference(state, state)) <= 8.0 * EPS


@settings(max_examples=8)
@given(moving())
def test_forces_make_the_accelerations_that_they_are_for(found):
    """By arrays and by joint; gravity is what holds at rest; computed torques are those of the oscillator."""
    _, model, state, rng = found
    n = model.layout.n
    a = rng.standard_normal(n)
    forces = model.inverse_dynamics(state, a)
    named = model.inverse_dynamics(state, {name: a[where] for name, where in model.freedoms.items()})
    assert all(np.array_equal(named[name], forces[where]) for name, where in model.freedoms.items())

    rest = model.unpack(np.concatenate([state.q, np.zeros(n), state.entropies]))
    held = model.inverse_dynamics(rest, np.zeros(n)) + model.applied(rest)
    size = float(largest(model.applied(rest)) + largest(model.gravity(rest)))
    assert largest(held - model.gravity(rest)) <= 48.0 * len(model.joints) * EPS * max(size, 1.0)
    mass = model.mass_matrix(state)
    assert largest(mass - mass.T) <= 8 * n * EPS * largest(mass)
    assert np.linalg.eigvalsh(mass).min() > 0.0

    if model.free:
        assert near(model.acceleration(state, forces), a, model, state, forces)
        assert not near(model.acceleration(state, 1.001 * forces + 0.01), a, model, state, forces)
        wanted = model.moved(state, 0.3 * rng.standard_normal(n))
        forces = model.computed_torque(state, wanted, a, stiffness=25.0, damping=10.0)
        asked = a + 25.0 * model.difference(state, wanted) + 10.0 * (wanted.r - state.r)
        assert near(model.acceleration(state, forces), asked, model, state, forces)


@settings(max_examples=8)
@given(moving(loops=False), st.booleans())
def test_a_task_has_the_acceleration_that_its_forces_are_for(found, turning):
    """And its drift is how its velocity changes where rates stay: by differences along the motion."""
    _, model, state, rng = found
    assume(model.free)
    body = str(rng.choice(list(model.scene.bodies)))
    point = None if turning else rng.standard_normal(3)
    whole = model.jacobian(state, body, point)
    rank = int(np.linalg.matrix_rank(whole, tol=1e-2))
    assume(rank > 0)
    pick = np.linalg.svd(whole)[0][:, :rank].T  # as many directions as the body moves in
    task = model.task(state, body, point, directions=pick)
    assert np.allclose(task.jacobian @ task.inverse, np.eye(rank), rtol=0.0, atol=1e-9)
    asked = rng.standard_normal(rank)
    still = model.inverse_dynamics(state, np.zeros(model.layout.n))
    a = model.acceleration(state, still + task.forces(asked))
    assert largest(task.jacobian @ a + task.drift - asked) <= 1e-8 * (1.0 + largest(asked))

    def velocity(t):
        there = model.moved(state, t * state.r)
        there = model.unpack(np.concatenate([there.q, state.r, state.entropies]))
        return pick @ (model.jacobian(there, body, point) @ state.r)

    assert largest(slope(velocity, 1e-3, 1) - task.drift) <= 1e-8 * (1.0 + largest(task.drift))


@pytest.mark.parametrize("method", ["rk54", "rk87", "radau", "natural"])
def test_a_step_under_forces_is_a_run_under_the_same_inputs(method):
    scene = shipped("chain")
    model = ephs.dynamics(scene)
    push = np.array([0.4, -0.3, 0.2, 0.1])
    inputs = {f"joints.{name}": push[where] for name, where in model.freedoms.items()}
    h = 2e-3
    end = model.step(model.state0, h, method, forces=push)
    sol = ephs.simulate(scene, h, method="rk87", inputs=inputs)
    size = {"natural": h**3 * 50.0}.get(method, 1e-10)
    for name in model.joints:
        assert abs(end.coordinates[name][0] - sol.joint(name).coordinate[-1, 0]) <= size
    without = model.step(model.state0, h, method)
    assert max(abs(end.rates[name][0] - without.rates[name][0]) for name in model.joints) > 1e-4


def test_what_is_no_tree_is_refused_and_so_are_too_many_directions():
    loop = ephs.dynamics(shipped("four-bar"))
    for call in (
        lambda: loop.computed_torque(loop.state0, loop.state0, stiffness=1.0, damping=1.0),
        lambda: loop.task(loop.state0, "coupler"),
    ):
        with pytest.raises(OptionError, match="a tree, without loops"):
            call()
    chain = ephs.dynamics(shipped("chain"))
    body = next(iter(chain.scene.bodies))
    with pytest.raises(OptionError, match="at once"):
        chain.task(chain.state0, body)
    with pytest.raises(OptionError, match="4 finite numbers"):
        chain.step(chain.state0, 1e-3, forces=np.zeros(3))
    with pytest.raises(ephs.SceneError):
        chain.state({"nothing": 1.0})
    with pytest.raises(OptionError, match="4 finite numbers"):
        chain.state(np.zeros(3))
