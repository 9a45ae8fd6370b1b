"""Light pictures for the gallery: bodies as shaded boxes and cylinders, moving, as an SVG of some ten kilobytes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.show.motions.overlays import tint

FRAMES = 50
INKS = ("#4c78a8", "#e0912f", "#5f9e6e", "#b0557a", "#7a6fb0", "#8a8a3c", "#3d9aa8", "#a86b4c", "#6b7280")
GROUND, PIN = "#c8ccd2", "#222222"
SIDES = 14  # of a cylinder


@final
@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Where one looks from: azimuth and elevation in degrees, z upwards."""

    azimuth: float = -60.0
    elevation: float = 22.0

    def axes(self) -> np.ndarray:
        """Rows: right, up, and towards the eye, in the world."""
        a, e = np.radians([self.azimuth, self.elevation])
        eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return np.array([right, np.cross(eye, right), eye])


def turned(quaternion: np.ndarray) -> np.ndarray:
    """Rotations (n, 3, 3) of unit quaternions (n, 4), scalar first."""
    w, x, y, z = quaternion.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def faces(shape: Mapping[str, Any]) -> list[np.ndarray]:
    """Faces of a shape in its body, each (k, 3), corners counter-clockwise from outside."""
    at = np.array(shape.get("position", [0.0, 0.0, 0.0]))
    turn = turned(np.array([shape.get("rotation", [1.0, 0.0, 0.0, 0.0])]))[0]
    return [face @ turn.T + at for face in _centred(shape)]


def _centred(shape: Mapping[str, Any]) -> list[np.ndarray]:
    if "box" in shape:
        low, high = -0.5 * np.array(shape["box"]), 0.5 * np.array(shape["box"])
        found = []
        for axis in range(3):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            for side in (low, high):
                corners = np.zeros((4, 3))
                corners[:, axis] = side[axis]
                corners[:, a] = np.array([low[a], high[a], high[a], low[a]])
                corners[:, b] = np.array([low[b], low[b], high[b], high[b]])
                found.append(corners if side is high else corners[::-1])
        return found
    radius, length = shape["cylinder"] if "cylinder" in shape else (shape["sphere"], 1.4 * shape["sphere"])
    turn = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    ring = radius * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    half = np.array([0.0, 0.0, length / 2])
    top, foot = ring + half, ring - half
    sides = [np.array([foot[k], foot[k - SIDES + 1], top[k - SIDES + 1], top[k]]) for k in range(SIDES)]
    return [top, foot[::-1], *sides]


def moving(
    bodies: Sequence[tuple[np.ndarray, Mapping[str, Any]]],
    lines: Sequence[np.ndarray] = (),
    dots: Sequence[np.ndarray] = (),
    links: Sequence[np.ndarray] = (),
    *,
    view: View | None = None,
    seconds: float = 2.0,
    width: int = 460,
) -> str:
    """An SVG that moves by itself.

    Parameters
    ----------
    bodies
        Poses (n, 7) and shape of each.
    lines, dots, links
        Polylines (n, k, 3), points (n, 3), and polylines that lie behind the bodies, in the world.
    """
    axes = (view or View()).axes()
    n = len(bodies[0][0])
    frames = np.unique(np.linspace(0, n - 1, min(n, FRAMES)).astype(int))
    drawn: list[tuple[float, np.ndarray, str, str]] = []  # depth, (frames, k, 2), fill, stroke
    for number, (poses, shape) in enumerate(bodies):
        rotation, at = turned(poses[frames, :4]), poses[frames, 4:]
        ink = INKS[number % len(INKS)]
        for face in faces(shape):
            there = np.einsum("nij,kj->nki", rotation, face) + at[:, None, :]
            seen = there @ axes.T
            edge1, edge2 = seen[:, 1] - seen[:, 0], seen[:, 2] - seen[:, 1]
            facing = edge1[:, 0] * edge2[:, 1] - edge1[:, 1] * edge2[:, 0] > 0.0
            flat = seen[:, :, :2].copy()
            flat[~facing] = flat[~facing].mean(axis=1, keepdims=True)  # what is turned away is drawn as a point
            normal = np.cross(there[:, 1] - there[:, 0], there[:, 2] - there[:, 1])
            normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-30
            light = normal[facing] @ np.array([0.25, -0.35, 0.9]) if facing.any() else np.zeros(1)
            drawn.append((float((at @ axes[2]).mean()), flat, _shaded(ink, float(light.mean())), "#2b2f36"))
    drawn.sort(key=lambda entry: entry[0])
    tracks = [(line[frames] @ axes.T)[..., :2] for line in lines]
    points = [(dot[frames] @ axes.T)[..., :2] for dot in dots]
    whole = np.concatenate([x.reshape(-1, 2) for x in (*(d[1] for d in drawn), *tracks, *points)])
    low, high = whole.min(axis=0), whole.max(axis=0)
    margin = 0.05 * max(high - low)
    low, high = low - margin, high + margin
    scale = min(width / (high[0] - low[0]), 300.0 / (high[1] - low[1]))
    size = scale * (high - low)

    def placed(flat: np.ndarray) -> np.ndarray:
        return np.stack([scale * (flat[..., 0] - low[0]), scale * (high[1] - flat[..., 1])], axis=-1)

    parts = [_polyline(placed((link[frames] @ axes.T)[..., :2]), seconds) for link in links]
    parts += [_polygon(placed(flat), fill, stroke, seconds) for _, flat, fill, stroke in drawn]
    parts += [_polyline(placed(track), seconds) for track in tracks]
    parts += [_circle(placed(dot), seconds) for dot in points]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size[0]:.0f} {size[1]:.0f}"'
    return f'{head} width="{size[0]:.0f}" height="{size[1]:.0f}">{"".join(parts)}</svg>'


