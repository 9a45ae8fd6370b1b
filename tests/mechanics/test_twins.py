"""What `ephs.mechanics` makes by hand moves like its twin in a scene file, both from their arguments alone."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

import ephs
import ephs.mechanics as m
from ephs import Pattern, junction
from ephs import quantity as Q
from ephs.mechanics.elements import components
from ephs.mechanics.scene.build import component_path
from tests.numerics import largest
from tests.written import scene_of_text

NO_COMPONENTS = {"Inside", "body_pattern", "joint_pattern", "mbs_pattern", "stabilised"}
GRAVITY = [0.3, -9.81, 0.2]
SCENE = f"""
format = 1
name = "twin"
world = {{ gravity = {GRAVITY} }}
bodies.rod = {{ mass = 1.2, inertia = [0.1, 0.2, 0.3], position = [0.5, 0.0, 0.0] }}
bodies.block = {{ mass = 2.0, inertia = [0.2, 0.3, 0.4], position = [1.0, 1.0, 0.0] }}

[joints.rail]
type = "prismatic"
bodies = ["ground", "block"]
at = [0.0, 1.0, 0.0]
axis = [1.0, 0.0, 0.0]
"""
PIN = """
[joints.pin]
type = "revolute"
bodies = ["ground", "rod"]
at = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
friction = 0.05
"""
ALONG = [0.5**0.5, 0.0, 0.5**0.5, 0.0]
"""Rotation of the z axis to the x axis."""
TURN, SLIDE = Q.joint_momentum("revolute"), Q.joint_momentum("prismatic")
JUNCTIONS = {
    "ground": Q.body_momentum, "rod": Q.body_momentum, "block": Q.body_momentum, "first": Q.body_momentum,
    "second": Q.body_momentum, "turn": TURN, "slide": SLIDE, "push": Q.momentum, "a": Q.liquid, "b": Q.liquid,
    "volt": Q.charge, "s": Q.entropy, "e": Q.displacement,
}  # fmt: skip
STEP, STEPS = 1e-3, 20
ROUNDING = 8 * 4 * STEPS * 2.2e-16
"""Of eight sums a stage, four stages a step in the mean, relative."""


@dataclass(frozen=True)
class Twin:
    """Text for the scene, boxes by hand with their ports, inputs by port; compared: box by hand -> body of the scene;
    condition: of differences that it takes, of volumes for a pressure by a bulk modulus, of 1 for a strain of 1e-3."""

    text: str
    boxes: dict[str, tuple[Any, dict[str, str]]]
    inputs: dict[str, dict[str, float]] = field(default_factory=dict)
    compared: dict[str, str] = field(default_factory=lambda: {"rod": "rod", "block": "block"})
    pinned: bool = True
    condition: float = 1.0


def listed(numbers):
    return "".join(f"{key} = {x}\n" for key, x in numbers.items())


def swung(_load):
    return Twin("", {})


def armature(_load):
    return Twin("armature = 0.7\n", {"it": (m.armature(TURN, 0.7), {"p": "turn"})})


def motor(_load):
    numbers = {"constant": 0.4, "resistance": 0.8, "gear": 3.0, "inductance": 2e-3, "inertia": 2e-4}
    text = "[motors.it]\njoint = 'pin'\nvoltage = 12.0\n" + listed(numbers)
    return Twin(text, {"it": (m.motor(TURN, **numbers), {"q": "volt", "p_r": "turn"})}, {"volt": {"effort": 12.0}})


def gear(_load):
    text = "[gears.it]\njoints = ['pin', 'rail']\nratio = [-1.5]\nfriction = 0.3\n"
    return Twin(text, {"it": (m.gear([TURN, SLIDE], [-1.5], friction=0.3), {"p0": "turn", "p1": "slide"})})


def belt(_load):
    numbers = {"stiffness": 40.0, "damping": 0.3, "stretch": 0.2}
    text = "[gears.it]\njoints = ['pin', 'rail']\nratio = [1.5]\n" + listed(numbers)
    return Twin(text, {"it": (m.gear([TURN, SLIDE], [1.5], **numbers), {"p0": "turn", "p1": "slide"})})


def hydraulic_cylinder(_load):
    numbers = {"area": [2e-3, 1e-3], "volume": [1e-4, 2e-4], "bulk": 1e7, "conductance": 1e-9, "leak": 1e-11}
    text = "[cylinders.it]\njoint = 'rail'\npressure = [3e4, 1e4]\n" + listed(numbers)
    made = m.hydraulic_cylinder(SLIDE, pressure=[3e4, 1e4], **numbers)
    inputs = {"a": {"effort": 3e4}, "b": {"effort": 1e4}}
    return Twin(text, {"it": (made, {"a": "a", "b": "b", "p_r": "slide"})}, inputs, condition=1e7 / 1e4)


def gas_spring(_load):
    numbers = {"area": -1e-3, "volume": 2e-4, "pressure": 3e5, "temperature": 310.0, "conductance": 0.5}
    text = "[gas_springs.it]\njoint = 'rail'\n" + listed(numbers)
    return Twin(text, {"it": (m.gas_spring(SLIDE, **numbers), {"p_r": "slide"})})


def tendon(_load, **slack):
    text = "[tendons.it]\nbodies = ['ground', 'rod', 'rod', 'block']\nstiffness = 50.0\nlength = 1.1\n"
    text += "points = [[0.0, 0.5, 0.3], [0.1, 0.2, 0.0], [0.4, 0.1, 0.0], [0.0, -0.2, 0.1]]\n"
    text += "slack = true\n" if slack else "damping = 2.0\n"
    inside = float(np.hypot(0.3, 0.1))
    points = [([0.0, 0.5, 0.3], [0.1, 0.2, 0.0]), ([0.4, 0.1, 0.0], [0.0, -0.2, 0.1])]
    made = m.tendon(points, 50.0, 1.1 - inside, 0.0 if slack else 2.0, **slack)
    ports = {"a1": "ground", "b1": "rod", "a2": "rod", "b2": "block", "p": "push"}
    return Twin(text, {"it": (made, ports)}, {"push": {"flow": 0.0}})


def slack_tendon(load):
    return tendon(load, slack=True)


def spring_damper(_load):
    numbers = {"at1": [0.3, 0.1, 0.0], "at2": [0.0, -0.1, 0.2], "stiffness": 80.0, "length": 0.4, "damping": 3.0}
    text = "[springs.it]\nbodies = ['rod', 'block']\n" + listed(numbers)
    return Twin(text, {"it": (m.spring_damper(**numbers), {"p1": "rod", "p2": "block"})})


def universal_joint(_load):
    numbers = {"friction": [0.1, 0.2], "stiffness": [3.0, 4.0], "rest": [0.5, -0.5]}
    text = "[joints.it]\ntype = 'universal'\nbodies = ['ground', 'rod']\nat = [0.0, 0.0, 0.0]\n"
    text += "axis = [0.0, 0.0, 1.0]\naxis2 = [1.0, 0.0, 0.0]\n" + listed(numbers)
    made = m.universal_joint(None, [*ALONG, 0, 0, 0], [*ALONG, -0.5, 0, 0], **numbers)
    return Twin(text, {"it": (made, {"p1": "ground", "p2": "rod"})}, pinned=False)


def beam_element(load, more="", heat=False):
    """A beam of one element whose first node is welded to the ground."""
    text = "[beams.it]\nfrom = [0.0, 0.0, 1.0]\nto = [1.0, 0.0, 1.0]\nelements = 1\nends = ['ground']\n"
    text += "section = { rectangle = [0.1, 0.02], E = 1e6, nu = 0.3, rho = 800.0 }\n" + more
    scene = load(text)
    (element,) = (j for _, j in scene.all_joints() if j.strain is not None)
    (node,) = (body for name, body in scene.all_bodies() if name == element.body2)
    of, (*turn, _, _, _) = element.strain, node.pose
    made = m.beam_element(
        [*turn, 0, 0, 1.0], None, length=of.length, stiffness=of.stiffness, rest=of.rest, damping=of.damping,
        order=of.order, heat=heat, expands=heat,
    )  # fmt: skip
    boxes = {
        "it": (made, {"p1": "ground", "p2": "second"} | ({"s": "s", "e": "e"} if heat else {})),
        "bodies.tip": (m.rigid_body(node.mass, node.inertia, GRAVITY), {"p": "second"}),
    }
    return Twin(text, boxes, compared={"tip": element.body2, "rod": "rod"}, condition=1e3)


def damped_beam(load):
    return beam_element(load, "damping = 1e-5\n")


def thermoelastic(load):
    numbers = "capacity = 500.0, conduction = 1.0, temperature = 320.0, expansion = 1e-3, reference = 300.0"
    twin = beam_element(load, f"thermal = {{ {numbers} }}\n", heat=True)
    (node,) = (node for _, node in load(twin.text).all_thermal())
    made = m.thermoelastic(node.capacity, node.temperature, node.pull, node.reference)
    return Twin(twin.text, twin.boxes | {"warm": (made, {"e": "e", "s": "s"})}, compared=twin.compared, condition=1e3)


TWINS = {
    "joint": swung, "rigid_body": swung, "armature": armature, "motor": motor, "gear": gear, "belt": belt,
    "hydraulic_cylinder": hydraulic_cylinder, "gas_spring": gas_spring, "tendon": tendon, "slack tendon": slack_tendon,
    "spring_damper": spring_damper, "universal_joint": universal_joint, "beam_element": beam_element,
    "damped beam": damped_beam, "thermoelastic": thermoelastic,
}  # fmt: skip


OF_OWN = {"Element", "Site", "key", "register_element", "rule"}
"""What makes elements of one's own, which have twins of theirs."""
SHELLS = {"Shell", "ShellSection", "Ply", "shell_element", "shell_system"}
"""Arrays, in no scene; and systems whose twins are in `elements/shell/test_shell_scenes.py`."""


