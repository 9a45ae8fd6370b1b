"""Pressure on shells: forces that follow the surface, with neither sum nor moment on closed ones, and their work."""

import numpy as np
import pytest
from hypothesis import given

import ephs
from ephs.mechanics.elements.shell.pressure import node_areas, volume
from ephs.mechanics.methods import jacobian
from ephs.mechanics.methods.jacobian import Jacobian
from ephs.mechanics.scene.parameters import varied
from tests import numerics
from tests.numerics import EPS, largest, seeds
from tests.written import scene_of_text

BOX = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
FACES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
"""Counter-clockwise, seen from outside."""
PRESSURE, UNTIL = 50.0, 0.02
STILL = "format = 1\n[world]\ngravity = [0.0, 0.0, 0.0]\n"
SKIN = "thickness = 0.02\nE = 1e5\nnu = 0.3\nrho = 100.0\n"


def drawn(seed):
    return BOX + 0.15 * np.random.default_rng(seed).standard_normal(BOX.shape)


def box():
    mesh = f"points = {BOX.tolist()}\nelements = {FACES.tolist()}\npressure = {PRESSURE}\n"
    return scene_of_text(f"{STILL}[shells.box]\n{mesh}{SKIN}")


# ---- forces ----------------------------------------------------------------------------------------------------------


@given(seeds)
def test_forces_on_a_closed_surface_have_neither_sum_nor_moment(seed):
    places = drawn(seed)
    force = node_areas(places, FACES)
    size = 64 * EPS * largest(places) * np.abs(force).sum()
    assert largest(force.sum(axis=0)) <= size and largest(np.cross(places, force).sum(axis=0)) <= size
    corner = places[FACES]
    quarter = 0.125 * np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    equal = np.zeros_like(places)
    np.add.at(equal, FACES, quarter[:, None])
    assert largest(np.cross(places, equal).sum(axis=0)) > 1e-6  # the control: equal shares have a moment


@given(seeds)
def test_their_power_is_that_of_the_volume(seed):
    places, rates = drawn(seed), np.random.default_rng(seed + 1).standard_normal(BOX.shape)
    step = 1e-4
    ends = [volume(places + sign * step * rates, FACES) for sign in (1.0, -1.0)]
    cubic = volume(rates, FACES) * step**2  # the third derivative's part in the difference
    size = np.abs(places).sum() ** 2 * largest(rates)
    power = np.sum(node_areas(places, FACES) * rates)
    assert abs((ends[0] - ends[1]) / (2.0 * step) - cubic - power) <= 64 * EPS * size / step


def test_a_cube_has_its_volume_and_a_quarter_of_a_face_at_each_corner():
    assert volume(BOX, FACES) == pytest.approx(1.0, rel=8 * EPS)
    assert node_areas(BOX, FACES) == pytest.approx(0.25 * np.sign(BOX), abs=8 * EPS)


# ---- motion ----------------------------------------------------------------------------------------------------------


def work_of(run, name="box"):
    """Work, and pressure times the change of the volume."""
    places = run.shell(name).position
    return run.work[-1], PRESSURE * (volume(places[-1], FACES) - volume(places[0], FACES))


@pytest.mark.parametrize("method", ["rk87", "radau", "semi", "auto"])
def test_the_work_on_a_closed_surface_is_the_pressure_times_the_change_of_its_volume(method):
    run = ephs.simulate(box(), UNTIL, method=method, rtol=1e-7)
    work, expected = work_of(run)
    assert work > 0.1
    assert work == pytest.approx(expected, rel=1e-6)
    assert run.energy_error.max() <= 1e-13
    momenta = sum(np.asarray(run[f"shells.box.node{i}.ke.p"])[-1, 3:] for i in range(8))
    assert largest(momenta) <= 1e-9  # symmetry keeps the turns of nodes 0, and so their axes the world's


