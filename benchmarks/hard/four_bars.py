"""Planar four-bars against the equation of their one freedom: tilted, tiny, heavy, wired by hand, adjusted."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import ephs
from benchmarks.hard.case import Case, read
from ephs.mechanics import joint, rigid_body
from ephs.mechanics.elements.components import ground
from ephs.operad import Pattern, junction, quantity

__all__ = ["ADJUSTED", "CASES", "PINS", "crank_angle", "four_bar", "wired", "wired_poses"]

Array = NDArray[np.float64]
G = 9.81
PINS = {"a": (0.0, 0.0), "b": (0.3, 0.8), "c": (1.5, 1.1), "d": (1.2, 0.0)}
BODIES = {"crank": "ab", "coupler": "bc", "rocker": "cd"}
JOINTS = {"a": ("ground", "crank"), "b": ("crank", "coupler"), "c": ("coupler", "rocker"), "d": ("ground", "rocker")}
ROUND = 0.1
"""Moments of inertia in kg m² of bodies that are alike about all axes."""
UNTIL = 0.4


def four_bar(
    masses: Sequence[float] = (1.0, 1.0, 1.0),
    *,
    tilt: float = 0.0,
    size: float = 1.0,
    gravity: float = G,
    pins: Mapping[str, tuple[float, float]] = PINS,
    name: str = "four-bar",
) -> str:
    """A scene's tables: a planar four-bar from rest under gravity along −y, of slender links.

    Parameters
    ----------
    masses
        Of crank, coupler and rocker in kg.
    tilt
        Angle in rad by which the axis of one pin leaves the common direction.
    size
        Length in m of the unit of ``pins``.
    """
    lines = ["[world]", f"gravity = [0.0, {-gravity!r}, 0.0]"]
    for (body, ends), mass in zip(BODIES.items(), masses, strict=True):
        a, b = (size * np.array(pins[end]) for end in ends)
        angle, inertia = 0.5 * np.arctan2(*(b - a)[::-1]), mass * float(np.sum((b - a) ** 2)) / 12.0
        lines += [
            f"[bodies.{body}]",
            f"mass = {mass!r}",
            f"inertia = [{inertia / 50.0!r}, {inertia!r}, {inertia!r}]",
            f"position = {[*(0.5 * (a + b)).tolist(), 0.0]}",
            f"rotation = {[float(np.cos(angle)), 0.0, 0.0, float(np.sin(angle))]}",
        ]
    for pin, ends in JOINTS.items():
        x, y = (size * value for value in pins[pin])
        tilted = tilt if pin == "b" else 0.0
        lines += [f"[joints.{pin}]", 'type = "revolute"', f'bodies = ["{ends[0]}", "{ends[1]}"]']
        lines += [f"at = [{x!r}, {y!r}, 0.0]", f"axis = [{float(np.sin(tilted))!r}, 0.0, {float(np.cos(tilted))!r}]"]
    return "\n".join(lines)


@lru_cache
def crank_angle(
    until: float,
    masses: tuple[float, float, float] = (1.0, 1.0, 1.0),
    inertia: float | None = None,
    rate: float = 0.0,
) -> float:
    """The crank's angle in rad after so many seconds: one freedom, its energy's equation in closed kinematics.

    Parameters
    ----------
    inertia
        Moment of each link about its middle in kg m²; of slender ones where None.
    rate
        Of the crank at the start in rad/s.
    """
    points, mass = np.array(list(PINS.values())), np.array(masses)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    spin = mass * lengths**2 / 12.0 if inertia is None else np.full(3, inertia)

    def angles(first: float) -> tuple[Array, Array, float, float]:
        tip = lengths[0] * np.array([np.cos(first), np.sin(first)])
        away = points[3] - tip
        far = float(np.linalg.norm(away))
        inner = np.arccos((lengths[1] ** 2 + far**2 - lengths[2] ** 2) / (2.0 * lengths[1] * far))
        second = np.arctan2(away[1], away[0]) + inner
        end = tip + lengths[1] * np.array([np.cos(second), np.sin(second)])
        return tip, end, second, np.arctan2(*(points[3] - end)[::-1])

    def rates(first: float) -> Array:
        """d(second, third) by d(first), from the derivative of the closed chain."""
        _, _, second, third = angles(first)
        columns = lengths * np.array(
            [[-np.sin(a) for a in (first, second, third)], [np.cos(a) for a in (first, second, third)]]
        )
        return np.array([1.0, *np.linalg.solve(columns[:, 1:], -columns[:, 0])])

    def reduced(first: float) -> float:
        _, _, second, _ = angles(first)
        by = rates(first)
        centre = 0.5 * lengths[1] * np.array([-np.sin(second), np.cos(second)]) * by[1]
        middle = lengths[0] * np.array([-np.sin(first), np.cos(first)]) + centre
        ends = mass[0] * lengths[0] ** 2 / 4.0 + mass[2] * (lengths[2] * by[2]) ** 2 / 4.0
        return float(spin @ by**2 + ends + mass[1] * middle @ middle)

    def potential(first: float) -> float:
        tip, end, _, _ = angles(first)
        return G * float(0.5 * mass[0] * tip[1] + 0.5 * mass[1] * (tip[1] + end[1]) + 0.5 * mass[2] * end[1])

    def slope(function: Callable[[float], float], x: float, h: float = 1e-4) -> float:
        return (8.0 * (function(x + h) - function(x - h)) - function(x + 2.0 * h) + function(x - 2.0 * h)) / (12.0 * h)

    def right(_: float, y: Array) -> tuple[float, float]:
        return y[1], -(slope(potential, y[0]) + 0.5 * slope(reduced, y[0]) * y[1] ** 2) / reduced(y[0])

    start = float(np.arctan2(*points[1][::-1]))
    return float(solve_ivp(right, (0.0, until), (start, rate), rtol=1e-10, atol=1e-12).y[0, -1])


def wired_poses() -> dict[str, Array]:
    """Poses of the bars of `wired` by name: middle and direction of each."""
    found: dict[str, Array] = {}
    for name, (one, two) in {"crank": "ab", "coupler": "bc", "rocker": "dc"}.items():
        start, end = np.array(PINS[one]), np.array(PINS[two])
        half = 0.5 * np.arctan2(*(end - start)[::-1])
        found[name] = np.array([np.cos(half), 0.0, 0.0, np.sin(half), *(0.5 * (start + end)), 0.0])
    return found


def wired() -> ephs.System:
    """The same four-bar, of round bodies, wired by hand."""

    def at(x: float) -> dict[str, list[float]]:
        return {"position": [x, 0.0, 0.0]}

    l1, l2, l3 = (0.5 * float(np.hypot(*np.subtract(PINS[two], PINS[one]))) for one, two in BODIES.values())
    bars = {name: tuple(end.replace("ground", "o") for end in ends) for name, ends in JOINTS.items()}
    frames = {"a": (at(0.0), at(-l1)), "b": (at(l1), at(-l2)), "c": (at(l2), at(l3)), "d": (at(1.2), at(-l3))}
    boxes = {name: {"p": f"p_{name}"} for name in (*BODIES, "o")}
    boxes |= {name: {"p1": f"p_{one}", "p2": f"p_{two}"} for name, (one, two) in bars.items()}
    pattern = Pattern(junctions={f"p_{n}": junction(quantity.body_momentum) for n in ("o", *BODIES)}, boxes=boxes)
    bodies = {name: rigid_body(1.0, [ROUND] * 3, gravity=[0.0, -G, 0.0]) for name in BODIES}
    fillings = bodies | {"o": ground()} | {n: joint("revolute", *frames[n]) for n in JOINTS}
    return ephs.System.of(pattern, fillings)


ADJUSTED = """
[assembly]
adjust = {adjust}
[world]
gravity = [0.0, -9.81, 0.0]
[bodies.crank]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [{x}, 0.4, 0.0]
[bodies.coupler]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.9, 0.95, 0.0]
[bodies.rocker]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [1.35, 0.55, 0.0]
[joints.a]
type = "revolute"
bodies = ["ground", "crank"]
frame1 = {{}}
frame2 = {{ position = [-0.15, -0.4, 0.0] }}
{crank}
[joints.b]
type = "revolute"
bodies = ["crank", "coupler"]
frame1 = {{ position = [0.15, 0.4, 0.0] }}
frame2 = {{ position = [-0.6, -0.15, 0.0] }}
[joints.c]
type = "revolute"
bodies = ["coupler", "rocker"]
frame1 = {{ position = [0.6, 0.15, 0.0] }}
frame2 = {{ position = [0.15, 0.55, 0.0] }}
[joints.d]
type = "revolute"
bodies = ["ground", "rocker"]
frame1 = {{ position = [1.2, 0.0, 0.0] }}
frame2 = {{ position = [-0.15, -0.55, 0.0] }}
{rocker}
"""
"""The same four-bar as a guess that assembling adjusts."""


def _tilted(tilt: float) -> Case:
    return Case(
        f"pin tilted {tilt:g}",
        f"one axis of a planar four-bar tilted by {tilt:g} rad",
        lambda: read(four_bar(tilt=tilt)),
        UNTIL,
        _placed,
        (0.002,),
        (1e-6,),
    )


def _placed(sol: ephs.Solution) -> float:
    return _crank_off(sol, 1.0, crank_angle(UNTIL))


def _crank_off(sol: ephs.Solution, size: float, angle: float) -> float:
    """Distance of the crank's middle from where it belongs, relative to the length of the crank."""
    length = float(np.hypot(*PINS["b"])) * size
    exact = 0.5 * length * np.array([np.cos(angle), np.sin(angle)])
    return float(np.linalg.norm(sol.body("crank").position[-1, :2] - exact)) / length


