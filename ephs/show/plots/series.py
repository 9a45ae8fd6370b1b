"""Preparation of a plot's lines: units, thinning, number of names."""

import itertools
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.result.labels import Labels
from ephs.solve.result.temperatures import heated

MOVES = 1e-9
"""Least relative change of a drawn value."""
ANGLE = "joint angle [rad]"


def thinned(t: Array, values: Array, most: int = 2000) -> tuple[Array, Array]:
    """The same line with at most about `most` points; extremes of each interval are kept."""
    if len(t) <= most:
        return t, values
    edges = np.linspace(0, len(t), most // 2 + 1).astype(int)
    kept: list[int] = [0]
    for first, last in itertools.pairwise(edges):
        piece = np.nan_to_num(values[first:last])
        kept += sorted({first + int(piece.argmin()), first + int(piece.argmax())})
    kept.append(len(t) - 1)
    index = np.unique(np.concatenate([kept, np.flatnonzero(np.isnan(values))]))
    return t[index], values[index]


def quantity_kinds(sol: Any) -> dict[str, str]:
    """Kind of quantity of each state, by its path."""
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
        labels = sol.labels[path]
        kind = kinds.get(str(path), labels.dimension or "state").replace("_", " ")
        array = np.asarray(values, dtype=float).reshape(len(sol.t), -1)
        for k, column in enumerate(array.T):
            name = f"{path} {labels.names[k]}" if len(array.T) > 1 else str(path)
            panels.setdefault(f"{kind} [{labels.units[k]}]", []).append((name, column))
    return panels


def freedom_lines(
    freedoms: Mapping[str, Labels], places: Callable[[str], Any], read: Callable[[str], Any]
) -> Iterator[tuple[str, str, Array]]:
    """Name, unit and values (n,) of each degree of freedom of each joint, from ``read(joint)``, (n, d).

    ``places(joint)`` gives the coordinates, which say where a line has to be broken: there values are NaN.
    """
    for name, labels in freedoms.items():
        values = np.array(read(name), dtype=float)
        turning = [k for k, freedom in enumerate(labels.names) if freedom in ("rx", "ry", "rz")]
        if turning:  # rotation vectors are principal values: where they start anew, a line ends
            jumps = np.linalg.norm(np.diff(np.asarray(places(name), dtype=float)[:, turning], axis=0), axis=1) > np.pi
            values[1:][jumps] = np.nan
        for k, freedom in enumerate(labels.names):
            yield name if len(labels.names) == 1 else f"{name} {freedom}", labels.units[k], values[:, k]


def within_a_turn(angles: Array) -> Array:
    """Angles (n,) in rad, moved by whole turns to between −π and π; NaN where the line would jump."""
    turns = np.round(angles / (2.0 * np.pi))
    out = angles - 2.0 * np.pi * turns
    out[1:][np.diff(turns) != 0.0] = np.nan
    return out


def _turns(lines: list[tuple[str, Array]]) -> bool:
    """Whether an angle goes round more than once, so that its line would flatten the others."""
    return any(float(np.nanmax(np.abs(values), initial=0.0)) > 2.0 * np.pi for _, values in lines)


def motion_lines(sol: Any) -> dict[str, list[tuple[str, Array]]]:
    """Joint angles and distances, positions of bodies and temperatures, one panel for each unit and direction.

    If an angle exceeds a full turn, all angles are drawn between −π and π.
    """
    bodies = () if sol.outline is None else sol.outline.all_bodies()
    panels: dict[str, list[tuple[str, Array]]] = {}
    places: Callable[[str], Any] = lambda joint: sol.joint(joint).coordinate  # noqa: E731 - it is read twice
    for name, unit, column in freedom_lines(sol.freedoms, places, places):
        panel = "joint distance [m]" if unit == "m" else ANGLE
        panels.setdefault(panel, []).append((name, column))
    for name, _ in bodies:
        for axis, column in zip("xyz", np.asarray(sol.body(name).position, dtype=float).T, strict=True):
            panels.setdefault(f"position {axis} [m]", []).append((name, column))
    if angles := panels.get(ANGLE):
        panels[ANGLE] = [(name, within_a_turn(column)) for name, column in angles] if _turns(angles) else angles
    if warm := temperatures(sol):
        panels["temperature [K]"] = list(warm.items())
    # Constant directions are omitted.
    return {title: lines for title, lines in panels.items() if not title.startswith("position") or _moves(lines)}


def temperatures(sol: Any) -> dict[str, Array]:
    """(n,) temperatures in K of the thermal nodes of a scene, or of the storages of heat of a system."""
    if sol.scene is None:
        return heated(sol)
    return {name: np.asarray(sol.thermal(name).temperature, dtype=float) for name, _ in sol.scene.all_thermal()}


def _moves(lines: list[tuple[str, Array]]) -> bool:
    return any(
        float(np.ptp(values)) > MOVES * (1.0 + float(np.abs(values).max())) for _, values in lines if len(values)
    )