def moving_scene(sol: Any, view: View | None = None) -> str:
    """The motion of a solution with a scene: bodies with a shape, springs as lines, joints as dots."""
    scene = sol.scene
    bodies = []
    for name, body in scene.all_bodies():
        motion = sol.body(name)
        for shape in body.shapes or filter(None, [body.shape]):
            bodies.append((np.hstack([motion.quaternion, motion.position]), shape))
    ends = [
        np.stack([_point(sol, s.bodies[0], s.at1), _point(sol, s.bodies[1], s.at2)], axis=1)
        for _, s in scene.all_springs()
    ]
    joints = [(j, _point(sol, j.body2, j.frame2[4:])) for _, j in scene.all_joints()]
    links = [
        np.stack([at, sol.body(name).position], axis=1)
        for j, at in joints
        for name in (j.body1, j.body2)
        if name != "ground"
    ]
    return moving(bodies, ends, [at for _, at in joints], links, view=view, seconds=float(sol.t[-1] - sol.t[0]))


def sliding(place: np.ndarray, size: Sequence[float], *, seconds: float, walls: Sequence[float], springs: bool) -> str:
    """A block at x = place (n,) between walls, from which springs run to it."""
    n = len(place)
    still = np.zeros((n, 7))
    still[:, 0] = 1.0
    block = still.copy()
    block[:, 4] = place
    bodies: list[tuple[np.ndarray, Mapping[str, Any]]] = [(block, {"box": size})]
    lines = []
    for wall in walls:
        post = still.copy()
        post[:, 4] = wall
        bodies.append((post, {"box": [0.06 * size[0], size[1] * 1.4, size[2] * 1.4]}))
        if not springs:
            continue
        turns = np.array([0.0, *np.linspace(0.06, 0.94, 23), 1.0])
        side = np.sign(place[0] - wall) * 0.5 * size[0]
        x = wall + (place[:, None] - side - wall) * turns
        z = 0.2 * size[2] * np.array([0.0, 0.0, *([1.0, -1.0] * 10), 1.0, 0.0, 0.0])
        lines.append(np.stack([x, 0.0 * x, np.broadcast_to(z, x.shape)], axis=-1))
    return moving(bodies, lines, view=View(-75.0, 18.0), seconds=seconds)


