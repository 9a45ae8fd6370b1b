"""A player of motions for pages without WebGL: shaded polygons on a canvas, from data in the page."""

import base64
import html
import json
from collections.abc import Callable, Iterable
from typing import Any, Final

import numpy as np

from ephs.mechanics.scene.model import Joint
from ephs.show.motions.motion import Array, best_side, rotate
from ephs.show.motions.overlays import GROUND, tint
from ephs.show.motions.solids import Solid, box, cylinder, held_at, sphere
from ephs.show.motions.stage import Stage
from ephs.show.motions.symbols import JOINTS, METAL, MUTED, half_axis, ink
from ephs.show.shared.page import asset

MOST_FACES = 1500
"""Faces of a body above which its convex hull is drawn."""
LONGEST = 0.35
"""Length of the longest arrow, in parts of the mechanism's size."""


_SOLIDS: Final[dict[str, Callable[[Array], Any]]] = {
    "cylinder": lambda sides: cylinder(*sides),
    "box": box,
    "sphere": lambda sides: sphere(*sides),
}


def player(stage: Stage, title: str, height: str = "30rem") -> str:
    """A canvas with play, pause, speed, time bar, orbit, zoom and follow, as a part of a page.

    Parameters
    ----------
    title
        Name for screen readers.
    height
        Of the canvas, in the words of CSS.
    """
    data = json.dumps(_data(stage), ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
    return (
        f"<style>{asset('player.css')}</style>"
        f'<div class="player" style="height:{height}" role="img" aria-label="{html.escape(title)}">'
        f'<script type="application/json">{data}</script></div><script>{asset("player.js")}</script>'
    )


def _data(stage: Stage) -> dict[str, Any]:
    size = stage.size()
    names = list(stage.bodies)
    points, reaches = stage.places()
    ball = reaches[None, :, None]
    middle = 0.5 * ((points - ball).min(axis=1) + (points + ball).max(axis=1))
    low = float((points[:, :, 2] - reaches).min()) - 0.02 * size
    poses = np.stack([stage.frames.poses[name] for name in names], axis=1) if names else np.zeros((1, 0, 7))
    return {
        "times": _text(stage.frames.times),
        "pause": stage.frames.pause,
        "names": names,
        "poses": _text(poses),
        "middle": _text(middle),
        "radius": float((np.linalg.norm(points - middle[:, None], axis=2) + reaches).max()),
        "size": size,
        "low": low,
        "way": best_side(points.reshape(-1, 3)).tolist(),
        "solids": [_solid(k, name, stage, size) for k, name in enumerate(names) if name in stage.solids]
        + [part for name, joint in stage.joints.items() for part in _symbol(name, joint, names, stage, size)],
        "sheets": [
            {
                "ends": _ends(sheet.ends, names), "faces": sheet.cells.tolist(), "shell": name,
                "colour": list(ink(len(stage.solids) + k)),
            }
            for k, (name, sheet) in enumerate(stage.sheets.items())
        ],
        "springs": [_spring(spring, names) for spring in stage.springs.values()],
        "arrows": _arrows(stage, size),
        "shades": _shades(stage),
    }  # fmt: skip


def _solid(index: int, name: str, stage: Stage, size: float) -> dict[str, Any]:
    solid = stage.solids[name]
    vertices, faces = _few(solid)
    if not faces:
        vertices, faces = sphere(0.012 * size)
    at = [
        stick for point in held_at(name, stage.joints.values(), stage.springs.values()) if (stick := solid.stick(point))
    ]
    colour = MUTED if solid.kind == "stand-in" else ink(index)
    return _entry(index, vertices, faces, colour, heat=name, own=True, sticks=[[*a, *b] for a, b in at])


def _few(solid: Solid) -> tuple[Array, Any]:
    """Vertices and faces, of the convex hull where there are too many."""
    if len(solid.faces) <= MOST_FACES:
        return solid.vertices, solid.faces
    from scipy.spatial import ConvexHull

    hull = ConvexHull(solid.vertices)
    used = np.unique(hull.simplices)
    corners = solid.vertices[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * hull.equations[:, :3]).sum(axis=1) < 0.0
    turned = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
    return solid.vertices[used], list(np.searchsorted(used, turned))


def _symbol(name: str, joint: Joint, names: list[str], stage: Stage, size: float) -> list[dict[str, Any]]:
    """The symbol of a joint on body 1, its axis along z of frame C1."""
    r = stage.symbol_size(joint, size)
    shapes = [_SOLIDS[shape](r * np.array(sides)) for _, shape, sides, *_ in JOINTS.get(joint.kind, ())]
    frame = np.asarray(joint.frame1, dtype=float)
    body = -1 if joint.body1 == GROUND else names.index(joint.body1)
    half = half_axis(joint.kind)
    ends = np.array([[0.0, 0.0, -half * r], [0.0, 0.0, half * r]])
    axis = (frame[4:] + rotate(frame[:4], ends)).ravel().tolist()
    return [
        _entry(
            body,
            frame[4:] + rotate(frame[:4], vertices),
            faces,
            METAL,
            heat=joint.heat,
            axis=None if k or not half else axis,
            label="" if k else name,
            place=frame[4:].tolist(),
        )
        for k, (vertices, faces) in enumerate(shapes)
    ]


def _entry(body: int, vertices: Array, faces: Any, colour: Any, **more: Any) -> dict[str, Any]:
    flat = [[int(corner) for corner in face] for face in faces]
    return {"body": body, "vertices": _text(vertices), "faces": flat, "colour": list(colour), **more}


def _spring(spring: Any, names: list[str]) -> dict[str, Any]:
    ends = ((spring.body1, spring.at1), (spring.body2, spring.at2))
    return {
        "ends": _ends(ends, names),
        "heat": spring.heat,
        "coiled": spring.coiled,
    }


def _ends(ends: Iterable[tuple[str, Any]], names: list[str]) -> list[Any]:
    """Number of a body, −1 for the ground, and place in it, of each end."""
    numbers = {GROUND: -1} | {name: k for k, name in enumerate(names)}
    return [[numbers[body], np.asarray(at, dtype=float).tolist()] for body, at in ends]


def _arrows(stage: Stage, size: float) -> list[dict[str, Any]]:
    """Forces and moments, the longest of each of the same length."""
    return [
        {"from": _text(a.places), "to": _text(a.tips(LONGEST * size)), "colour": list(a.colour), "label": a.label}
        for a in (() if stage.loads is None else stage.loads.arrows)
    ]


def _shades(stage: Stage) -> dict[str, Any]:
    shares = {name: _text(each.shares(row)) for each in stage.shades for name, row in each.values.items()}
    faces = {name: _text(each.shares(rows)) for each in stage.shades for name, rows in each.faces.items()}
    bars = [{"said": each.said, "ends": each.ends} for each in stage.shades]
    return {"shares": shares, "faces": faces, "scale": [list(tint(k / 64)) for k in range(65)], "bars": bars}


def _text(values: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")
