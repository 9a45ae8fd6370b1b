"""Families of scenes of any size: chains of bars with revolute or spherical joints, and rows of four-bar windows.

A chain of n bars of 1 m hangs from the ground with its first joint at 1 rad, the k-th at 0.3·cos(k) rad, at rest. Axes
of revolute joints lie alternately in y and x of the bar before, those of planar chains all in y. n windows are n + 1
upright cranks, n couplers on top, all of 1 m and 1 kg, that move at 1 m/s: they pass configurations in which their
constraints lose rank.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import NamedTemporaryFile, TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

import ephs
from ephs.mechanics.scene.model import Scene

__all__ = ["FAMILIES", "bodies", "named", "scene", "text", "write"]

Array = NDArray[np.float64]
LENGTH, WIDTH, DEPTH, MASS = 1.0, 0.1, 0.06, 1.0
"""Of a bar of the chains: along z, x, y in m; in kg."""
THICK = MASS * np.array([DEPTH**2 + LENGTH**2, WIDTH**2 + LENGTH**2, WIDTH**2 + DEPTH**2]) / 12.0
"""Its principal moments of inertia in kg m²."""
SLENDER = np.array([1.0 / 600.0, 1.0 / 12.0, 1.0 / 12.0])
"""Those of a link of the windows, whose long axis is x, in kg m²."""


def _numbers(values: Sequence[float] | Array) -> str:
    return "[" + ", ".join(repr(float(value)) for value in values) + "]"


def _head(name: str, gravity: Sequence[float]) -> list[str]:
    return ["format = 1", f'name = "{name}"', "", "[world]", f"gravity = {_numbers(gravity)}"]


def _body(
    name: str, inertia: Array, position: Sequence[float] | Array, quaternion: Sequence[float] | Array,
    velocity: Sequence[float] = (0.0, 0.0, 0.0), spin: Sequence[float] = (0.0, 0.0, 0.0),
) -> list[str]:  # fmt: skip
    return [
        "",
        f"[bodies.{name}]",
        f"mass = {MASS!r}",
        f"inertia = {_numbers(inertia)}",
        f"position = {_numbers(position)}",
        f"rotation = {_numbers(quaternion)}",
        f"velocity = {_numbers(velocity)}",
        f"angular_velocity = {_numbers(spin)}",
    ]


def _joint(number: int, kind: str, ends: tuple[str, str], at: Sequence[float] | Array, axis: Array | None) -> list[str]:
    lines = ["", f"[joints.j{number}]", f'type = "{kind}"', f'bodies = ["{ends[0]}", "{ends[1]}"]']
    return [*lines, f"at = {_numbers(at)}", *([] if axis is None else [f"axis = {_numbers(axis)}"])]


def _turned(q: Array, vector: Array) -> Array:
    """A vector in body axes as one in world axes."""
    w, u = q[0], q[1:]
    around = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
    return vector + 2.0 * around @ (around @ vector + w * vector)


def _product(p: Array, q: Array) -> Array:
    return np.concatenate([[p[0] * q[0] - p[1:] @ q[1:]], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


def _chain(kind: str, count: int, *, planar: bool = False) -> list[str]:
    lines = _head(f"{'planar' if planar else kind}-chain-{count}", (0.0, 0.0, -9.81))
    joints: list[str] = []
    q, end = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
    for k in range(count):
        own = np.array([1.0, 0.0, 0.0] if k % 2 and not planar else [0.0, 1.0, 0.0])
        axis = None if kind == "spherical" else _turned(q, own)
        half = 0.5 * (0.3 * np.cos(k) if k else 1.0)
        q = _product(q, np.concatenate([[np.cos(half)], np.sin(half) * own]))
        q /= np.linalg.norm(q)
        joints += _joint(k, kind, (f"rod{k - 1}" if k else "ground", f"rod{k}"), end, axis)
        down = _turned(q, np.array([0.0, 0.0, -LENGTH]))
        lines += _body(f"rod{k}", THICK, end + 0.5 * down, q)
        end = end + down
    return lines + joints


def _windows(count: int) -> list[str]:
    lines, joints = _head(f"four-bar-windows-{count}", (0.0, -9.81, 0.0)), list[str]()
    axis, upright = np.array([0.0, 0.0, 1.0]), np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    for k in range(count + 1):
        lines += _body(f"crank{k}", SLENDER, (k, 0.5, 0.0), upright, (0.5, 0.0, 0.0), (0.0, 0.0, -1.0))
        joints += _joint(k, "revolute", ("ground", f"crank{k}"), (k, 0.0, 0.0), axis)
    for k in range(count):
        lines += _body(f"coupler{k}", SLENDER, (k + 0.5, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
        for side in (0, 1):
            ends = (f"crank{k + side}", f"coupler{k}")
            joints += _joint(count + 1 + 2 * k + side, "revolute", ends, (k + side, 1.0, 0.0), axis)
    return lines + joints


FAMILIES: dict[str, Callable[[int], list[str]]] = {
    "revolute-chain": lambda count: _chain("revolute", count),
    "planar-chain": lambda count: _chain("revolute", count, planar=True),
    "spherical-chain": lambda count: _chain("spherical", count),
    "four-bar-windows": _windows,
}


def text(family: str, count: int) -> str:
    """A scene of a family as a scene file.

    Parameters
    ----------
    family
        A name of `FAMILIES`.
    count
        Bars of a chain, or windows.
    """
    return "\n".join(FAMILIES[family](count)) + "\n"


def bodies(family: str, count: int) -> int:
    """How many bodies the scene has."""
    return 2 * count + 1 if family == "four-bar-windows" else count


def scene(family: str, count: int) -> Scene:
    """A scene of a family, read from its file."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"{family}-{count}.toml"
        file.write_text(text(family, count), encoding="utf-8")
        return ephs.load(file)


def write(family: str, count: int) -> str:
    """A scene of a family as a file of its own for a while; its path. Who asks for it removes it."""
    with NamedTemporaryFile("w", suffix=".toml", delete=False, encoding="utf-8") as file:
        file.write(text(family, count))
    return file.name


def named(name: str) -> Scene:
    """A scene by its name: a shipped file's, or a family's with a number, ``revolute-chain-4``.

    Raises
    ------
    KeyError
        There is no such file and no such family.
    """
    shipped = Path(__file__).parent / "scenes" / f"{name}.toml"
    if shipped.is_file():
        return ephs.load(shipped)
    family, _, count = name.rpartition("-")
    return scene(family, int(count))