def _scaled(size: float) -> Case:
    return Case(
        f"size {size:g} m",
        f"a four-bar of {size:g} m",
        lambda: read(four_bar(size=size, gravity=G * size)),
        UNTIL,
        lambda sol: _crank_off(sol, size, crank_angle(UNTIL)),
        (0.005,),
        (1e-6,),
    )


def _heavy(which: int) -> Case:
    masses = tuple(1e10 if k == which else 1.0 for k in range(3))
    name = list(BODIES)[which]
    return Case(
        f"heavy {name}",
        f"a four-bar whose {name} weighs 10¹⁰ times the others",
        lambda: read(four_bar(masses)),
        UNTIL,
        lambda sol: _crank_off(sol, 1.0, crank_angle(UNTIL, (masses[0], masses[1], masses[2]))),
        (0.005,),
        (1e-6,),
    )


def _wired_off(sol: ephs.Solution) -> float:
    angle = crank_angle(UNTIL, inertia=ROUND)
    pose, length = sol["crank.pe.q"][-1], float(np.hypot(*PINS["b"]))
    return float(np.linalg.norm(pose[4:6] - 0.5 * length * np.array([np.cos(angle), np.sin(angle)]))) / length


def _given() -> dict[str, Array]:
    return {f"{name}.pe.q": pose for name, pose in wired_poses().items()}


