"""Scenes linearised: as differences of independent engines and of the motion itself say, with their laws."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray
from hypothesis import assume, given, settings
from scipy.optimize import linear_sum_assignment

import ephs
from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.scene.build import initial_state
from ephs.mechanics.scene.markers import Marker
from ephs.mechanics.scene.parameters import varied
from ephs.solve.equations.model import compile_model
from ephs.solve.methods.continuous import Continuous
from ephs.testing import mechanisms
from tests.mechanics.drawn_scenes import drawn, toml
from tests.mechanics.dynamics.drawn import moving
from tests.numerics import jacobian, largest, slope
from tests.scenes import ROOT, shipped
from tests.written import scene_of_text


def extrapolated(function, h=1e-2):
    """The derivative at 0, by central differences extrapolated three times."""
    return slope(function, h, 3)


# ---- against differences and other engines -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "joint", "other", "body", "start"),
    [("four-bar", "main", "knee", "coupler", (-0.4, 3.0)), ("slider-crank", "bearing", "wrist", "rod", (0.7, 12.0))],
)
def test_a_moving_loop_linearises_as_differences_say(name, joint, other, body, start):
    """Of accelerations and of all that is put out, over states with the loop closed; one has a ball in its loop."""
    scene = shipped(name).with_state({joint: start[0]}, {joint: start[1]}, adjust=True)
    outputs = [f"joints.{joint}", f"joints.{other}", f"joints.{joint}.coordinate", f"bodies.{body}"]
    found = ephs.linearize(scene, outputs=[*outputs, f"bodies.{body}.position"])
    assert found.states[:2] == (f"joints.{joint}.coordinate", f"joints.{joint}.rate")
    here = scene.joint(joint)

    def at(angle, rate):
        moved = scene.with_state({joint: here.coordinate + angle}, {joint: here.rate + rate}, adjust=True)
        model = ephs.dynamics(moved)
        state, own = model.state0, model.bodies(model.state0)[body]
        seen = [state.rates[joint], state.rates[other], state.coordinates[joint], own.twist, own.position]
        return np.concatenate([model.acceleration(state)[joint], *seen])

    expected = np.column_stack([extrapolated(lambda d: at(d, 0.0)), extrapolated(lambda d: at(0.0, d))])
    assert largest(found.A[0, :2] - [0.0, 1.0]) < 1e-12
    assert largest(found.A[1, :2] - expected[0]) < 1e-8 * largest(expected[0])
    assert largest(found.C[:, :2] - expected[1:]) < 1e-8 * max(1.0, largest(expected))


def spinning_rod():
    """A slider-crank whose rod is held by two balls, so that it may spin about itself: two freedoms, turning."""
    scene = shipped("slider-crank")
    zero = np.zeros(3)
    ball = replace(
        scene.joints["wrist"], kind="spherical", friction=np.zeros((3, 3)), stiffness=zero, rest=zero, drive=zero,
        coordinate=np.array([1.0, 0.0, 0.0, 0.0]), rate=zero,
    )  # fmt: skip
    return replace(scene, joints=scene.joints | {"wrist": ball})


def test_dependent_rates_turn_with_a_rod_that_spins():
    model = ephs.dynamics(spinning_rod())
    array, rng = np.array(model.state0.array), np.random.default_rng(2)
    first = array.size - model.layout.n - len(model.layout.entropies)
    array[first : first + model.layout.n] += 5.0 * rng.standard_normal(model.layout.n)
    turns_with_the_loop(model, model.closed(model.unpack(array)))


@settings(max_examples=15)
@given(drawn=moving(heat=False, springs=False, friction=False))
def test_dependent_rates_turn_with_the_loop(drawn):
    _, model, state, _ = drawn
    assume(bool(model.cut))
    turns_with_the_loop(model, state)


def turns_with_the_loop(model, state):
    """Y: of rates that keep the loop closed while the independent ones stay."""
    whole = [name for name in model.freedoms if model.freedoms[name].size]
    found = ephs.linearize(model.scene, state, inputs=[], outputs=[f"joints.{name}" for name in whole])
    n, k = model.layout.n, len(found.states) // 2
    order = np.concatenate([model.freedoms[name] for name in whole])
    Y, Z = np.zeros((2, n, k))
    Y[order], Z[order] = found.C[:, :k], found.C[:, k : 2 * k]
    free = [int(np.flatnonzero((Z == unit).all(axis=1))[0]) for unit in np.eye(k)]
    rest = np.setdiff1d(np.arange(n), free)
    r = model.layout.split(state.array)[1]

    def rates(v):
        rows = model.constraints(model.moved(state, v)).rows
        out = r.copy()
        out[rest] = np.linalg.lstsq(rows[:, rest], -rows[:, free] @ r[free], rcond=1e-9)[0]
        return out

    for j in range(k):
        expected = extrapolated(lambda h, j=j: rates(h * Z[:, j]))
        assert largest(Y[:, j] - expected) < 1e-6 * max(1.0, largest(expected))


@settings(max_examples=10)
@given(drawn=moving(loops=False, heat=False, springs=False, friction=False, max_bodies=2))
def test_a_moving_tree_linearises_as_its_flow_does(drawn):
    """d/dt of the flow's derivative at t = 0, through joints on every group."""
    _, model, state, _ = drawn
    found = ephs.linearize(model.scene, state, outputs=[])
    n, (_, r0, s0) = model.layout.n, model.layout.split(state.array)
    edges = [(model.layout.elements[j], model.layout.freedoms[j], model.layout.edges[j]) for j in model.joints]

    def difference(at, of):
        """The state's increments from another: left-trivialised, then of rates."""
        a, b = model.layout.split(at.array), model.layout.split(of.array)
        out = np.zeros(2 * n)
        for elements, freedoms, parts in edges:
            where, to = 0, 0
            for _, edge in parts:
                own = elements[where : where + edge.pair.size]
                out[freedoms[to : to + edge.pair.dim]] = edge.pair.manifold.increment(a[0][own], b[0][own])
                where, to = where + edge.pair.size, to + edge.pair.dim
        out[n:] = b[1] - a[1]
        return out

    def beside(x):
        moved = model.layout.split(model.moved(state, x[:n]).array)
        return model.unpack(np.concatenate([moved[0], r0 + x[n:], s0]))

    def flow(h):
        centre = model.step(state, h, "rk87") if h else state
        columns = []
        for unit in np.eye(2 * n):
            ends = {k: model.step(beside(1e-3 * k * unit), h, "rk87") for k in (-2, -1, 1, 2)}
            d = {k: difference(centre, end) for k, end in ends.items()}
            columns.append((8.0 * (d[1] - d[-1]) - (d[2] - d[-2])) / 12e-3)
        return np.array(columns).T

    expected = slope(flow, 4e-3, 1)
    assert largest(found.A - expected) < 1e-6 * max(1.0, largest(expected))


