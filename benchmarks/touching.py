"""Scenes of contact, in scene files and in MJCF: stacks, bouncing balls, a wheel that slips and rolls, a gripper.

Stiffnesses are chosen so that overlaps are about those of the other's usual settings.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import final

__all__ = ["SCENES", "Touching"]

HEAD = 'format = 1\nname = "{name}"\n'
SURFACE = """
[surfaces.{name}]
body = "{name}"
shape = {{ {shape} }}
stiffness = {stiffness}
loss = 0.3
friction = {friction}
slip = 1e-3
"""
FLOOR = """
[surfaces.floor]
body = "ground"
shape = { plane = {} }
"""
MJCF = """<mujoco><compiler angle="radian"/><option timestep="0.002"/><worldbody>
<geom name="floor" type="plane" size="50 50 1" friction="{friction} 0.005 0.0001"/>{bodies}</worldbody>
<keyframe><key qvel="{rates}"/></keyframe></mujoco>"""
RADIUS, MASS = 0.1, 1.0
INERTIA = 0.4 * MASS * RADIUS**2


@final
@dataclass(frozen=True, slots=True)
class Touching:
    """A scene for both.

    Parameters
    ----------
    scene, mjcf
        Texts.
    until
        End in s.
    """

    name: str
    scene: str
    mjcf: str
    until: float


def _ball(name: str, place: tuple[float, float, float], velocity: tuple[float, float, float]) -> str:
    return f"""
