"""Derivatives are exact: to what differences are good for, closed forms to rounding, and as one function's inverse."""

from dataclasses import replace
from functools import partial

import numpy as np
from hypothesis import assume, given, settings

from ephs.mechanics.methods.jacobian import Jacobian
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.mechanics.tree.equations.tangent import Linearised
from ephs.semantics.spaces import SE3
from ephs.testing import mechanisms
from tests.mechanics.dynamics.drawn import moving
from tests.numerics import EPS, jacobian, largest
from tests.scenes import equations_of

GOOD = 1e-8
"""What extrapolated differences are good for, relative to the largest entry."""


difference = partial(jacobian, h=1e-3, times=2)


def close(found, expected, tolerance=GOOD):
    assert found.shape == expected.shape
    assert largest(found - expected, initial=0.0) <= tolerance * max(1.0, largest(expected, initial=0.0))


def assert_near(found, expected, rates):
    """Equal to rounding of what is quadratic in rates, of lengths of a few metres."""
    assert largest(found - expected, initial=0.0) <= 1e-12 * (1.0 + float(rates @ rates))


def shifted(model, state, part, by):
    """The state with its tree's joints moved, or its rates or entropies changed."""
    if part == "q":
        return model.moved(state, by)
    array = np.array(state.array)
    ends = array.size - len(model.layout.entropies)
    where = slice(ends - model.layout.n, ends) if part == "r" else slice(ends, None)
    array[where] += by
    return model.unpack(array)


@settings(max_examples=25)
@given(drawn=moving())
def test_accelerations_differentiate_as_differences_say(drawn):
    _, model, state, rng = drawn
    n, free = model.layout.n, model.freedoms
    forces = model.layout.by_joint(rng.standard_normal(model.layout.total))

    def acceleration(at, more=None):
        whole = {name: forces[name] + (0.0 if more is None else more[name]) for name in forces}
        found = model.acceleration(at, whole)
        out = np.zeros(n)
        for name, where in free.items():
            out[where] = found[name][model.layout.freedoms[name] < n]
        return out

    exact = model.derivatives(state, forces)
    close(exact.acceleration_q, difference(lambda v: acceleration(model.moved(state, v)), n))
    close(exact.acceleration_r, difference(lambda v: acceleration(shifted(model, state, "r", v)), n))
    if len(model.layout.entropies):
        ns = len(model.layout.entropies)
        close(exact.acceleration_s, difference(lambda v: acceleration(shifted(model, state, "s", v)), ns))
    linear = np.array([acceleration(state, model.layout.by_joint(unit)) - acceleration(state) for unit in np.eye(n)]).T
    close(exact.acceleration_force, linear)


@settings(max_examples=25)
@given(drawn=moving())
def test_forces_differentiate_as_differences_say(drawn):
    _, model, state, rng = drawn
    n = model.layout.n
    wanted = rng.standard_normal(n)
    given_a = model.layout.by_joint(wanted)

    def forces(at, a=given_a):
        found = model.inverse_dynamics(at, a)
        out = np.zeros(model.layout.total)
        for name, where in model.layout.freedoms.items():
            out[where] = found[name]
        return out[:n]

    exact = model.derivatives(state, accelerations=given_a)
    close(exact.force_q, difference(lambda v: forces(model.moved(state, v)), n))
    close(exact.force_r, difference(lambda v: forces(shifted(model, state, "r", v)), n))
    close(exact.force_a, difference(lambda v: forces(state, model.layout.by_joint(wanted + v)), n))


@settings(max_examples=25)
@given(drawn=moving(loops=False))
def test_forward_and_inverse_derivatives_are_those_of_inverse_functions(drawn):
    """∂ṙ/∂q = −M⁻¹ ∂τ/∂q at the same accelerations, where nothing is prescribed and no loop closed: to rounding."""
    scene, model, state, _ = drawn
    if any(joint.motion is not None for joint in scene.joints.values()):
        return
    exact = model.derivatives(state)
    mass = model.mass_matrix(state)
    tolerance = 10.0 * EPS * np.linalg.cond(mass)
    for forward, inverse in (
        (exact.acceleration_q, exact.force_q),
        (exact.acceleration_r, exact.force_r),
        (exact.acceleration_force, -np.eye(model.layout.n)),
    ):
        expected = -np.linalg.solve(mass, inverse)
        size = np.abs(np.linalg.inv(mass)) @ np.abs(inverse)
        assert largest(forward - expected) <= tolerance * max(1.0, size.max())


@settings(max_examples=30)
@given(drawn=moving())
def test_the_jacobian_of_a_step_is_that_of_its_right_hand_side(drawn):
    scene, model, state, _ = drawn
    equations = equations_of(scene)
    q, r, s = model.layout.split(state.array)
    here = replace(equations.start(0.0), q=q, r=r, heats=equations.heats.energies(s))
    jacobian = Jacobian(equations)
    y, size = equations.vector(here), jacobian.size

    def rates(change):
        moved = y.copy()
        moved[:size] += change
        return equations.rates(0.0, q, moved)[:size]

    close(jacobian.at(here), difference(rates, size))