def test_forces_wrenches_and_markers_push_as_the_motion_says():
    scene = shipped("four-bar")
    scene = replace(scene, markers={"tip": Marker(body="coupler", at=[0.1, 0.2, 0.0]).called("tip")})
    found = ephs.linearize(scene, inputs=["joints.pivot", "joints.knee", "bodies.coupler", "markers.tip"])
    model = ephs.dynamics(scene)
    free = found.states[1].split(".")[1]
    still = model.acceleration(model.state0)[free]
    for name in ("pivot", "knee"):
        pushed = model.acceleration(model.state0, {name: 1.0})[free] - still
        assert found.B[1, found.inputs.index(f"joints.{name}")] == pytest.approx(pushed[0], rel=1e-9)
    wrench = found.B[1, [found.inputs.index(f"bodies.coupler[{i}]") for i in range(6)]]
    turn = model.bodies(model.state0)["coupler"].rotation
    for i in range(3):
        own = turn.T @ np.eye(3)[i]
        expected = wrench @ np.concatenate([np.cross([0.1, 0.2, 0.0], own), own])
        assert found.B[1, found.inputs.index(f"markers.tip[{i}]")] == pytest.approx(expected, abs=1e-12)


# ---- laws --------------------------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(scene=mechanisms())
def test_at_an_equilibrium_the_laws_hold(scene):
    try:
        rest = ephs.equilibrium(scene)
    except ephs.SimulationError as error:  # what slides down a guide for ever
        assert "no state found in which nothing moves" in str(error)
        return
    model = ephs.dynamics(rest.model)
    assert max((largest(a, initial=0.0) for a in model.acceleration(model.state0).values()), default=0.0) < 1e-6
    found = ephs.linearize(rest.model)
    assert found.structure is not None, found.reason
    for law in found.laws:
        assert law.holds(1e-11), (law.name, law.defect)
    assert found.stable
    rng = np.random.default_rng(1)
    for x in rng.standard_normal((5, len(found.states))):
        loss = float(x @ found.Q @ found.A @ x)
        assert loss <= 1e-9 * np.abs(x) @ np.abs(found.Q) @ np.abs(found.A) @ np.abs(x)
        assert found.structure.dissipation(x) >= -1e-9


