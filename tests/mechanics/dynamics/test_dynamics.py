"""The functions of a scene's state agree with one another, with plain NumPy, and with what simulations do."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.semantics.spaces.rank import EXPLICIT
from tests.mechanics.dynamics.drawn import moving
from tests.methods import FIXED_OF_SCENES
from tests.numerics import EPS, largest, slope
from tests.scenes import of_all_scenes, shipped
from tests.written import scene_of_text


def whole(model, by_joint):
    """(total,) of joint -> (d,)."""
    out = np.zeros(model.layout.total)
    for name, where in model.layout.freedoms.items():
        out[where] = by_joint[name]
    return out


@settings(max_examples=50)
@given(drawn=moving())
def test_accelerations_solve_the_equations_of_motion(drawn):
    """M a + C r + g = applied + forces + rowsᵀ λ and rows·a = target, with the least forces of the rows: by NumPy."""
    _, model, state, rng = drawn
    n = model.layout.n
    forces = np.concatenate([rng.standard_normal(n), np.zeros(model.layout.total - n)])
    mass, constraints = model.mass_matrix(state), model.constraints(state)
    pushed = model.applied(state) + forces[:n] - model.bias(state)
    root = np.linalg.cholesky(mass)
    free = np.linalg.solve(mass, pushed)
    scaled = np.linalg.solve(root, constraints.rows.T).T
    left, sizes, right = np.linalg.svd(scaled, full_matrices=False)
    k = constraints.rank
    assert np.all(sizes[k:] <= EXPLICIT * sizes.max(initial=0.0)) or k == 0
    correction = right[:k].T @ (left[:, :k].T @ (constraints.target - constraints.rows @ free) / sizes[:k])
    expected = free + np.linalg.solve(root.T, correction)
    found = whole(model, model.acceleration(state, model.layout.by_joint(forces)))
    terms = np.abs(np.linalg.inv(mass)) @ (np.abs(pushed) + np.abs(model.bias(state)))
    tolerance = 100.0 * np.linalg.cond(mass) * EPS * max(1.0, terms.max(), largest(expected))
    assert largest(found[:n] - expected, initial=0.0) <= tolerance / (EXPLICIT if k else 1.0)


@settings(max_examples=50)
@given(drawn=moving())
def test_inverse_dynamics_inverts_accelerations(drawn):
    """The forces for some accelerations make those that the constraints allow of them."""
    _, model, state, rng = drawn
    n = model.layout.n
    reached = model.acceleration(state, model.layout.by_joint(rng.standard_normal(model.layout.total)))
    forces = model.inverse_dynamics(state, reached)
    again = model.acceleration(state, forces)
    condition = np.linalg.cond(model.mass_matrix(state))
    size = max(1.0, largest(whole(model, reached)), largest(model.bias(state), initial=0.0) * condition)
    assert largest(whole(model, again) - whole(model, reached)) <= 1e3 * condition * EPS * size
    assert all(not forces[name].any() for name in model.cut if not (model.layout.freedoms[name] < n).any())


@settings(max_examples=50)
@given(drawn=moving())
def test_jacobians_carry_rates_to_bodies(drawn):
    _, model, state, rng = drawn
    rates = whole(model, state.rates)[: model.layout.n]
    at = rng.standard_normal(3)
    for name, body in model.bodies(state).items():
        scale = 100.0 * EPS * max(1.0, largest(model.jacobian(state, name)) * np.abs(rates).sum())
        assert largest(model.jacobian(state, name) @ rates - body.twist) <= scale
        velocity = body.point(at)[1]
        assert largest(model.jacobian(state, name, at) @ rates - velocity) <= 10.0 * scale
    kinetic = 0.5 * rates @ model.mass_matrix(state) @ rates
    assert model.energies(state).kinetic == pytest.approx(kinetic, rel=1e-12, abs=1e-12)


@settings(max_examples=50)
@given(drawn=moving())
def test_gravity_is_the_slope_of_its_potential(drawn):
    scene, model, state, rng = drawn
    along = rng.standard_normal(model.layout.n)

    def potential(h):
        poses = model.bodies(model.moved(state, h * along))
        return -sum(scene.body(name).mass * scene.world.gravity @ b.position for name, b in poses.items())

    assert model.gravity(state) @ along == pytest.approx(slope(potential, 1e-3, 1), rel=1e-8, abs=1e-8)
    assert largest(model.bias(state) - model.bias(state, gravity=False) - model.gravity(state)) <= 1e-12


@settings(max_examples=50)
@given(drawn=moving())
def test_accelerations_are_how_rates_change(drawn):
    """Of all joints, cut ones included, along two steps of high order."""
    _, model, state, _ = drawn
    h = 1e-3
    steps = [model.step(state, k * h, "rk87") for k in (1.0, 2.0)]
    rates = whole(model, state.rates)
    a = whole(model, model.acceleration(state))
    after = [whole(model, x.rates) for x in steps]
    forward = (4.0 * (after[0] - rates) - (after[1] - rates)) / (2.0 * h)
    assert largest(forward - a) <= 1e-3 * max(1.0, largest(a))


@settings(max_examples=25)
@given(drawn=moving(), method=st.sampled_from(FIXED_OF_SCENES))
def test_a_step_is_the_first_of_a_simulation_and_changes_no_state(drawn, method):
    scene, model, state, _ = drawn
    before = state.array.copy()
    h = 2e-3
    step = model.step(model.state0, h, method)
    again = model.step(model.state0, h, method)
    assert np.array_equal(step.array, again.array)
    assert np.array_equal(state.array, before)
    sol = ephs.simulate(scene, h, method=method, step=h)
    for name, body in model.bodies(step).items():
        assert largest(sol.body(name).position[-1] - body.position) <= 1e-9 * max(1.0, largest(body.position))
        assert largest(sol.body(name).velocity[-1] - body.velocity) <= 1e-9 * max(1.0, largest(body.velocity))


@of_all_scenes
def test_shipped_scenes(file):
    scene = ephs.load(file)
    model = ephs.dynamics(scene)
    state = model.state0
    assert set(model.joints) >= {name for name, _ in scene.all_joints()}
    for name, joint in scene.all_joints():
        assert np.allclose(state.rates[name], joint.rate, atol=1e-9)
    for name, body in scene.all_bodies():
        assert np.allclose(model.bodies(state)[name].position, body.pose[4:], atol=1e-9)
        assert np.allclose(model.bodies(state)[name].twist, body.twist, atol=1e-9)
    assert np.array_equal(model.unpack(state.array).array, state.array)
    assert not state.array.flags.writeable
    assert str(len(model.joints)) in repr(model)


ROTORS = {
    "none": ("", 0.0, 0.0),
    "armature": ("armature = 0.3", 0.3, 0.0),
    "motor": (
        "[motors.m]\njoint = 'pin'\nconstant = 0.1\nresistance = 1.0\ngear = 20.0\ninertia = 1e-3",
        20.0**2 * 1e-3,
        (20.0 * 0.1) ** 2 / 1.0,
    ),
}
"""Lines of a scene, the rotor's inertia seen at the joint, and what its circuit resists with, in N m s."""