[bodies.{name}]
mass = {MASS}
inertia = {[INERTIA] * 3}
position = {list(place)}
velocity = {list(velocity)}
"""


def _surface(name: str, shape: str, stiffness: float, friction: float) -> str:
    return SURFACE.format(name=name, shape=shape, stiffness=stiffness, friction=friction)


def _pairs(names: list[tuple[str, str]]) -> str:
    return "".join(f'\n[contacts.{one}_{other}]\nsurfaces = ["{one}", "{other}"]\n' for one, other in names)


def _mjcf(friction: float, bodies: list[str], rates: list[float]) -> str:
    return MJCF.format(friction=friction, bodies="".join(bodies), rates=" ".join(map(str, rates)))


def stack(count: int = 10) -> Touching:
    """Balls on slides, one above the other, that fall 1 cm onto each other and the floor."""
    names, gap = [f"ball{i}" for i in range(count)], 0.01
    heights = [RADIUS + gap + i * (2.0 * RADIUS + gap) for i in range(count)]
    own, theirs = [HEAD.format(name="stack")], list[str]()
    for name, height in zip(names, heights, strict=True):
        own += [
            _ball(name, (0.0, 0.0, height), (0.0, 0.0, 0.0)),
            f'[joints.slide_{name}]\ntype = "prismatic"\nbodies = ["ground", "{name}"]\n'
            f"at = [0.0, 0.0, {height}]\naxis = [0.0, 0.0, 1.0]\n",
            _surface(name, f"sphere = {RADIUS}", 1e5, 0.0),
        ]
        theirs.append(
            f'<body pos="0 0 {height}"><joint type="slide" axis="0 0 1"/>'
            f'<geom type="sphere" size="{RADIUS}" mass="{MASS}"/></body>'
        )
    own += [FLOOR, _pairs([("floor", names[0]), *pairwise(names)])]
    return Touching("stack of ten", "".join(own), _mjcf(1.0, theirs, [0.0] * count), 1.0)


def boxes(count: int = 10) -> Touching:
    """Free cubes, one above the other, that fall 1 mm onto each other and the floor, and come to rest."""
    names, gap, side = [f"box{i}" for i in range(count)], 1e-3, 2.0 * RADIUS
    heights = [RADIUS + gap + i * (side + gap) for i in range(count)]
    own, theirs = [HEAD.format(name="boxes")], list[str]()
    for name, height in zip(names, heights, strict=True):
        own += [
            _ball(name, (0.0, 0.0, height), (0.0, 0.0, 0.0)),
            _surface(name, f"box = [{side}, {side}, {side}]", 1e4, 0.5),
        ]
        theirs.append(
            f'<body pos="0 0 {height}"><freejoint/><inertial pos="0 0 0" mass="{MASS}"'
            f' diaginertia="{INERTIA} {INERTIA} {INERTIA}"/>'
            f'<geom type="box" size="{RADIUS} {RADIUS} {RADIUS}" friction="0.5 0.005 0.0001"/></body>'
        )
    own += [FLOOR, _pairs([("floor", names[0]), *pairwise(names)])]
    return Touching("ten boxes", "".join(own), _mjcf(0.5, theirs, [0.0] * (6 * count)), 0.5)


def bouncing(count: int = 50) -> Touching:
    """Balls that are thrown from several heights and bounce on the floor."""
    own, theirs = [HEAD.format(name="bouncing")], list[str]()
    names, rates = [f"ball{i}" for i in range(count)], list[float]()
    for i, name in enumerate(names):
        place = (0.3 * (i % 10), 0.3 * (i // 10), 0.2 + 0.3 * ((7 * i) % count) / count)
        speed = 0.5 * math.sin(i)
        own += [_ball(name, place, (speed, 0.0, 0.0)), _surface(name, f"sphere = {RADIUS}", 1e5, 0.5)]
        rates += [speed, *[0.0] * 5]
        x, y, z = place
        theirs.append(
            f'<body pos="{x} {y} {z}"><freejoint/><geom type="sphere" size="{RADIUS}" mass="{MASS}"'
            f' contype="2" conaffinity="1" friction="0.5 0.005 0.0001"/></body>'
        )
    own += [FLOOR, _pairs([("floor", name) for name in names])]
    return Touching("50 balls", "".join(own), _mjcf(0.5, theirs, rates), 0.2)


def wheel() -> Touching:
    """A wheel that turns at 30 rad/s, comes down 1 cm, slips, and rolls away."""
    own = HEAD.format(name="wheel") + _ball("wheel", (0.0, 0.0, RADIUS + 0.01), (0.0, 0.0, 0.0))
    own += "angular_velocity = [0.0, 30.0, 0.0]\nrotation = { axis = [1.0, 0.0, 0.0], angle = 1.5707963267948966 }\n"
    own += _surface("wheel", f"cylinder = [{RADIUS}, 0.05]", 1e5, 0.5) + FLOOR
    theirs = (
        f'<body pos="0 0 {RADIUS + 0.01}" euler="1.5707963267948966 0 0"><freejoint/>'
        f'<inertial pos="0 0 0" mass="{MASS}" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/>'
        f'<geom type="cylinder" size="{RADIUS} 0.025" friction="0.5 0.005 0.0001"/></body>'
    )
    return Touching("wheel", own, _mjcf(0.5, [theirs], [0.0] * 5 + [-30.0]), 1.0)


def gripper() -> Touching:
    """Two fingers on slides that press on a ball from both sides with springs, and hold it by friction."""
    half, force, stiffness = 0.02, 20.0, 200.0
    own = HEAD.format(name="gripper") + _ball("ball", (0.0, 0.0, 0.5), (0.0, 0.0, 0.0))
    own += _surface("ball", f"sphere = {RADIUS}", 1e5, 0.9)
    theirs = (
        f'<body pos="0 0 0.5"><freejoint/><geom type="sphere" size="{RADIUS}" mass="{MASS}" friction="0.9 0 0"/></body>'
    )
    for name, side in (("left", -1.0), ("right", 1.0)):
        at, rest = side * (RADIUS + half + 1e-3), -side * force / stiffness
        own += (
            _ball(name, (0.0, at, 0.5), (0.0, 0.0, 0.0)) + f'[joints.slide_{name}]\ntype = "prismatic"\n'
            f'bodies = ["ground", "{name}"]\nat = [0.0, {at}, 0.5]\naxis = [0.0, 1.0, 0.0]\n'
            f"stiffness = {stiffness}\nrest = {rest}\nfriction = 10.0\n"
            + _surface(name, f"box = [0.2, {2 * half}, 0.2]", 1e5, 0.9)
        )
        theirs += (
            f'<body pos="0 {at} 0.5"><joint type="slide" axis="0 1 0" stiffness="{stiffness}" springref="{rest}"'
            f' damping="10"/><geom type="box" size="0.1 {half} 0.1" mass="{MASS}" friction="0.9 0 0"/></body>'
        )
    own += _pairs([("left", "ball"), ("right", "ball")])
    return Touching("gripper", own, _mjcf(0.9, [theirs], [0.0] * 8), 1.0)


SCENES = (stack, boxes, bouncing, wheel, gripper)
"""Makers of all."""
