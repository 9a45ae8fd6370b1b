"""A six-bar linkage made by hand, with motor and heat: what a scene has, it has, too, and the same."""

from pathlib import Path as File

import numpy as np
import pytest

import ephs
from ephs import Pattern, junction, library, quantity
from ephs.mechanics import joint, motor, rigid_body
from ephs.mechanics.elements import components
from ephs.mechanics.runs.check import check_model
from ephs.mechanics.scene.parameters import varied
from ephs.show import animate
from tests.numerics import largest
from tests.written import scene_of_text

FILE = File(ephs.__file__).parents[1] / "scenes" / "n-four-bar.toml"
MOTOR = {"constant": 0.4, "resistance": 0.8, "gear": 3.0, "inductance": 2e-3, "inertia": 2e-4}
HEATED = """
[thermal.housing]
capacity = 40.0
temperature = 300.0
[motors.drive]
joint = "foot0"
voltage = 6.0
heat = "housing"
"""
GRAVITY, VOLTAGE = (0.0, 0.0, -9.81), 6.0
RUBBED = ("foot1", 0.3)


@pytest.fixture(scope="module")
def twins():
    """(scene, system, its states, its inputs) of five bars on seven pins."""
    name, friction = RUBBED
    text = FILE.read_text().replace(f"[joints.{name}]\n", f'[joints.{name}]\nfriction = {friction}\nheat = "housing"\n')
    scene = scene_of_text(text + HEATED + "".join(f"{key} = {value}\n" for key, value in MOTOR.items()))
    turn = quantity.joint_momentum("revolute")
    junctions = {name: junction(quantity.body_momentum) for name in ("ground", *scene.bodies)}
    junctions |= {
        "turn": junction(turn),
        "volt": junction(quantity.charge, exposed=True),
        "s": junction(quantity.entropy),
    }
    parts = {
        "base": (components.ground(), {"p": "ground"}),
        "drive": (motor(turn, **MOTOR, heat=True), {"q": "volt", "p_r": "turn", "s": "s"}),
        "housing": (library.thermal_capacity(capacity=40.0, temperature=300.0), {"s": "s"}),
    }
    for name, body in scene.bodies.items():
        parts[f"bars.{name}"] = rigid_body(body.mass, body.inertia, GRAVITY), {"p": name}
    for name, pin in scene.joints.items():
        ports = {"p1": pin.body1, "p2": pin.body2} | ({"p_r": "turn"} if name == "foot0" else {})
        warm = name == RUBBED[0]
        made = joint("revolute", pin.frame1, pin.frame2, RUBBED[1] if warm else 0.0, heat=warm, driven=name == "foot0")
        parts[name] = made, ports | ({"s": "s"} if warm else {})
    pattern = Pattern(junctions=junctions, boxes={box: ports for box, (_, ports) in parts.items()})
    states = {f"bars.{name}.pe.q": body.pose for name, body in scene.bodies.items()}
    for name, body in scene.bodies.items():
        inertia = np.zeros((6, 6))
        inertia[:3, :3], inertia[3:, 3:] = body.inertia, body.mass * np.eye(3)
        states[f"bars.{name}.ke.p"] = inertia @ body.twist
    states["drive.rotor.p"] = MOTOR["inertia"] * MOTOR["gear"] * scene.joint("foot0").rate
    return scene, pattern(**{box: made for box, (made, _) in parts.items()}), states, {"volt": {"effort": VOLTAGE}}


def test_its_constraints_are_told_in_the_words_of_the_scene(twins):
    scene, system, states, _ = twins
    told = [{item.name: item.detail for item in check_model(*of).items} for of in ((scene,), (system, states))]
    for name in ("mobility", "redundant constraints", "joint wrenches"):
        assert told[0][name] == told[1][name]
    assert "right0 repeats foot0, foot1 and left0" in told[1]["redundant constraints"]
    assert all(item.ok for item in check_model(system, states).items)


def test_a_gap_is_named(twins):
    _, system, states, inputs = twins
    off = states | {"bars.coupler1.pe.q": states["bars.coupler1.pe.q"] + [0, 0, 0, 0, 0, 0, 0.01]}
    with pytest.raises(ephs.AssemblyError, match=r"left1|right1"):
        ephs.linearize(system, off, inputs=inputs)


def test_it_linearises_as_its_scene(twins):
    """In five states: an angle, its rate, the magnet, the current, the heat of the housing."""
    scene, system, states, inputs = twins
    one, two = ephs.linearize(scene), ephs.linearize(system, states, inputs=inputs)
    assert len(one.states) == len(two.states) == 5
    apart = max(np.abs(two.eigenvalues - value).min() for value in one.eigenvalues)
    size = largest(one.eigenvalues)
    assert apart <= 1e-10 * size
    other = ephs.linearize(varied(scene, {f"joints.{RUBBED[0]}.friction": 1.01 * RUBBED[1]}))
    assert max(np.abs(two.eigenvalues - value).min() for value in other.eigenvalues) > 1e-6 * size
    assert two.inputs == ("volt",)


def test_it_moves_is_saved_loaded_and_drawn_as_its_scene(twins, tmp_path):
    scene, system, states, inputs = twins
    how = {"until": 0.05, "method": "rk87", "step": 2e-3, "audit": "off"}
    one, two = ephs.simulate(scene, **how), ephs.simulate(system, initial=states, inputs=inputs, **how)
    two.save(tmp_path / "six.nc")
    back = ephs.load_solution(tmp_path / "six.nc")
    for solution in (two, back):
        for name in scene.joints:
            assert largest(one.joint(name).rate - solution.joint(name).rate) <= 1e-9
        for name in scene.bodies:
            assert largest(one.body(name).position - solution.body(f"bars.{name}").position) <= 1e-11
        assert largest(one.temperature("thermal.housing") - solution.temperature("housing")) <= 1e-9
        assert largest(one.energy_error - solution.energy_error) <= 1e-12
    assert float(np.ptp(one.joint("foot0").rate)) > 0.1 and float(np.ptp(one.temperature("thermal.housing"))) > 1e-4
    animate(back, tmp_path / "six.html")
    assert (tmp_path / "six.html").stat().st_size > 1000