@pytest.mark.parametrize("name", ["chain", "heavy-top"])
def test_without_friction_nothing_decays(name):
    found = ephs.linearize(ephs.equilibrium(shipped(name)).model)
    assert not found.R.any()
    assert np.all(found.eigenvalues.real == 0.0)


def pushed(follower):
    """A loop with a load, which turns with its body, or does not."""
    return (ROOT / "scenes/four-bar.toml").read_text(encoding="utf-8") + (
        f"[loads.push]\nbody = 'coupler'\nforce = [0.5, 1.0, 0.0]\nmoment = [0.0, 0.0, 0.2]\nfollower = {follower}\n"
    )


@pytest.mark.parametrize("of", ["four-bar", "slider-crank", pushed("true"), toml(drawn(22)), toml(drawn(33))])
def test_joint_coordinates_and_the_papers_states_have_the_same_modes(of):
    """What the paper's states have beside them is constant: the constraints' integrals.

    Of drawn scenes those whose springs carry relative poses beside universal joints: these say where bodies are
    only where no states are given.
    """
    scene = shipped(of) if of in ("four-bar", "slider-crank") else scene_of_text(of)
    driven = {f"joints.{name}.drive": 0.0 for name in scene.joints if np.any(scene.joint(name).drive)}
    rest = ephs.equilibrium(varied(scene, driven)).model
    found = ephs.linearize(rest).eigenvalues
    paper = ephs.linearize(rest, form="paper").eigenvalues
    moving = paper[np.abs(paper) > 1e-4 * np.abs(found).min()]
    assert moving.size == found.size
    apart = np.abs(moving[:, None] - found)
    assert apart[linear_sum_assignment(apart)].max() < 1e-6 * largest(found)


def test_the_papers_states_are_refused_where_loads_keep_their_direction():
    scene = scene_of_text(pushed("false"))
    with pytest.raises(ephs.OptionError, match=r"reduced, as the load at momenta\.coupler depends on the states"):
        ephs.linearize(scene, form="paper")


@pytest.mark.parametrize("name", ["heavy-top", "chain", "bricard"])
def test_derivatives_by_states_are_those_of_the_equations_where_mechanisms_turn(name):
    """Against central differences, of 1e-8 at best; the top spins at 150 rad/s."""
    scene = shipped(name)
    problem = problem_of_system(scene.system(), {str(path): value for path, value in initial_state(scene).items()})
    d, equations = problem.descriptor, Continuous(compile_model(problem.descriptor, problem.reference, {}))
    x, inputs = d.pack(problem.initial), equations.model.input_values()
    z = equations.guess(x) + 0.1 * np.random.default_rng(0).standard_normal(equations.unknowns)
    found = equations.matrices(x, z, inputs).states.toarray()[:, : d.rate_size]
    near = jacobian(lambda by: equations.residual(d.advance(x, by), z, inputs), d.rate_size, 1e-6)
    assert largest(found - near) <= 1e-8 * largest(found)


def test_the_papers_states_of_a_fast_crank_are_linearised():
    """It turns by more than a whole turn a second, at which derivatives over a step of a second were asked for."""
    assert len(ephs.linearize(shipped("slider-crank"), form="paper").eigenvalues) == 27


def test_a_state_that_is_no_equilibrium_says_why_it_has_no_structure():
    scene = shipped("four-bar")
    assert "not balanced" in ephs.linearize(scene).reason
    moving = scene.with_state({}, {"main": 1.0}, adjust=True)
    assert "moves" in ephs.linearize(moving).reason


# ---- films and files ---------------------------------------------------------------------------------------------