@pytest.mark.parametrize("rotor", ROTORS)
@pytest.mark.parametrize("way", ["adjusted", "natural", "natural4"])
def test_rotors_share_in_the_momentum_that_rates_are_found_from(rotor, way):
    """What asks for states and not for rates finds them from momenta: of J + g² J of the rotor, too."""
    text = "format = 1\n[world]\ngravity = [0.0, 0.0, 0.0]\n[bodies.arm]\nmass = 1.0\ninertia = [0.1, 0.1, 0.1]\n"
    pin = "[joints.pin]\ntype = 'revolute'\nbodies = ['ground', 'arm']\nat = [0.0, 0.0, 0.0]\naxis = [0.0, 0.0, 1.0]\n"
    lines, seen, resisting = ROTORS[rotor]
    dynamics, rate, step = ephs.dynamics(scene_of_text(text + pin + lines)), 2.0, 1e-3
    state = dynamics.state({}, {"pin": rate}, adjust=way == "adjusted")
    lost = 0.0
    if way != "adjusted":
        state = dynamics.step(state, step, method=way)
        lost = resisting / (0.1 + seen) * step
    assert abs(state.rates["pin"][0] - rate * np.exp(-lost)) <= rate * (lost**3 + 64 * EPS)  # order 2 at least


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: m.acceleration(m.state0, {"nothing": 1.0}), r"forces\['nothing'\] is 1.0, expected a joint: main"),
        (lambda m: m.acceleration(m.state0, {"main": [1.0, 2.0]}), "expected 1 finite numbers"),
        (lambda m: m.inverse_dynamics(m.state0, {"main": np.nan}), "expected 1 finite numbers"),
        (lambda m: m.jacobian(m.state0, "nobody"), "body is 'nobody', expected one of"),
        (lambda m: m.jacobian(m.state0, "crank", [1.0]), r"point is \(1,\), expected \(3,\)"),
        (lambda m: m.unpack([1.0]), "array is"),
        (lambda m: m.moved(m.state0, [1.0]), "increments is"),
        (lambda m: m.step(m.state0, 0.0), "h is 0.0"),
        (lambda m: m.step(m.state0, 1e-3, "nothing"), "method is 'nothing'"),
    ],
)
def test_bad_arguments_are_named(call, message):
    model = ephs.dynamics(shipped("four-bar"))
    with pytest.raises(ephs.OptionError, match=message):
        call(model)