@settings(max_examples=15)
@given(scene=mechanisms(max_bodies=3, springs=False))
def test_inputs_that_read_the_state_are_in_the_jacobian(scene):
    body = next(name for name, _ in scene.all_bodies())
    joint = next((name for name, j in scene.all_joints() if j.dim), None)
    inputs = {f"bodies.{body}": lambda t, state: np.tanh(state[f"bodies.{body}.pe.q"][1:])}
    if joint is not None:
        dim = scene.joint(joint).dim
        inputs[f"joints.{joint}"] = lambda t, state: -0.7 * np.sin(t + np.arange(dim))
    equations = ReducedEquations(problem_of_scene(scene, None, inputs), 0.0)
    start = equations.start(0.0)
    jacobian = Jacobian(equations)
    y, size = equations.vector(start), jacobian.size

    def rates(change):
        moved = y.copy()
        moved[:size] += change
        return equations.rates(0.3, start.q, moved)[:size]

    close(jacobian.at(replace(start, t=0.3)), difference(rates, size), 1e-6)


@settings(max_examples=30)
@given(drawn=moving())
def test_momenta_and_their_forces_differentiate_as_differences_say(drawn):
    scene, model, state, _ = drawn
    equations = equations_of(scene)
    q, r, s = model.layout.split(state.array)
    n = equations.n
    linear = Linearised(equations)

    def action(change):
        moved, rates = equations.fitted(equations.moved(q, change[:n]), r + change[n:]), r + change[n:]
        found = equations.dense.residual
        equations.refuse(*found.about(moved, rates, s, equations.drive, equations.wrench))
        return np.concatenate(found.momenta())

    close(np.vstack(linear.action(q, r, s, 1.0)), difference(action, 2 * n))


@settings(max_examples=10)
@given(drawn=moving())
def test_columns_add_up_along_any_direction(drawn):
    """Several directions at a time, and single ones."""
    scene, model, state, rng = drawn
    equations = equations_of(scene)
    linear, (q, r, s) = Linearised(equations), model.layout.split(state.array)
    linear.forward(q, r, s)
    slopes = equations.dense.residual.slopes()
    sizes = {"increment": equations.nv, "r": equations.n, "entropy": equations.ns, "a": equations.n}
    seeds = {name: rng.standard_normal((size, 3)) for name, size in sizes.items()}
    along = slopes.of("residual", seeds, 3)[0]
    columns, whole = slopes.along("residual", tuple(sizes)), np.concatenate(list(seeds.values()))
    size = 1.0 + np.abs(columns) @ np.abs(whole)
    assert np.all(np.abs(columns @ whole - along) <= 1e-13 * whole.shape[0] * size)


@settings(max_examples=30)
@given(drawn=moving())
def test_twists_change_along_the_motion_as_brackets_say(drawn):
    """(d/dq J r) r = J̇ r is the sum of ad(twist of the joints before) J_i r_i, joint by joint from the ground."""
    _, model, state, _ = drawn
    found = model.velocity_derivatives(state)
    for body in model.bodies(state):
        jacobian = model.jacobian(state, body)
        twist, drift = np.zeros(6), np.zeros(6)
        for where in model.placing.outwards:
            step = jacobian[:, where] @ state.r[where]
            drift += SE3.ad(twist) @ step
            twist += step
        assert_near(found.bodies[body] @ state.r, drift, state.r)


@settings(max_examples=30)
@given(drawn=moving())
def test_rows_change_as_the_quadratic_form_of_their_targets(drawn):
    """X_v(G r) = ¼ (b(v + r) − b(v − r)) + ½ G [r, v] for motions v and b(r) = Ġ r, minus the constraints' targets."""
    _, model, state, rng = drawn
    found = model.constraints(state)
    assume(found.target.size)
    v, r = rng.standard_normal(model.layout.n), state.r
    v -= np.linalg.lstsq(found.rows, found.rows @ v, rcond=1e-9)[0]

    def turning(rates):
        array = np.array(state.array)
        array[model.layout.elements_end : model.layout.elements_end + r.size] = rates
        return -model.constraints(model.unpack(array)).target

    bracket = np.zeros_like(r)
    for name, parts in model.layout.edges.items():
        at = 0
        for _, edge in parts:
            own = model.layout.freedoms[name][at : at + edge.pair.dim]
            at += edge.pair.dim
            if own.size and own[0] < r.size:
                bracket[own] = edge.pair.manifold.ad(r[own]) @ v[own]
    expected = 0.25 * (turning(v + r) - turning(v - r)) + 0.5 * found.rows @ bracket
    assert_near(model.velocity_derivatives(state).rows @ v, expected, np.concatenate([v, r]))
