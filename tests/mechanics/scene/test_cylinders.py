"""Hydraulic cylinders, gas springs, actuators and linear drives of scene files, against equations by hand."""

import json
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ephs
from ephs.mechanics.methods.registry import METHODS
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from ephs.mechanics.scene.parameters import varied

MASS, GRAVITY, UNTIL = 2.0, 9.81, 0.02
ROD = f"""
format = 1
[bodies.rod]
mass = {MASS}
inertia = [0.01, 0.01, 0.01]
[joints.rail]
type = "prismatic"
bodies = ["ground", "rod"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
"""
AREA, OIL, BULK, LINE, LEAK, PRESSURE = (4e-4, 2.5e-4), (2e-4, 3e-4), 1.5e7, 2e-8, 2e-9, (9e4, 1e4)
CYLINDER = f"""
[cylinders.lift]
joint = "rail"
area = {list(AREA)}
volume = {list(OIL)}
bulk = {BULK}
conductance = {LINE}
leak = {LEAK}
pressure = [0.0, 0.0]
heat = "oil"
[thermal.oil]
capacity = 500.0
temperature = 300.0
"""
GAS, VOLUME, FILLED, GAMMA, WALL, AIR = -3e-4, 1e-4, 2e5, 1.4, 0.5, 101325.0
STRUT = f"""
[gas_springs.strut]
joint = "rail"
area = {GAS}
volume = {VOLUME}
pressure = {FILLED}
temperature = 300.0
conductance = {WALL}
heat = "tube"
[thermal.tube]
capacity = 5.0
temperature = 290.0
"""
TOLD = {"cylinders.lift": list(PRESSURE)}


@cache
def lifted():
    """(rate, oil in a and b, heat) at the end: m v̇ = Σ ± A π − m g, V̇ = Q, with Q = c Δπ, π = K (V − V₀ ∓ A x)/V₀."""

    def rates(_t, y):
        v, a, b, _, x = y
        pa, pb = BULK * (a - AREA[0] * x) / OIL[0], BULK * (b + AREA[1] * x) / OIL[1]
        qa, qb, leak = LINE * (PRESSURE[0] - pa), LINE * (PRESSURE[1] - pb), LEAK * (pa - pb)
        heat = LINE * ((PRESSURE[0] - pa) ** 2 + (PRESSURE[1] - pb) ** 2) + LEAK * (pa - pb) ** 2
        return [
            (AREA[0] * pa - AREA[1] * pb) / MASS - GRAVITY, qa - leak, qb + leak, heat, v,
        ]  # fmt: skip

    found = solve_ivp(rates, (0.0, UNTIL), np.zeros(5), "DOP853", rtol=1e-13, atol=1e-18).y[:4, -1]
    return found + np.array([0.0, *OIL, 0.0])


@cache
def filled():
    """(rate, volume, entropy of the gas, entropy of the tube) at the end."""
    heats = 1.0 / (GAMMA - 1.0)
    energy = heats * FILLED * VOLUME
    capacity = energy / 300.0

    def rates(_t, y):
        v, volume, s, tube = y
        held = energy * (VOLUME / volume) ** (GAMMA - 1.0) * np.exp(s / capacity)
        hot, cold = held / capacity, 290.0 * np.exp(tube / 5.0)
        flow = WALL * (hot - cold)
        return [GAS * (held / heats / volume - AIR) / MASS - GRAVITY, GAS * v, -flow / hot, flow / cold]

    return solve_ivp(rates, (0.0, UNTIL), [0.0, VOLUME, 0.0, 0.0], "DOP853", rtol=1e-13, atol=1e-16).y[:, -1]


def loaded(folder, more, name="scene"):
    (folder / f"{name}.toml").write_text(ROD + more)
    return ephs.load(folder / f"{name}.toml")


def ended(scene, kind, method, **options):
    """What the equations by hand give, at the end of a run, and the run."""
    inputs = TOLD if kind == "oil" else None
    run = ephs.simulate(scene, UNTIL, method=method, inputs=inputs, save_at=[0.0, UNTIL], **options)
    rate = run.joint("rail").rate[-1, 0]
    if kind == "oil":
        oil = (run[f"cylinders.lift.oil.v_{port}"][-1] for port in "ab")
        return np.array([rate, *oil, run.heat[-1]], dtype=float).ravel(), run
    states = ("gas_springs.strut.gas.v", "gas_springs.strut.gas.s", "thermal.tube.s")
    return np.array([rate, *(run[path][-1] for path in states)], dtype=float).ravel(), run


CASES = {"oil": (CYLINDER, lifted), "gas": (STRUT, filled)}


@pytest.mark.parametrize("kind", CASES)
@pytest.mark.parametrize("method", ["auto", *METHODS])
def test_cylinders_move_as_equations_by_hand_say(tmp_path, kind, method):
    text, exact = CASES[kind]
    scene = loaded(tmp_path, text)
    if method == "auto" or (METHODS[method].adaptive and METHODS[method].order > 3):
        found, run = ended(scene, kind, method, rtol=1e-11, atol=1e-13)
        assert np.allclose(found, exact(), rtol=1e-8, atol=0.0)
        assert run.energy_error.max() < 1e-10
    else:  # the audit of the run holds its balance
        steps = [UNTIL / 200, UNTIL / 400]
        (coarse, _), (found, run) = (ended(scene, kind, method, step=step) for step in steps)
        apart = np.abs(np.array([coarse, found]) / exact() - 1.0)
        assert np.all((apart[1] < 0.4 * apart[0]) | (apart[1] < 1e-9))
        assert apart[1].max() < 1e-3
    assert run.entropy_production.min() >= 0.0
    assert np.diff(run.entropy).min() > 0.0