def test_what_no_mass_determines_is_named():
    text = """
    format = 1
    [bodies.frame]
    mass = 0.0
    inertia = [0.0, 0.0, 0.0]
    [joints.pin]
    type = "revolute"
    bodies = ["ground", "frame"]
    at = [0.0, 0.0, 0.0]
    axis = [1.0, 0.0, 0.0]
    """
    model = ephs.dynamics(scene_of_text(text))
    with pytest.raises(ephs.SimulationError, match="joint pin, which moves no mass"):
        model.acceleration(model.state0)


def test_where_a_mass_is_singular_the_joint_is_named():
    slide = 'type = "prismatic"\nat = [0.0, 0.0, 0.0]\naxis = [0.0, -1.0, 0.0]\n'
    text = (
        "format = 1\n[bodies.a]\nmass = 0.0\ninertia = [0.0, 0.0, 0.0]\n"
        "[bodies.b]\nmass = 0.3\ninertia = [1.0, 1.0, 1.0]\n"
        f'[joints.x]\nbodies = ["ground", "a"]\n{slide}[joints.y]\nbodies = ["a", "b"]\n{slide}'
        '[gears.belt]\njoints = ["x", "y"]\nratio = -2.0\nstiffness = 2.0\n'
    )
    with pytest.raises(ephs.SimulationError, match="joint x, which moves no mass"):
        ephs.dynamics(scene_of_text(text)).state({"x": 0.3})


HARD = """format = 1
[bodies.ball]
mass = 1.0
inertia = [4e-3, 4e-3, 4e-3]
position = [0.0, 0.0, {height}]
velocity = [0.0, 0.0, {speed}]
[surfaces.ball]
body = "ball"
shape = {{ sphere = 0.1 }}
restitution = 0.5
[surfaces.floor]
body = "ground"
shape = {{ plane = {{}} }}
restitution = 0.5
"""
ASKED = {
    "acceleration": lambda model: model.acceleration(model.state0),
    "derivatives": lambda model: model.derivatives(model.state0),
    "inverse dynamics": lambda model: model.inverse_dynamics(model.state0, {}),
    "a step": lambda model: model.step(model.state0, 1e-3, "rk54"),
    "linearize": lambda model: ephs.linearize(model.scene),
    "linearize all states": lambda model: ephs.linearize(model.scene, form="paper"),
}


@pytest.mark.parametrize("asked", ASKED)
def test_hard_contacts_that_are_closed_have_no_rates_and_are_named(asked):
    call = ASKED[asked]
    for height, speed in ((0.2, 0.0), (0.1, 1.0)):  # it falls, or leaves the floor
        call(ephs.dynamics(scene_of_text(HARD.format(height=height, speed=speed))))
    closed = ephs.dynamics(scene_of_text(HARD.format(height=0.1, speed=0.0)))
    with pytest.raises(ephs.SimulationError, match=r"contacts\.ball_floor.*closed"):
        call(closed)
    closed.step(closed.state0, 1e-3, "radau")  # whose steps have impulses


def test_an_explicit_step_does_not_fall_through_a_hard_floor():
    model = ephs.dynamics(scene_of_text(HARD.format(height=0.11, speed=-1.0)))
    model.step(model.state0, 5e-3, "rk54")
    with pytest.raises(ephs.SimulationError, match=r"contacts\.ball_floor.*closed"):
        model.step(model.state0, 5e-2, "rk54")
