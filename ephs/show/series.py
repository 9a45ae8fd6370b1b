"""Lines of a plot, made ready: units, thinning, few enough names."""

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

UNITS = {
    "displacement": "m",
    "momentum": "kg m/s",
    "angle": "rad",
    "angular_momentum": "kg m²/s",
    "charge": "C",
    "flux_linkage": "Wb",
    "entropy": "J/K",
    "volume": "m³",
    "amount": "mol",
    "pose": "1, m",
    "relative_pose": "rad, m",
    "temperature": "K",
}

# Freedoms of each kind of joint, in the order of their coordinates: an angle (True) or a length.
FREEDOMS = {
    "revolute": ("",),
    "prismatic": ("",),
    "screw": ("",),
    "cylindrical": ("angle", "distance"),
    "planar": ("angle", "x", "y"),
    "spherical": ("rx", "ry", "rz"),
    "free": ("rx", "ry", "rz", "x", "y", "z"),
    "universal": ("angle 1", "angle 2"),
    "fixed": (),
}
_LENGTHS = frozenset({"distance", "x", "y", "z"})


def is_length(kind: str, freedom: str) -> bool:
    """Whether a joint's coordinate is in metres; else it is in radians."""
    return kind == "prismatic" or freedom in _LENGTHS


def thinned(t: Array, values: Array, most: int = 2000) -> tuple[Array, Array]:
    """The same line with at most about `most` points, least and greatest values of each stretch kept."""
    if len(t) <= most:
        return t, values
    edges = np.linspace(0, len(t), most // 2 + 1).astype(int)
    kept: list[int] = [0]
    for first, last in itertools.pairwise(edges):
        piece = np.nan_to_num(values[first:last])
        kept += sorted({first + int(piece.argmin()), first + int(piece.argmax())})
    kept.append(len(t) - 1)
    index = np.unique(np.array(kept))
    return t[index], values[index]


def columns(name: str, values: Any) -> list[tuple[str, Array]]:
    """A state (n,) or (n, k) as named lines (n,)."""
    array = np.asarray(values, dtype=float)
    if array.ndim == 1:
        return [(name, array)]
    flat = array.reshape(len(array), -1)
    if flat.shape[1] == 1:
        return [(name, flat[:, 0])]
    return [(f"{name}[{k}]", flat[:, k]) for k in range(flat.shape[1])]


def quantity_kinds(sol: Any) -> dict[str, str]:
    """Kind of quantity of each state, by its path, as far as the system tells."""
    if sol.system is None:
        return {}
    pattern = sol.system.flatten().pattern
    return {
        ".".join([*map(str, box), *map(str, port)]): str(pattern.junctions[wire.junction].quantity.kind)
        for box, content in pattern.boxes.items()
        for port, wire in content.ports.items()
    }


def state_panels(sol: Any) -> dict[str, list[tuple[str, Array]]]:
    """The states of a solution, gathered into one panel for each kind of quantity and unit."""
    kinds = quantity_kinds(sol)
    panels: dict[str, list[tuple[str, Array]]] = {}
    for path, values in sol.states.items():
        name = str(path)
        kind = kinds.get(name, "state")
        array = np.asarray(values)
        unit = "kg m²/s, kg m/s" if kind == "momentum" and array.ndim > 1 else UNITS.get(kind, "SI unit")
        panels.setdefault(f"{kind.replace('_', ' ')} [{unit}]", []).extend(columns(name, values))
    return panels


def scene_panels(sol: Any) -> dict[str, list[tuple[str, Array]]]:
    """Joint angles and distances, positions of bodies and temperatures, one panel for each unit and direction."""
    scene = sol.scene
    panels: dict[str, list[tuple[str, Array]]] = {}
    for name, joint in scene.all_joints():
        coordinate = np.asarray(sol.joint(name).coordinate, dtype=float).reshape(len(sol.t), -1)
        freedoms = FREEDOMS.get(joint.kind, tuple(str(k) for k in range(coordinate.shape[1])))
        for freedom, column in zip(freedoms, coordinate.T, strict=False):
            panel = "joint distance [m]" if is_length(joint.kind, freedom) else "joint angle [rad]"
            panels.setdefault(panel, []).append((f"{name} {freedom}".strip(), column))
    for name, _ in scene.all_bodies():
        for axis, column in zip("xyz", np.asarray(sol.body(name).position, dtype=float).T, strict=True):
            panels.setdefault(f"position {axis} [m]", []).append((name, column))
    for name, _ in scene.all_thermal():
        panels.setdefault("temperature [K]", []).append((name, np.asarray(sol.thermal(name).temperature, dtype=float)))
    # A direction in which nothing moves is no news.
    return {title: lines for title, lines in panels.items() if not title.startswith("position") or _moves(lines)}


def _moves(lines: list[tuple[str, Array]]) -> bool:
    return any(float(np.ptp(values)) > 1e-9 * (1.0 + float(np.abs(values).max())) for _, values in lines if len(values))
