"""Tables of sheets with tables inside for their grid, section and sides: the same with all keys on one level."""

from collections.abc import Mapping
from math import radians
from typing import Any, Final

from ephs.mechanics.scene.element import FREE_END

SIDES: Final = ("bottom", "right", "top", "left")
"""Sides of a grid, from the first corner to the second and so on."""
GRID, SECTION = frozenset({"corners", "elements"}), frozenset({"thickness", "E", "nu", "rho"})
PLY: Final[Mapping[str, str]] = {"G": "G12", "nu": "nu12"}
WAYS: Final[Mapping[str, bool]] = {"fixed": False, "revolute": True}
"""Joints along a side, and whether it is pinned then."""


def level_table(table: Any) -> Any:
    """The table of a sheet on one level; what is not spelled so stays, for the checks of its keys."""
    if not isinstance(table, Mapping):
        return table
    out: dict[str, Any] = dict(table)
    for inner, keys in (("grid", GRID), ("section", SECTION)):
        found = out.get(inner)
        if isinstance(found, Mapping) and found.keys() <= keys and not found.keys() & out.keys():
            out |= out.pop(inner)
    if "mesh" in out and "file" not in out:
        out["file"] = out.pop("mesh")
    if isinstance(out.get("layers"), list):
        out["layers"] = [_level_layer(layer) for layer in out["layers"]]
    edges = out.get("edges")
    if isinstance(edges, Mapping) and edges.keys() <= {*SIDES} and "pinned" not in out:
        joined = [_joined(edges.get(side, FREE_END)) for side in SIDES]
        if None not in joined:
            out["edges"], out["pinned"] = map(list, zip(*filter(None, joined), strict=True))
    return out


def _level_layer(layer: Any) -> Any:
    """A layer whose ``E`` has both directions with a number for each, and its angle in rad."""
    both = layer.get("E") if isinstance(layer, Mapping) else None
    if not isinstance(both, list) or len(both) != 2 or {"E1", "E2"} & layer.keys():
        return layer
    out: dict[str, Any] = {key: x for key, x in layer.items() if key != "E"} | {"E1": both[0], "E2": both[1]}
    for short, long in PLY.items():
        if short in out and long not in out:
            out[long] = out.pop(short)
    if isinstance(out.get("angle_deg"), int | float) and "angle" not in out:
        out["angle"] = radians(out.pop("angle_deg"))
    return out


def _joined(side: Any) -> tuple[str, bool] | None:
    """The body that a side is joined to, and whether pinned; None where that is not said so."""
    if isinstance(side, str):
        return side, False
    known = isinstance(side, Mapping) and side.keys() <= {"body", "joint"} and isinstance(side.get("body"), str)
    way = WAYS.get(str(side.get("joint", "fixed"))) if known else None
    return None if way is None else (side["body"], way)
