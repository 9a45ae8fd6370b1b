"""Small scenes with one parameter that makes them difficult.

Every body's axes are along the world's at the start, so that tensors and vectors are written in world axes.
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ephs.mechanics.scene.load import load
from ephs.mechanics.scene.model import Scene, frozen
from ephs.mechanics.scene.state import adjusted
from ephs.show.charts.runs import Array

Tables = Mapping[str, Mapping[str, Any]]
G = 9.81
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
ROD_WIDTH = 0.04
TURN = 2.0 * np.pi


def governor(stiffness: float) -> Scene:
    """A flyball governor: two arms on a spindle that turns at 10 rad/s, a sleeve that springs hold to them."""
    omega, top = np.array([0.0, 0.0, 10.0]), np.array([0.0, 0.0, 1.0])
    bodies = {
        "spindle": _body(1.0, (0.0, 0.0, 0.5), 0.01 * np.eye(3), omega=omega),
        "sleeve": _body(1.0, (0.0, 0.0, 0.3), 0.01 * np.eye(3), omega=omega),
    }
    joints = {
        "bearing": _joint("revolute", "ground", "spindle", (0.0, 0.0, 0.0), Z),
        "guide": _joint("prismatic", "spindle", "sleeve", (0.0, 0.0, 0.3), Z),
    }
    springs: dict[str, Any] = {}
    for name, side in (("left", -1.0), ("right", 1.0)):
        end = top + np.array([side * np.sqrt(0.5), 0.0, -np.sqrt(0.5)])
        bodies[name] = _rod(top, end, mass=1.0, omega=omega)
        joints[name] = _joint("revolute", "spindle", name, top, Y)
        length = float(np.linalg.norm(0.5 * (top + end) - np.array([0.0, 0.0, 0.3])))
        springs[name] = {
            "bodies": [name, "sleeve"],
            "at1": [0.0, 0.0, 0.0],
            "at2": [0.0, 0.0, 0.0],
            "stiffness": stiffness,
            "length": length,
            "damping": 0.1 * float(np.sqrt(stiffness)),
        }
    return _scene("governor", bodies, joints, springs, gravity=(0.0, 0.0, -G))


def pendulum(angle: float = 2.0, friction: float = 0.0) -> Scene:
    """A rod of 1 m, let go at an angle from hanging; friction in N m s/rad."""
    bodies = {"rod": _rod((0.0, 0.0, 0.0), (np.sin(angle), -np.cos(angle), 0.0))}
    joints = {"pin": _joint("revolute", "ground", "rod", (0.0, 0.0, 0.0), Z) | {"friction": friction}}
    return _scene("pendulum", bodies, joints)


def double_pendulum(angle: float = 1.0, upper: float = 1.0, lower: float = 1.0) -> Scene:
    """Two rods of 1 m of these masses in kg, let go stretched at an angle from hanging."""
    knee = np.array([np.sin(angle), -np.cos(angle), 0.0])
    end = knee + np.array([np.sin(0.7 * angle), -np.cos(0.7 * angle), 0.0])
    bodies = {"upper": _rod((0.0, 0.0, 0.0), knee, mass=upper), "lower": _rod(knee, end, mass=lower)}
    joints = {
        "hip": _joint("revolute", "ground", "upper", (0.0, 0.0, 0.0), Z),
        "knee": _joint("revolute", "upper", "lower", knee, Z),
    }
    return _scene("double-pendulum", bodies, joints)


def heavy_top(spin: float) -> Scene:
    """A disc on a stick of 1 m that spins about it, let go level."""
    omega, at = np.array([0.0, spin, 0.0]), np.array([0.0, 1.0, 0.0])
    bodies = {"top": _body(15.0, at, np.diag([0.234375, 0.46875, 0.234375]), omega=omega)}
    return _scene("top", bodies, {"tip": _joint("spherical", "ground", "top", (0.0, 0.0, 0.0))}, gravity=(0.0, 0.0, -G))


def slender_top(ratio: float) -> Scene:
    """A rod on a ball joint whose moment of inertia about itself is this part of the others."""
    bodies = {"rod": _body(1.0, (0.5, 0.0, 0.0), np.diag([ratio / 12.0, 1.0 / 12.0, 1.0 / 12.0]))}
    bodies["rod"] |= {"angular_velocity": [1.0, 1.0, 0.0], "velocity": [0.0, 0.0, -0.5]}
    joints = {"tip": _joint("spherical", "ground", "rod", (0.0, 0.0, 0.0))}
    return _scene("slender-top", bodies, joints, gravity=(0.0, 0.0, -G))


def free_body(rate: float, wobble: float = 0.05) -> Scene:
    """A free body that turns about its middle axis, of an unstable rotation, without gravity; rad/s."""
    omega = np.array([wobble, rate, wobble])
    bodies = {"body": _body(1.0, (0.0, 0.0, 0.0), np.diag([0.1, 0.2, 0.25]), omega=omega)}
    return _scene("free-body", bodies, {}, gravity=(0.0, 0.0, 0.0))


def redundant(count: float) -> Scene:
    """A mechanism of mobility 1 with 3 (a four-bar), 5, 20 (doors) or 10 (a slider) redundant constraints."""
    if count == 3:
        return _four_bar()
    if count == 10:
        bodies = {"slider": _body(2.0, (0.0, 0.0, 0.0), 0.01 * np.eye(3))}
        joints = {f"guide{i}": _joint("prismatic", "ground", "slider", (0.0, 0.1 * i, 0.0), X) for i in range(3)}
        spring = {"bodies": ["ground", "slider"], "at1": [1.0, 0.5, 0.0], "at2": [0.0, 0.0, 0.0], "stiffness": 50.0}
        return _scene("guides", bodies, joints, {"spring": spring})
    hinges = round(count / 5.0) + 1
    heights = np.linspace(0.1, 1.9, hinges)
    bodies = {"door": _body(20.0, (0.4, 0.0, 1.0), np.diag([6.7, 7.7, 1.1]))}
    joints = {f"hinge{i}": _joint("revolute", "ground", "door", (0.0, 0.0, z), Z) for i, z in enumerate(heights)}
    return _scene("door", bodies, joints, gravity=(0.0, -3.0, -G))


def parallelogram(angle: float) -> Scene:
    """A four-bar of equal opposite links, this angle before all of them are in line, on its way there at 1 rad/s."""
    d, turn = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([0.0, 0.0, -1.0])
    far, along = np.array([1.0, 0.0, 0.0]), np.cross([0.0, 0.0, -1.0], d)
    bodies = {
        "left": _rod((0.0, 0.0, 0.0), d, omega=turn),
        "right": _rod(far, far + d, omega=turn),
        "coupler": _rod(d, far + d, velocity=along),
    }
    return _scene("parallelogram", bodies, _four_joints(("left", "coupler", "right"), np.zeros(3), d, far + d, far))


def cardan_shaft(bend: float) -> Scene:
    """Two shafts with a universal joint at this angle in degrees between them."""
    b = np.radians(bend)
    d, across = np.array([np.cos(b), 0.0, np.sin(b)]), np.array([-np.sin(b), 0.0, np.cos(b)])
    bodies = {
        "driving": _rod((-0.4, 0.0, 0.0), (0.0, 0.0, 0.0), omega=(10.0, 0.0, 0.0)),
        "driven": _rod((0.0, 0.0, 0.0), 0.4 * d, omega=10.0 * np.cos(b) * d),
    }
    joints = {
        "input": _joint("revolute", "ground", "driving", (-0.2, 0.0, 0.0), X),
        "cross": _joint("universal", "driving", "driven", (0.0, 0.0, 0.0), Y) | {"axis2": across.tolist()},
        "output": _joint("cylindrical", "ground", "driven", 0.2 * d, d),
    }
    return _scene("cardan-shaft", bodies, joints, gravity=(0.0, 0.0, 0.0))


def stretched_chain(slack: float) -> Scene:
    """Three rods of 1 m between two pins that are (1 − slack)·3 m apart, under oblique gravity."""
    angle = np.arccos(1.0 - 1.5 * slack)
    dip, end = np.array([np.cos(angle), -np.sin(angle), 0.0]), np.array([3.0 * (1.0 - slack), 0.0, 0.0])
    other = dip + np.array([1.0, 0.0, 0.0])
    bodies = {"left": _rod((0.0, 0.0, 0.0), dip), "middle": _rod(dip, other), "right": _rod(end, other)}
    joints = _four_joints(("left", "middle", "right"), np.zeros(3), dip, other, end)
    return _scene("stretched-chain", bodies, joints, gravity=(0.7 * G, -0.7 * G, 0.0))


def toggle(angle: float) -> Scene:
    """A slider-crank pressed by 20 N into its dead point, its crank at an angle from there."""
    knee = 0.5 * np.array([np.cos(angle), np.sin(angle), 0.0])
    pin = np.array([knee[0] + np.sqrt(1.0 - knee[1] ** 2), 0.0, 0.0])
    bodies = {
        "crank": _rod((0.0, 0.0, 0.0), knee),
        "rod": _rod(knee, pin),
        "slider": _body(1.0, pin, 0.01 * np.eye(3)),
    }
    joints = {
        "main": _joint("revolute", "ground", "crank", (0.0, 0.0, 0.0), Z),
        "knee": _joint("revolute", "crank", "rod", knee, Z),
        "pin": _joint("revolute", "rod", "slider", pin, Z),
        "guide": _joint("prismatic", "ground", "slider", pin, X) | {"drive": -20.0},
    }
    return _scene("toggle", bodies, joints)


def truss(load: float) -> Scene:
    """Two rods that a revolute, a spherical and a cylindrical joint hold immobile, under this many times gravity."""
    top, far = np.array([0.5, 0.8, 0.0]), np.array([1.0, 0.0, 0.0])
    bodies = {"left": _rod((0.0, 0.0, 0.0), top), "right": _rod(far, top)}
    joints = {
        "base": _joint("revolute", "ground", "left", (0.0, 0.0, 0.0), Z),
        "ball": _joint("spherical", "left", "right", top),
        "slide": _joint("cylindrical", "ground", "right", far, Z),
    }
    return _scene("truss", bodies, joints, gravity=(0.0, -G * load, 0.0))


def four_bar_off(gap: float) -> Scene:
    """A four-bar whose coupler is put this many m, and moves this many m/s, off where its joints want it."""
    scene = _four_bar()
    coupler = scene.bodies["coupler"]
    pose, twist = np.array(coupler.pose), np.array(coupler.twist)
    pose[5] += gap
    twist[4] += gap
    return replace(scene, bodies={**scene.bodies, "coupler": replace(coupler, pose=frozen(pose), twist=frozen(twist))})


def four_bar_back(gap: float) -> Scene:
    """The consistent state next to that of `four_bar_off`."""
    return adjusted(four_bar_off(gap), {})[0]


def _four_bar() -> Scene:
    """A crank-rocker, the crank upright at 5 rad/s; the rates of the others follow from its loop."""
    crank, pivot = np.array([0.0, 0.3, 0.0]), np.array([1.0, 0.0, 0.0])
    knee = _corner(crank, 0.9, pivot, 0.7)
    rate = 5.0
    # velocity of the knee: that of the crank's end and a turn of the coupler, or a turn of the rocker
    velocity = np.array([-rate * crank[1], rate * crank[0]])
    one, two = knee - crank, knee - pivot
    turns = np.linalg.solve(np.array([[-one[1], two[1]], [one[0], -two[0]]]), -velocity)
    bodies = {
        "crank": _rod((0.0, 0.0, 0.0), crank, mass=0.6, omega=(0.0, 0.0, rate)),
        "coupler": _rod(crank, knee, mass=1.8, omega=(0.0, 0.0, turns[0]), velocity=(*velocity, 0.0)),
        "rocker": _rod(pivot, knee, mass=1.4, omega=(0.0, 0.0, turns[1])),
    }
    return _scene("four-bar", bodies, _four_joints(("crank", "coupler", "rocker"), np.zeros(3), crank, knee, pivot))


def _corner(a: Array, from_a: float, b: Array, from_b: float) -> Array:
    """The upper point at these distances from two points."""
    line = b - a
    apart = float(np.linalg.norm(line))
    along = (apart**2 + from_a**2 - from_b**2) / (2.0 * apart)
    up = np.array([-line[1], line[0], 0.0]) / apart
    return a + along * line / apart + float(np.sqrt(from_a**2 - along**2)) * up


def _four_joints(names: tuple[str, str, str], a: Array, b: Array, c: Array, d: Array) -> dict[str, Any]:
    first, middle, last = names
    return {
        "a": _joint("revolute", "ground", first, a, Z),
        "b": _joint("revolute", first, middle, b, Z),
        "c": _joint("revolute", middle, last, c, Z),
        "d": _joint("revolute", "ground", last, d, Z),
    }


def _rod(
    start: ArrayLike, end: ArrayLike, mass: float = 1.0, omega: ArrayLike = (0.0, 0.0, 0.0), velocity: ArrayLike = 0.0
) -> dict[str, Any]:
    """A rod between two points; ``velocity`` is that of its start."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    line = b - a
    whole = float(line @ line)
    inertia = mass / 12.0 * (whole * np.eye(3) - np.outer(line, line)) + mass * ROD_WIDTH**2 / 12.0 * np.eye(3)
    body = _body(mass, 0.5 * (a + b), inertia)
    swung = np.asarray(velocity) + np.cross(np.asarray(omega, dtype=float), 0.5 * line)
    return body | {"velocity": swung.tolist(), "angular_velocity": np.asarray(omega, dtype=float).tolist()}