def test_by_midpoints_the_work_is_off_by_the_square_of_the_step():
    off = [np.subtract(*work_of(ephs.simulate(box(), UNTIL, method="natural", step=step))) for step in (2e-3, 1e-3)]
    assert 3.5 <= off[0] / off[1] <= 4.5
    assert 0.0 < abs(off[1]) < 1e-6


HUB = """
[bodies.hub]
mass = 2.0
inertia = [0.1, 0.1, 0.1]
position = [-0.1, 0.2, 0.0]
rotation = [0.8, 0.6, 0.0, 0.0]
[shells.skin]
corners = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5, 0.4, 0.0], [0.0, 0.4, 0.0]]
elements = [2, 1]
pressure = 50.0
edges = ["free", "free", "free", "hub"]
pinned = PINNED
"""


@pytest.mark.parametrize("pinned", ["[]", "[false, false, false, true]"])
def test_the_whole_pressure_acts_on_a_sheet_and_what_carries_it(pinned):
    """Momentum of a free flight after a short time t: p A t, whatever part is welded, to order t² of turns."""
    short = 1e-3
    scene = scene_of_text(STILL + HUB.replace("PINNED", pinned) + SKIN)
    run = ephs.simulate(scene, short, method="rk87", rtol=1e-9)
    momenta = {"bodies.hub"} | {f"shells.skin.node{i}" for i in range(2 if pinned == "[]" else 0, 6)}
    total = np.zeros(3)
    for name in momenta:
        quaternion, momentum = run[f"{name}.pe.q"][-1, :4], run[f"{name}.ke.p"][-1, 3:]
        w, u = quaternion[0], quaternion[1:]
        total += momentum + 2.0 * np.cross(u, np.cross(u, momentum) + w * momentum)
    assert total == pytest.approx([0.0, 0.0, 50.0 * 0.2 * short], abs=1e-3 * 50.0 * 0.2 * short)


def test_an_input_is_in_place_of_the_pressure_and_is_read_again(tmp_path):
    scene = box()
    one = ephs.simulate(scene, UNTIL, method="rk54", inputs={"shells.box": lambda t: 2.0 * PRESSURE})
    other = ephs.simulate(varied(scene, {"shells.box.pressure": 2.0 * PRESSURE}), UNTIL, method="rk54")
    assert one.work[-1] == other.work[-1] != 0.0
    one.save(tmp_path / "run.nc")
    assert ephs.load_solution(tmp_path / "run.nc").work[-1] == one.work[-1]


# ---- rest ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("surface", ["closed", "open"])
def test_derivatives_are_exact_off_the_balance_and_a_potential_has_symmetric_ones(surface):
    """Of dynamics, and of what the pressure adds; on an open surface it is no potential's."""
    hub = HUB.replace("PINNED", "[false, false, false, true]")
    scene = box() if surface == "closed" else scene_of_text(STILL + hub + SKIN)
    model = ephs.dynamics(scene)
    n, h = model.layout.n, 1e-5  # ∛ε: truncation and rounding of differences are equally small
    at, zero = model.moved(model.state0, 0.05 * np.random.default_rng(3).standard_normal(n)), np.zeros(n)
    forces, accelerations = model.derivatives(at, accelerations={}).force_q, model.derivatives(at).acceleration_q
    exact = (forces, model.inverse_dynamics), (accelerations, model.acceleration)
    for found, function in (*exact, (model.stiffness(at), model.inverse_dynamics)):
        differenced = numerics.jacobian(lambda v, function=function: function(model.moved(at, v), zero), n, h)
        assert largest(found - differenced) <= 1e-8 * largest(found)
    bare = ephs.dynamics(varied(scene, {f"shells.{next(iter(scene.shells))}.pressure": 0.0}))
    added = (ephs.dynamics(scene).stiffness(model.state0) - bare.stiffness(model.state0))[np.ix_(*2 * [moved(model)])]
    assert (largest(added - added.T) <= 1e-12 * largest(added)) == (surface == "closed")