def test_a_mode_plays_as_a_film_with_loops_closed():
    rest = ephs.equilibrium(shipped("four-bar")).model
    found = ephs.linearize(rest)
    film = found.film(0, amplitude=0.2, frames=21)
    swing = np.ptp(film.joint("main").coordinate)
    assert len(film) == 21 and film.constraint_error.max() < 1e-8
    assert 0.3 < swing < 0.45
    assert film.t[-1] == pytest.approx(1.0 / found.modes[0].frequency)
    fading = found.film(found.modes[0], amplitude=0.2, periods=3.0, decay=True)
    assert np.ptp(fading.joint("main").coordinate[-20:]) < swing
    with pytest.raises(ephs.OptionError, match="mode"):
        found.film(7)


@pytest.mark.parametrize("suffix", ["json", "npz", "nc"])
def test_matrices_are_saved(tmp_path, suffix):
    found = ephs.linearize(ephs.equilibrium(shipped("chain")).model)
    file = tmp_path / f"chain.{suffix}"
    found.save(file)
    if suffix == "json":
        data = json.loads(file.read_text())
    elif suffix == "npz":
        data = np.load(file)
    else:
        data = {key: value.values for key, value in xarray.load_dataset(file, engine="h5netcdf").items()}
    for key in ("A", "B", "C", "D", "J", "R", "Q"):
        assert np.array_equal(np.asarray(data[key]), getattr(found, key))
    with pytest.raises(ephs.OptionError, match="ends in"):
        found.save(tmp_path / "chain.mat")


PRESSED = """
format = 1
name = "pressed"
[bodies.ball]
mass = 2.0
inertia = [0.01, 0.01, 0.01]
position = [0.0, 0.0, {height}]
[joints.rail]
type = "prismatic"
bodies = ["ground", "ball"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
[surfaces.ball]
body = "ball"
shape = {{ sphere = 0.1 }}
[surfaces.floor]
body = "ground"
shape = {{ plane = {{}} }}
[contacts.c]
surfaces = ["ball", "floor"]
stiffness = 1e5
exponent = {exponent}
"""


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("height", [0.1, 0.3])
def test_a_ball_sinks_into_a_floor_and_swings_on_it_as_the_law_of_contact_says(height, exponent):
    """From the air and from where it touches, where nothing is stiff: k dⁿ = m g, ω² = n g / d."""
    rest = ephs.equilibrium(scene_of_text(PRESSED.format(height=height, exponent=exponent))).model
    depth = (2.0 * 9.81 / 1e5) ** (1.0 / exponent)
    assert 0.1 - rest.body("ball").pose[6] == pytest.approx(depth, rel=1e-9)
    fastest = max(mode.frequency for mode in ephs.linearize(rest).modes)
    assert fastest == pytest.approx(np.sqrt(exponent * 9.81 / depth) / (2.0 * np.pi), rel=1e-9)


@pytest.mark.parametrize(
    ("keys", "what"),
    [({"inputs": ["joints.man"]}, "joints.main"), ({"outputs": ["bodies.crank.place"]}, "did you mean"),
     ({"inputs": ["joints.main.coordinate"]}, "a joint"), ({"form": "tree"}, "reduced"),
     ({"state": "rest"}, "equilibrium"), ({"state": 3}, "state is 3"), ({"inputs": "joints.main"}, "as a list"),
     ({"outputs": [3]}, "as a list"), ({"form": "paper", "inputs": ["joints.main"]}, "none in the paper's form")],
)  # fmt: skip
def test_what_cannot_be_is_named(keys, what):
    with pytest.raises(ephs.OptionError, match=what):
        ephs.linearize(shipped("four-bar"), **keys)


@pytest.mark.parametrize(
    "keys",
    [{"mode": 99}, {"mode": "slow"}, {"mode": 0, "amplitude": np.nan}, {"mode": 0, "periods": -1.0},
     {"mode": 0, "periods": 0}, {"mode": 0, "frames": 2.5}, {"mode": 0, "frames": 1}],
)  # fmt: skip
def test_films_that_cannot_be_are_refused(keys):
    with pytest.raises(ephs.OptionError, match=f"{list(keys)[-1]} is"):
        ephs.linearize(shipped("chain")).film(**keys)


def test_what_turns_for_ever_has_no_equilibrium():
    with pytest.raises(ephs.SimulationError, match="constant drive"):
        ephs.equilibrium(shipped("slider-crank"))