def _body(mass: float, at: ArrayLike, inertia: Array, omega: ArrayLike = (0.0, 0.0, 0.0)) -> dict[str, Any]:
    """A body; ``omega`` turns it about the origin."""
    place, turn = np.asarray(at, dtype=float), np.asarray(omega, dtype=float)
    rows = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return {
        "mass": float(mass),
        "inertia": [float(entry) for entry in rows],
        "position": place.tolist(),
        "velocity": np.cross(turn, place).tolist(),
        "angular_velocity": turn.tolist(),
    }


def _joint(kind: str, first: str, second: str, at: ArrayLike, axis: ArrayLike | None = None) -> dict[str, Any]:
    where = {"type": kind, "bodies": [first, second], "at": np.asarray(at, dtype=float).tolist()}
    return where if axis is None else where | {"axis": np.asarray(axis, dtype=float).tolist()}


def _scene(
    name: str,
    bodies: Tables,
    joints: Tables,
    springs: Tables | None = None,
    gravity: tuple[float, float, float] = (0.0, -G, 0.0),
) -> Scene:
    """The scene of these tables, read as a scene file is."""
    lines = ["format = 1", f"name = {json.dumps(name)}", "[world]", f"gravity = {list(gravity)}"]
    for section, tables in (("bodies", bodies), ("joints", joints), ("springs", springs or {})):
        for key, table in tables.items():
            lines += [f"[{section}.{key}]", *(f"{entry} = {json.dumps(value)}" for entry, value in table.items())]
    with TemporaryDirectory() as folder:
        file = Path(folder, f"{name}.toml")
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return replace(load(file), source=None)