def test_every_component_has_a_twin():
    assert set(m.__all__) - NO_COMPONENTS - OF_OWN - SHELLS <= set(TWINS)


def by_hand(twin):
    """The two bodies on their joints, and the boxes of a twin."""
    used = {at for _, ports in twin.boxes.values() for at in ports.values()}
    boxes = {
        "earth": (components.ground(), {"p": "ground"}),
        "bodies.rod": (m.rigid_body(1.2, [0.1, 0.2, 0.3], GRAVITY), {"p": "rod"}),
        "bodies.block": (m.rigid_body(2.0, [0.2, 0.3, 0.4], GRAVITY), {"p": "block"}),
    }
    frames = {"rail": ([*ALONG, 0, 1.0, 0], [*ALONG, -1.0, 0, 0]), "pin": (None, [1.0, 0, 0, 0, -0.5, 0, 0])}
    ends = {"rail": ("prismatic", "block", "slide", 0.0), "pin": ("revolute", "rod", "turn", 0.05)}
    for name in ["rail", *["pin"] * twin.pinned]:
        kind, body, rate, friction = ends[name]
        made = m.joint(kind, *frames[name], friction, driven=rate in used)
        boxes[name] = (made, {"p1": "ground", "p2": body} | ({"p_r": rate} if rate in used else {}))
    boxes |= twin.boxes
    used |= {at for _, ports in boxes.values() for at in ports.values()}
    pattern = Pattern(
        junctions={name: junction(JUNCTIONS[name], exposed=name in twin.inputs) for name in used},
        boxes={box: ports for box, (_, ports) in boxes.items()},
    )
    return pattern(**{box: filling for box, (filling, _) in boxes.items()})


