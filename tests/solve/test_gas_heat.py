"""The heat of friction is that of friction alone where gases give heat to what is around them."""

import json

import numpy as np
import pytest

import ephs
from tests.written import scene_of_text

PISTON = """
    format = 1
    name = "piston"
    [bodies.b]
    mass = 1.0
    inertia = [0.01, 0.01, 0.01]
    [joints.rail]
    type = "prismatic"
    bodies = ["ground", "b"]
    at = [0.0, 0.0, 0.0]
    axis = [0.0, 0.0, 1.0]
    friction = 2.0
    [gas_springs.gas]
    joint = "rail"
    area = 4e-4
    volume = 3e-4
    pressure = 3e5
    conductance = 2.0
    """
HOT = '\nheat = "wall"\n[thermal.wall]\ncapacity = 5.0\ntemperature = 300.0\n'
BEAM = """
    format = 1
    name = "beam"
    [beams.rod]
    from = [0.0, 0.0, 0.0]
    to = [1.0, 0.0, 0.0]
    elements = 2
    section = { circle = 0.02, E = 2e6, nu = 0.3, rho = 1000.0 }
    ends = ["ground"]
    damping = 0.01
    thermal = { capacity = 20.0, conduction = 0.1, temperature = 300.0, expansion = 1e-4 }
    """


@pytest.mark.parametrize("method", ["rk54", "rk87", "radau", "semi"])
def test_a_gas_that_gives_heat_to_the_environment_is_told_from_friction(method):
    """The heat is that of the motion's rates, ∫ d v² dt, whatever the gas gives; the energy of environments is not."""
    sol = ephs.simulate(scene_of_text(PISTON), 0.5, method=method, rtol=1e-8, save_at=np.linspace(0.1, 0.5, 4001))
    power = 2.0 * sol.joint("rail").rate[:, 0] ** 2
    passed = np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(sol.t))
    assert sol.heat[-1] - sol.heat[0] == pytest.approx(passed, rel=1e-5)  # (1e-4 s)² of the rule
    around = sum(sol.ledgers.storages[path] for path in sol.ledgers.storages if "env" in str(path))
    assert abs(np.ptp(around) - passed) > 1.0  # the control
    assert sol.heat[-1] == pytest.approx(
        ephs.simulate(scene_of_text(PISTON), 0.5, method="natural4", step=1e-3).heat[-1], rel=1e-6
    )


@pytest.mark.parametrize("text", [PISTON + HOT, BEAM], ids=["gas that warms a store", "beam that expands"])
def test_a_heat_that_sums_do_not_know_is_not_a_number(text, tmp_path):
    sol = ephs.simulate(scene_of_text(text), 0.05, method="rk87")
    assert np.isnan(sol.heat).all()
    assert sol.energy_error.max() < 1e-11
    assert not ephs.simulate(scene_of_text(text), 0.02, method="rk87", step=2e-5).audit.findings  # runs are compared
    assert json.loads(json.dumps(sol.summary(), allow_nan=False))["heat"] is None
    sol.save(tmp_path / "run.nc")
    assert np.isnan(ephs.load_solution(tmp_path / "run.nc").heat).all()
    assert ephs.simulate(scene_of_text(text), 0.05, method="natural", step=1e-4, audit="off").heat[-1] > 0.0


def test_a_sweep_has_the_heat_of_each_run():
    """Members that compiled code runs together have no ledgers by component."""
    scene, vary = scene_of_text(PISTON), {"gas_springs.gas.pressure": [2e5, 3e5]}
    swept = ephs.sweep(scene, vary, 0.5, save_at=[0.0, 0.5], method="rk87", outputs=["heat"])
    assert float(swept["heat"].values[1, -1]) == ephs.simulate(scene, 0.5, method="rk87", save_at=[0.0, 0.5]).heat[-1]