def bending(
    places: np.ndarray, cells: np.ndarray, values: np.ndarray, said: str, unit: str, *, view: View, seconds: float
) -> str:
    """A shell whose faces (k, 4) have the colours of values (n, k), at places (n, m, 3), with a bar of the colours.

    The far faces are drawn first, in the order of the first frame.
    """
    seen = places @ view.axes().T
    corners = seen[:, cells]
    flat = corners[..., :2]
    low, high = flat.min(axis=(0, 1, 2)), flat.max(axis=(0, 1, 2))
    scale = min(480.0 / (high[0] - low[0]), 260.0 / (high[1] - low[1]))
    shown = np.stack([10.0 + scale * (flat[..., 0] - low[0]), 10.0 + scale * (high[1] - flat[..., 1])], axis=-1)
    wide, tall = 20.0 + scale * (high - low)
    inks = ["#{:02x}{:02x}{:02x}".format(*tint(share)) for share in np.linspace(0.0, 1.0, 65)]
    shares = np.rint(64.0 * values / values.max()).astype(int)
    parts = [
        _polygon(shown[:, k], inks[shares[0, k]], "#2b2f36", seconds, [inks[share] for share in shares[:, k]])
        for k in np.argsort(corners[0, :, :, 2].mean(axis=1))
    ]
    stops = "".join(f'<stop offset="{k / 8:g}" stop-color="{inks[8 * k]}"/>' for k in range(9))
    left, style = 0.5 * wide - 60.0, 'font-family="system-ui,sans-serif" font-size="12" fill="#1a1a1a"'
    parts.append(f'<defs><linearGradient id="bar">{stops}</linearGradient></defs>')
    parts.append(f'<rect x="{left:.0f}" y="{tall + 6:.0f}" width="120" height="10" fill="url(#bar)"/>')
    words = ((left - 6.0, "end", f"{said} 0"), (left + 126.0, "start", f"{values.max():.3g} {unit}"))
    parts += [
        f'<text x="{x:.0f}" y="{tall + 15:.0f}" text-anchor="{at}" {style}>{text}</text>' for x, at, text in words
    ]
    size = f'viewBox="0 0 {wide:.0f} {tall + 24:.0f}" width="{wide:.0f}" height="{tall + 24:.0f}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{"".join(parts)}</svg>'


def _point(sol: Any, body: str, at: np.ndarray) -> np.ndarray:
    if body == "ground":
        return np.broadcast_to(np.asarray(at, dtype=float), (len(sol.t), 3))
    return sol.point(body, at)


def _shaded(ink: str, light: float) -> str:
    base = np.array([int(ink[k : k + 2], 16) for k in (1, 3, 5)])
    colour = base + (255 - base) * 0.45 * max(light, 0.0) - base * 0.25 * max(-light, 0.0)
    return "#" + "".join(f"{int(c):02x}" for c in np.clip(colour, 0, 255))


def _values(frames: Sequence[str], seconds: float, name: str) -> str:
    """The animation of an attribute, or nothing where it stands still."""
    if all(frame == frames[0] for frame in frames):
        return ""
    values = ";".join(frames)
    return (
        f'<animate attributeName="{name}" calcMode="discrete" dur="{seconds:g}s" repeatCount="indefinite" '
        f'values="{values}"/>'
    )


def _words(points: np.ndarray) -> list[str]:
    return [" ".join(f"{x:.1f},{y:.1f}" for x, y in frame) for frame in points]


def _polygon(points: np.ndarray, fill: str, stroke: str, seconds: float, fills: Sequence[str] = ()) -> str:
    frames, turning = _words(points), _values(fills, seconds, "fill") if fills else ""
    style = f'fill="{fill}" stroke="{stroke}" stroke-width="0.7" stroke-linejoin="round"'
    return f'<polygon points="{frames[0]}" {style}>{_values(frames, seconds, "points")}{turning}</polygon>'


def _polyline(points: np.ndarray, seconds: float) -> str:
    frames = _words(points)
    style = 'fill="none" stroke="#4b5563" stroke-width="1.6" stroke-linejoin="round"'
    return f'<polyline points="{frames[0]}" {style}>{_values(frames, seconds, "points")}</polyline>'


def _circle(points: np.ndarray, seconds: float) -> str:
    x, y = ([f"{v:.1f}" for v in column] for column in points.T)
    moves = _values(x, seconds, "cx") + _values(y, seconds, "cy")
    return f'<circle cx="{x[0]}" cy="{y[0]}" r="2.6" fill="{PIN}">{moves}</circle>'