def test_work_and_heat_of_a_cylinder_are_in_the_ledger(tmp_path):
    scene = loaded(tmp_path, CYLINDER)
    _, run = ended(scene, "oil", "rk87", rtol=1e-11, atol=1e-13)
    here = run.joint("rail").coordinate[-1, 0]
    more = (
        np.array([run[f"cylinders.lift.oil.v_{port}"][-1] for port in "ab"]).ravel()
        - OIL
        - np.array([1, -1]) * AREA * here
    )
    oil = np.sum(0.5 * BULK * more**2 / OIL)
    kinetic = 0.5 * MASS * run.joint("rail").rate[-1, 0] ** 2
    lifted = MASS * GRAVITY * run.joint("rail").coordinate[-1, 0]
    assert np.isclose(run.work[-1], kinetic + lifted + oil + run.heat[-1], rtol=1e-11)
    assert np.isclose(run["thermal.oil.s"][-1], 500.0 * np.log1p(run.heat[-1] / (500.0 * 300.0)), rtol=1e-9)


def test_files_with_rows_of_numbers_as_arrays_are_read(tmp_path):
    scene = loaded(tmp_path, CYLINDER + ACTUATOR)
    data = json.loads(scene_to_text(scene))
    for table in (data["cylinders"]["lift"], data["actuators"]["push"]):
        rows = {key: value for key, value in table.items() if isinstance(value, list) and key != "joints"}
        table |= {key: {"shape": [len(value)], "values": value} for key, value in rows.items()}
    data["actuators"]["push"]["heat"] = "environment"
    again = scene_from_text(json.dumps(data))
    assert (again.cylinders, again.actuators) == (scene.cylinders, scene.actuators)


def test_pressures_are_numbers_of_the_scene_and_inputs(tmp_path):
    scene = loaded(tmp_path, CYLINDER)
    given = ended(scene, "oil", "rk87", rtol=1e-11, atol=1e-13)[0]
    same = varied(scene, {f"cylinders.lift.pressure[{i}]": value for i, value in enumerate(PRESSURE)})
    chambers = {f"cylinders.lift.oil.v_{port}": held for port, held in zip("ab", OIL, strict=True)}
    run = ephs.simulate(same, UNTIL, initial=chambers, method="rk87", rtol=1e-11, atol=1e-13)
    assert run.joint("rail").rate[-1, 0] == pytest.approx(given[0], rel=1e-9)


def test_a_screw_drive_is_a_motor_with_radians_a_metre(tmp_path):
    """A spindle of 5 mm lead: the rotor's inertia is mass of the slide, its torque a force."""
    lead, constant, resistance, inertia, voltage = 5e-3, 0.05, 0.5, 1e-6, 1.0
    turns = 2.0 * np.pi / lead
    scene = loaded(
        tmp_path,
        f"""
[motors.spindle]
joint = "rail"
constant = {constant}
resistance = {resistance}
inertia = {inertia}
gear = {turns}
voltage = {voltage}
""",
    )
    run = ephs.simulate(scene, UNTIL, method="rk87", rtol=1e-12, atol=1e-13)
    mass, drag = MASS + inertia * turns**2, (constant * turns) ** 2 / resistance
    force = constant * turns * voltage / resistance - MASS * GRAVITY
    assert np.isclose(run.joint("rail").rate[-1, 0], force / drag * -np.expm1(-drag / mass * UNTIL), rtol=1e-9)


ACTUATOR = '[actuators.push]\njoints = ["rail"]\nratio = 20.0\nlimits = [-1.0, 1.5]\n'


@pytest.mark.parametrize(("control", "taken"), [(1.25, 1.25), (7.0, 1.5), (lambda t, state: -3.0, -1.0)])
def test_an_actuator_pushes_within_its_limits(tmp_path, control, taken):
    run = ephs.simulate(loaded(tmp_path, ACTUATOR), UNTIL, inputs={"actuators.push": control}, method="rk87")
    assert np.isclose(run.joint("rail").rate[-1, 0], (20.0 * taken / MASS - GRAVITY) * UNTIL, rtol=1e-9)
    assert np.isclose(run.work[-1], 20.0 * taken * run.joint("rail").coordinate[-1, 0], rtol=1e-9)


def test_actuators_of_one_joint_and_forces_on_it_add_up(tmp_path):
    scene = loaded(tmp_path, ACTUATOR + ACTUATOR.replace("push", "pull").replace("20.0", "-5.0"))
    inputs = {("actuators.push", "actuators.pull"): lambda t, state: [1.0, 1.0], "joints.rail": 4.0}
    run = ephs.simulate(scene, UNTIL, inputs=inputs, method="rk87")
    assert np.isclose(run.joint("rail").rate[-1, 0], (19.0 / MASS - GRAVITY) * UNTIL, rtol=1e-9)


def test_an_equilibrium_of_attachments_with_states_is_refused(tmp_path):
    with pytest.raises(ephs.OptionError, match=r"cylinders\.lift"):
        ephs.equilibrium(loaded(tmp_path, CYLINDER))
