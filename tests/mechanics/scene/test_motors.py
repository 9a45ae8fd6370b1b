"""Motors and armatures of scene files."""

from dataclasses import replace

import numpy as np
import pytest

import ephs
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from ephs.mechanics.scene.rescaled import rescaled
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


def test_all_forms_and_units_give_one_motion():
    scene = ephs.load(SCENE)
    scene = replace(scene, motors={"drive": scene.motors["drive"].changed(current=3.0)})
    exact = ended(scene, method="rk87", rtol=1e-11, atol=1e-12)[0]
    coarse, fine = (ended(scene, method="natural", step=h, audit="off")[0] - exact for h in (2e-3, 1e-3))
    assert np.allclose(coarse, 4.0 * fine, rtol=0.05, atol=1e-9)
    units = 2.0**10, 2.0**-9, 2.0**7  # of length, mass and time
    other = ended(rescaled(scene, *units), 0.2 * units[2], method="rk87", rtol=1e-11, atol=1e-12)[0]
    energy = units[1] * units[0] ** 2 / units[2] ** 2
    assert np.allclose(other / (energy * np.array([units[2], units[2], 1.0])), exact, rtol=1e-7, atol=0.0)


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


def test_a_voltage_is_an_input_and_a_scene_survives_its_text():
    scene = scene_from_text(scene_to_text(ephs.load(SCENE)))
    same, other = ended(scene, method="rk87"), ended(scene, method="rk87", inputs={"motors.drive": 6.0})
    assert np.array_equal(same[0], ended(ephs.load(SCENE), method="rk87")[0])
    assert other[1].work[-1] < 0.5 * same[1].work[-1]


def test_currents_are_states_of_the_linearisation():
    linear = ephs.linearize(ephs.load(SCENE))
    assert "motors.drive.coil.b" in linear.states
    assert np.isclose(np.linalg.eigvals(linear.A).real.min(), -0.8 / 2e-3, rtol=0.02)
    with pytest.raises(ephs.OptionError, match="drive"):
        ephs.equilibrium(ephs.load(SCENE))
