"""Motors and armatures of scene files."""

from dataclasses import replace

import numpy as np
import pytest

import ephs
from tests.mechanics.tree import machines
from tests.scenes import ROOT

SCENE = ROOT / "scenes" / "motor-four-bar.toml"
END = ("motors.drive.coil.b", "motors.drive.rotor.p", "thermal.housing.s")


def ended(scene, until=0.2, **options):
    run = ephs.simulate(scene, until, save_at=[0.0, until], **options)
    return np.array([run[path][-1] for path in END]), run


def test_a_motor_of_a_scene_is_the_one_put_together_by_hand():
    scene = ephs.load(SCENE)
    joints = {name: replace(j, armature=0.0) for name, j in scene.joints.items()}
    motor = scene.motors["drive"].changed(gear=1.0 / machines.GEAR)
    scene = replace(scene, joints=joints, motors={"drive": motor})
    found, run = ended(scene, 0.3, method="rk87", rtol=1e-12, atol=1e-13)
    _, rate, current, warmth = machines.motor_by_hand(0.3)
    exact = [
        machines.INDUCTANCE * current, machines.ROTOR * rate / machines.GEAR,
        machines.HEAT * np.log(warmth / machines.THETA),
    ]  # fmt: skip
    assert np.allclose(found, exact, rtol=1e-9, atol=0.0)
    assert run.stats["form"] == "reduced"


def test_an_armature_is_inertia_of_its_joint():
    scene = ephs.load(SCENE)
    free, held = (replace(scene, motors={}, joints={**scene.joints}) for _ in range(2))
    wheel = replace(scene.joints["main"], armature=0.0)
    turned = scene.bodies["crank"].inertia + np.diag([0.0, 0.0, scene.joints["main"].armature])
    held = replace(held, joints={**held.joints, "main": wheel})
    heavier = {**held.bodies, "crank": replace(held.bodies["crank"], inertia=turned)}  # about the same axis
    runs = [ephs.simulate(one, 0.3, method="rk87") for one in (free, replace(held, bodies=heavier), held)]
    rates = [run.joint("main").rate[-1, 0] for run in runs]
    assert np.isclose(rates[0], rates[1], rtol=1e-9)
    assert not np.isclose(rates[0], rates[2], rtol=1e-4)
    assert np.isclose(runs[0]["armatures.main.p"][-1], 0.002 * rates[0], rtol=1e-12)


def test_a_voltage_is_an_input():
    whole, half = (ended(ephs.load(SCENE), method="rk87", inputs=given)[1] for given in ({}, {"motors.drive": 6.0}))
    assert half.work[-1] < 0.5 * whole.work[-1]


def test_currents_are_states_of_the_linearisation():
    linear = ephs.linearize(ephs.load(SCENE))
    assert "motors.drive.coil.b" in linear.states
    assert np.isclose(np.linalg.eigvals(linear.A).real.min(), -0.8 / 2e-3, rtol=0.02)
    with pytest.raises(ephs.OptionError, match="drive"):
        ephs.equilibrium(ephs.load(SCENE))
