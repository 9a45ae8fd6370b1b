"""Small models that run into trouble."""

import math
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import ephs
from ephs import Pattern, junction
from ephs import library as lib
from ephs import quantity as Q

_HEAD = 'format = 1\nname = "failing"\n'


def scene(text: str, world: str = "") -> ephs.Scene:
    """A scene from its text."""
    with TemporaryDirectory() as folder:
        file = Path(folder, "failing.toml")
        file.write_text(_HEAD + world + text)
        return ephs.load(file)


def pendulum(rate: float = 0.0, more: str = "") -> ephs.Scene:
    """A rod on a pin, turning at so many rad/s."""
    return scene(f"""
    [bodies.rod]
    mass = 1.0
    inertia = [0.1, 0.1, 0.01]
    position = [0.5, 0.0, 0.0]
    velocity = [0.0, 0.0, {-0.5 * rate}]
    angular_velocity = [0.0, {rate}, 0.0]
    [joints.pin]
    type = "revolute"
    bodies = ["ground", "rod"]
    at = [0.0, 0.0, 0.0]
    axis = [0.0, 1.0, 0.0]
    {more}
    """)


def slide(spring: str = "", velocity: float = 0.0) -> ephs.Scene:
    """A block on a rail, without weight."""
    return scene(
        f"""
    [bodies.block]
    mass = 1.0
    inertia = [0.1, 0.1, 0.1]
    position = [0.5, 0.0, 0.0]
    velocity = [{velocity}, 0.0, 0.0]
    [joints.rail]
    type = "prismatic"
    bodies = ["ground", "block"]
    at = [0.5, 0.0, 0.0]
    axis = [1.0, 0.0, 0.0]
    {spring}
    """,
        "[world]\ngravity = [0.0, 0.0, 0.0]\n",
    )


CORD = """
    [springs.cord]
    bodies = ["ground", "block"]
    at1 = [0.0, 0.0, 0.0]
    at2 = [0.0, 0.0, 0.0]
    stiffness = 1.0
    length = 0.1
"""


def four_bar(ground: float, right: str = "") -> ephs.Scene:
    """Two upright cranks of 1 m, the left one turned evenly, a coupler of 2 m, and so much ground between them."""
    bars = "".join(
        f"""
    [bodies.{name}]
    mass = 1.0
    inertia = [0.01, 0.1, 0.1]
    position = [{x}, {y}, 0.0]
    """
        for name, x, y in (("crank", 0.0, 0.5), ("coupler", 1.0, 1.0), ("rocker", 0.5 * (2.0 + ground), 0.5))
    )
    pins = "".join(
        f"""
    [joints.{name}]
    type = "revolute"
    bodies = {bodies}
    at = [{x}, {y}, 0.0]
    axis = [0.0, 0.0, 1.0]
    {more}
    """
        for name, bodies, x, y, more in (
            ("left", '["ground", "crank"]', 0.0, 0.0, "motion = { rate = 1.0 }"),
            ("knee", '["crank", "coupler"]', 0.0, 1.0, ""),
            ("hip", '["coupler", "rocker"]', 2.0, 1.0, ""),
            ("right", '["ground", "rocker"]', ground, 0.0, right),
        )
    )
    return scene("[assembly]\nadjust = true\n" + bars + pins)


def frame() -> ephs.Scene:
    """A frame without mass that turns freely."""
    return scene("""
    [bodies.frame]
    mass = 0.0
    inertia = [0.0, 0.0, 0.0]
    [joints.pin]
    type = "revolute"
    bodies = ["ground", "frame"]
    at = [0.0, 0.0, 0.0]
    axis = [0.0, 0.0, 1.0]
    """)


_OSCILLATOR = {"q": junction(Q.displacement), "p": junction(Q.momentum)}
_BOXES = {"pe": {"q": "q"}, "ke": {"p": "p"}, "pkc": {"q": "q", "p": "p"}}


def oscillator(energy: Callable[..., Any] | None = None, below: float = np.inf) -> ephs.System:
    """A mass on a spring of one's own, whose energy is a model below a length."""
    domain = {"q": (-np.inf, below)}
    spring = lib.spring(k=1.5) if energy is None else ephs.storage({"q": Q.displacement}, energy, domain=domain)
    return Pattern(_OSCILLATOR, _BOXES)(pe=spring, ke=lib.point_mass(m=1.0), pkc=lib.pkc())


def driven() -> ephs.System:
    """A mass on a spring, on which a force may act."""
    pattern = Pattern({**_OSCILLATOR, "p": junction(Q.momentum, exposed=True)}, _BOXES)
    return pattern(pe=lib.spring(k=1.5), ke=lib.point_mass(m=1.0), pkc=lib.pkc())