def _open() -> dict[str, Array]:
    return _given() | {"coupler.pe.q": wired_poses()["coupler"] + np.array([0.0, 0.0, 0.0, 0.0, 0.3, -0.45, 0.0])}


CASES = (
    *map(_tilted, (1e-12, 1e-9, 1e-7, 1e-6)),
    *map(_scaled, (3e-9, 1e-6, 1e5)),
    *map(_heavy, range(3)),
    Case(
        "wired by hand",
        "a four-bar wired of bodies and joints, poses given, relative poses not",
        wired,
        UNTIL,
        _wired_off,
        (0.005,),
        (1e-6,),
        {"initial": _given()},
    ),
    Case(
        "wired and open",
        "the same with a pin open by 0.54 m",
        wired,
        UNTIL,
        _wired_off,
        (0.005,),
        (1e-6,),
        {"initial": _open()},
    ),
    Case(
        "guessed poses",
        "a crank whose rate is given, and its pose guessed wrong by 26 mm",
        lambda: read(ADJUSTED.format(adjust="true", x=0.176, crank="coordinate = 0.0\nrate = 6.0", rocker="")),
        0.1,
        lambda sol: _crank_off(sol, 1.0, crank_angle(0.1, inertia=ROUND, rate=6.0)),
        (0.001,),
        (1e-6,),
    ),
)