def moved(model):
    """Places of the nodes' displacements among the freedoms: their axes are the world's at the start."""
    nodes = [where for name, where in model.freedoms.items() if name.startswith(("box.", "skin."))]
    return np.concatenate([where[3:] for where in nodes if where.size == 6])


def test_an_inflated_cushion_rests_where_a_damped_run_ends():
    scene = varied(box(), {"shells.box.damping": 0.1})
    rest, run = ephs.equilibrium(scene), ephs.simulate(scene, 2.0, method="radau", rtol=1e-6)
    ends = run.shell("box").position[-1]
    places = np.array([rest.states[ephs.Path.of(f"shells.box.node{i}.pe.q")][4:] for i in range(8)])
    apart = [np.linalg.norm(each[:, None] - each, axis=2) for each in (places, ends, BOX)]
    assert largest(apart[0] - apart[1]) <= 1e-6  # what lags by the damping time dies out as exp(−2/0.1)
    assert largest(apart[0] - apart[2]) > 1e-3  # it is inflated
    linear = ephs.linearize(rest.model)
    assert linear.structure is not None  # at rest, and with a potential
    with_input = ephs.dynamics(scene, inputs={"shells.box": 0.0})
    assert largest(with_input.acceleration(with_input.state0, np.zeros(with_input.layout.n))) <= 1e-9


def test_a_long_tube_has_the_membrane_forces_of_its_radius():
    """A ring of 12 by 1 elements, free along its axis: p R around to the order 2 of the elements, nothing along."""
    count, radius, length, thickness, young, p = 12, 0.5, 0.1, 5e-3, 1e6, 20.0
    angles = 2.0 * np.pi * np.arange(count) / count
    rings = [[radius * float(np.cos(a)), radius * float(np.sin(a)), z] for z in (0.0, length) for a in angles]
    cells = [[i, (i + 1) % count, count + (i + 1) % count, count + i] for i in range(count)]
    text = f"points = {rings}\nelements = {cells}\nthickness = {thickness}\nE = {young}\nnu = 0.3\nrho = 100.0\n"
    scene = scene_of_text(f"{STILL}[shells.tube]\n{text}pressure = {p}\n")
    rest = ephs.equilibrium(scene)
    places = np.array([rest.states[ephs.Path.of(f"shells.tube.node{i}.pe.q")][4:] for i in range(2 * count)])
    middle = places.mean(axis=0)
    wide = np.mean(np.linalg.norm((places - middle)[:, :2], axis=1)) if abs(middle[2] - 0.05) < 1e-6 else np.nan
    stretch = p * radius / (young * thickness)
    assert wide / radius - 1.0 == pytest.approx(stretch, rel=2.0 * (np.pi / count) ** 2 + 4.0 * stretch)


@pytest.mark.parametrize("feedback", [False, True])
def test_sparse_matrices_leave_out_how_a_pressure_turns_and_steps_lead_to_the_same(monkeypatch, feedback):
    """To the tolerance: what is left out costs iterations. A pressure that is a function of states has all of them."""
    monkeypatch.setattr(jacobian, "MANY", 0)
    monkeypatch.setattr(jacobian, "FULL", 1.0)
    free, made = box(), []
    differences = Jacobian._by_differences
    monkeypatch.setattr(Jacobian, "_by_differences", lambda self, state: made.append(1) or differences(self, state))
    rest = {"inputs": {"shells.box": lambda t, state: PRESSURE}} if feedback else {}
    ends = [
        ephs.simulate(free, UNTIL, method=method, rtol=1e-8, audit="off", **given).shell("box").position[-1]
        for method, given in (("radau", rest), ("rk87", {}))
    ]
    assert bool(made) == feedback
    moved = largest(ends[1] - BOX)
    assert largest(ends[0] - ends[1]) <= 1e-5 * moved
    still = ephs.simulate(free, UNTIL, method="rk87", inputs={"shells.box": 0.0}).shell("box").position[-1]
    assert largest(still - ends[1]) > 0.5 * moved  # the control: without the pressure