def driving() -> ephs.System:
    """A mass with friction that drives it at some speeds, which no search has found."""

    def brake(p: float, s: float) -> Any:
        d = 0.5 - 3.0 * math.exp(-(((float(p) ** 2 - 60.0625) / 0.45) ** 2))  # at 7.75 m/s, which is no number here
        return d * np.array([[s, -p], [-p, p * p / s]])

    pattern = Pattern(
        {"p": junction(Q.momentum), "s": junction(Q.entropy)},
        {"ke": {"p": "p"}, "mf": {"p": "p", "s": "s"}, "env": {"s": "s"}},
    )
    mf = ephs.irreversible({"p": Q.momentum, "s": Q.entropy}, brake)
    return pattern(ke=lib.point_mass(m=1.0), mf=mf, env=lib.environment())


def chilled() -> ephs.System:
    """A mass with friction, whose surroundings have a prescribed temperature."""
    pattern = Pattern(
        {"p": junction(Q.momentum), "s": junction(Q.entropy, exposed=True)},
        {"ke": {"p": "p"}, "mf": {"p": "p", "s": "s"}},
    )
    return pattern(ke=lib.point_mass(m=1.0), mf=lib.friction(d=0.1))


def cooled() -> ephs.System:
    """A body of 300 K whose energy is a model down to −2.9 J/K, from which entropy can be drawn."""
    hot = ephs.storage({"s": Q.entropy}, lambda s: 300.0 * s + 50.0 * s**2, domain={"s": (-2.9, np.inf)})
    return Pattern({"s": junction(Q.entropy, exposed=True)}, {"hot": {"s": "s"}})(hot=hot)


def cylinder() -> ephs.System:
    """A heavy piston between two gases."""
    pattern = Pattern(
        {n: junction(q) for n, q in (("v1", Q.volume), ("v2", Q.volume), ("p", Q.momentum), ("s1", Q.entropy))}
        | {"s2": junction(Q.entropy)},
        {
            "left": {"s": "s1", "v": "v1"}, "right": {"s": "s2", "v": "v2"}, "mass": {"p": "p"},
            "piston": {"v1": "v1", "v2": "v2", "p": "p"},
        },
    )  # fmt: skip
    gas = {"c1": 1.0, "c2": 1.0, "v0": 1.0, "c": 1.5}
    return pattern(
        left=lib.ideal_gas(**gas), right=lib.ideal_gas(**gas), mass=lib.point_mass(m=1.0), piston=lib.piston(a=1.0)
    )


def linked() -> ephs.System:
    """Two masses, rigidly linked."""
    pattern = Pattern(
        {"p": junction(Q.momentum), "r": junction(Q.momentum)},
        {"ke": {"p": "p"}, "other": {"p": "r"}, "link": {"p": "p", "p2": "r"}},
    )
    return pattern(ke=lib.point_mass(m=1.0), other=lib.point_mass(m=2.0), link=lib.rigid_link())


def doubled() -> ephs.System:
    """Two masses, rigidly linked twice."""
    pattern = Pattern(
        {"p": junction(Q.momentum), "r": junction(Q.momentum)},
        {"ke": {"p": "p"}, "other": {"p": "r"}, "link": {"p": "p", "p2": "r"}, "again": {"p": "p", "p2": "r"}},
    )
    link = lib.rigid_link()
    return pattern(ke=lib.point_mass(m=1.0), other=lib.point_mass(m=2.0), link=link, again=link)


def loose() -> ephs.System:
    """A link between two ends that nothing moves."""
    pattern = Pattern(
        {"p": junction(Q.momentum), "left": junction(Q.momentum), "right": junction(Q.momentum)},
        {"ke": {"p": "p"}, "link": {"p": "left", "p2": "right"}},
    )
    return pattern(ke=lib.point_mass(m=1.0), link=lib.rigid_link())


def beyond(q: Any) -> Any:
    """An energy that has no value beyond q = 1."""
    return -np.sqrt(1.0 - q)


def off(q: float) -> float:
    """An energy with a hole."""
    if q > 10.0:
        raise ZeroDivisionError("off the table")
    return 0.0


def truss(gravity: float = 9.81) -> ephs.Scene:
    """Two bars in line between two fixed pins, in gravity across them."""
    bars = [
        f"""
        [bodies.{name}]
        mass = 1.0
        inertia = [0.001, 0.08, 0.08]
        position = [{x}, 0.0, 0.0]
        """
        for name, x in (("left", 0.5), ("right", 1.5))
    ]
    pins = [
        f"""
        [joints.{name}]
        type = "revolute"
        bodies = [{first!r}, {second!r}]
        at = [{x}, 0.0, 0.0]
        axis = [0.0, 0.0, 1.0]
        """
        for name, first, second, x in (
            ("start", "ground", "left", 0.0), ("middle", "left", "right", 1.0), ("end", "right", "ground", 2.0),
        )
    ]  # fmt: skip
    return scene("".join([*bars, *pins]), f"[world]\ngravity = [0.0, {-gravity}, 0.0]\n")