@pytest.fixture
def load():
    def load(text):
        return scene_of_text(SCENE + text)

    return load


@pytest.mark.parametrize("name", TWINS)
def test_twins_move_alike(name, load):
    twin = TWINS[name](load)
    options = {"until": STEP * STEPS, "method": "rk54", "step": STEP, "audit": "off"}
    scene = load((PIN if twin.pinned else "") + twin.text)
    one, two = ephs.simulate(by_hand(twin), inputs=twin.inputs, **options), ephs.simulate(scene, **options)
    for box, body in twin.compared.items():
        for state in ("ke.p", "pe.q"):
            here, there = one[f"bodies.{box}.{state}"], two[f"{component_path('bodies', body)}.{state}"]
            assert largest(here - there) <= twin.condition * ROUNDING * largest(there)


@pytest.mark.parametrize("name", TWINS)
def test_twins_linearise_alike(name, load):
    """In independent coordinates of joints, out of equilibrium, too; in all states there are others."""
    twin = TWINS[name](load)
    scene = ephs.linearize(load((PIN if twin.pinned else "") + twin.text))
    system = by_hand(twin)
    hand = ephs.linearize(system, inputs=twin.inputs)
    assert hand.A.shape == scene.A.shape
    one, other = hand.eigenvalues, scene.eigenvalues
    apart = max(np.abs(one - value).min() for value in other)
    assert apart <= twin.condition * ROUNDING * largest(other)
    whole = ephs.linearize(system, inputs=twin.inputs, form="paper")
    assert whole.A.shape[0] > scene.A.shape[0]
