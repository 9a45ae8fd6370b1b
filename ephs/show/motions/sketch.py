"""Schematic of a mechanism: shaded bodies, symbols of joints, springs and tendons, a scale bar, as marks in a plane.

Marks are polygons and lines in metres; matplotlib or an SVG file draws them.
"""

import math
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from ephs.show.motions.lines import lines_of
from ephs.show.motions.motion import Array, best_side, point_of, rotate
from ephs.show.motions.overlays import Tones
from ephs.show.motions.sheets import DrawnShell, normals, sheets_of
from ephs.show.motions.solids import Solid, coarse, held_at, solids_of
from ephs.show.motions.symbols import MUTED, Colour, ink
from ephs.show.shared.palette import GREY, INK, PAPER

GROUND = "ground"
ROUND = 28
"""Corners of a circle."""
DOTS = 200
"""Dots across a schematic, which fine meshes are drawn with."""
_LIGHT = np.array([0.35, 0.5, 0.8])  # to the right, up, towards the eye
_SMOOTH = math.cos(math.radians(25.0))
_STILL = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


@final
@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """A line, or a polygon where it has a fill.

    Attributes
    ----------
    points : (n, 2)
        In m, y upwards.
    stroke, fill : colour of matplotlib
        Of the line and the area; `fill` None leaves the line open.
    width : float
        Of the line, in points.
    dashes : tuple of float
        Lengths of dashes and gaps, in widths; empty for a solid line.
    """

    points: Array
    stroke: Any
    width: float
    fill: Any = None
    dashes: tuple[float, ...] = ()


@final
@dataclass(frozen=True, slots=True, eq=False)
class SketchLabel:
    """A name at a point (2,) in m, its letters' height in points, its colour; `fixed` names stay at their point."""

    at: Array
    text: str
    letter: float
    colour: str
    fixed: bool = False


@final
@dataclass(frozen=True, slots=True, eq=False)
class Sketch:
    """Marks in drawing order, names, and points to keep free of names."""

    marks: list[Mark] = field(default_factory=list)
    words: list[SketchLabel] = field(default_factory=list)
    taken: list[Array] = field(default_factory=list)

    def line(self, points: Any, width: float, stroke: Any = INK, dashes: tuple[float, ...] = ()) -> None:
        """Add a line."""
        self.marks.append(Mark(np.asarray(points, dtype=float), stroke, width, None, dashes))

    def area(self, points: Any, width: float, fill: Any, stroke: Any = INK) -> None:
        """Add a polygon."""
        self.marks.append(Mark(np.asarray(points, dtype=float), stroke, width, fill))

    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest coordinates (2,) of the marks."""
        points = np.concatenate([mark.points for mark in self.marks])
        return points.min(axis=0), points.max(axis=0)


def sketch(
    scene: Any,
    poses: dict[str, Array],
    way: Array | None = None,
    extent: float | None = None,
    tones: Tones | None = None,
) -> Sketch:
    """The schematic of a mechanism, seen from far off.

    Parameters
    ----------
    poses
        (7,) of each body.
    way
        (3,) from the mechanism to the eye; by default the side on which its places are seen best.
    extent
        Of the mechanism in m, for the size of symbols, in frames of a film: these have no names and no scale bar. By
        default it is that of the mechanism at these poses.
    tones
        Colours of bodies and shells.
    """
    out = Sketch()
    shown = Tones((), 0) if tones is None else tones
    joints, springs = dict(scene.all_joints()), lines_of(scene)
    solids, sheets = solids_of(scene), sheets_of(scene)
    ends = {name: _ends(spring, poses) for name, spring in springs.items()}
    places = {name: point_of(poses.get(j.body1, _STILL), np.asarray(j.frame1)[4:]) for name, j in joints.items()}
    corners = [poses[name][4:] + rotate(poses[name][:4], solid.vertices) for name, solid in solids.items()]
    faces = [sheet.places(poses) for sheet in sheets.values()]
    points = [*corners, *faces, *(np.array(e) for e in ends.values()), *(p[None] for p in places.values())]
    cloud = np.concatenate(points)
    view = _view(best_side(cloud) if way is None else way)
    size = extent or float(np.linalg.norm(np.ptp(cloud @ view[:, :2], axis=0))) or 1.0
    order = np.argsort([float((at @ view[:, 2]).mean()) for at in (*corners, *faces)], kind="stable")
    for k in order:  # the far ones first
        if k >= len(solids):
            name, sheet = list(sheets.items())[k - len(solids)]
            _draw_sheet(out, sheet, faces[k - len(solids)] @ view, shown.faces(name), ink(int(k)))
            continue
        name, solid = list(solids.items())[k]
        tone = np.array(shown.of(name, MUTED if solid.kind == "stand-in" else ink(int(k)))) / 255.0
        sides, colours, edges = _surface(coarse(solid, size / DOTS), corners[k] @ view, 0.4 + 0.6 * tone)
        for point in held_at(name, joints.values(), springs.values()):
            if stick := solid.stick(point):
                across = (poses[name][4:] + rotate(poses[name][:4], np.array(stick))) @ view
                out.line(across[:, :2], 2.0, 0.75 * tone)
        for side, colour in zip(sides, colours, strict=True):
            out.area(side, 0.4, colour, colour)
        for edge in edges:
            out.line(edge, 0.7)
    for name, (start, end) in ends.items():
        radius = 0.018 * size * springs[name].coiled
        out.line(np.column_stack(_coil(start @ view, end @ view, radius)), 1.0)
    for draw in (_supports, _symbol):
        for name, joint in joints.items():
            frame = np.asarray(joint.frame1)
            axis = rotate(poses.get(joint.body1, _STILL)[:4], rotate(frame[:4], np.array([0.0, 0.0, 1.0])))
            if joint.kind != "free":
                draw(out, joint, places[name] @ view, axis @ view, 0.022 * size)
    if extent is None:
        _bar(out, cloud @ view, size)
        told = {name: poses[name][4:] @ view for name in solids}
        _names(out, told, {n: p @ view for n, p in places.items()}, size)
    return out


def _view(way: Array) -> Array:
    """(3, 3) columns: to the right, up, towards the eye."""
    up = np.array([0.0, 0.0, 1.0]) if abs(way[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, way)
    right = right / np.linalg.norm(right)
    return np.column_stack([right, np.cross(way, right), way])


def _surface(solid: Solid, at: Array, colour: Array) -> tuple[list[Array], list[Any], list[Array]]:
    """Visible faces, the far ones first, their shades, and the edges at bends and ends of the surface."""
    beside: dict[tuple[int, int], list[Array]] = {}
    shown: list[tuple[float, Array, Any]] = []
    light = _LIGHT / np.linalg.norm(_LIGHT)
    for face in solid.faces:
        normal = np.cross(at[face[1]] - at[face[0]], at[face[2]] - at[face[1]])
        length = float(np.linalg.norm(normal))
        if length == 0.0:
            continue
        normal = normal / length
        for a, b in zip(face, np.roll(face, -1), strict=True):
            beside.setdefault((min(a, b), max(a, b)), []).append(normal)
        if normal[2] > 0.0:
            shade = np.clip(colour * (0.74 + 0.3 * max(0.0, float(normal @ light))), 0.0, 1.0)
            shown.append((float(at[face, 2].mean()), at[face, :2], shade))
    shown.sort(key=lambda entry: entry[0])
    edges: list[Array] = []
    for (a, b), beyond in beside.items():
        seen = [n[2] > 0.0 for n in beyond]
        bent = len(beyond) == 2 and float(beyond[0] @ beyond[1]) < _SMOOTH
        if any(seen) and (not all(seen) or bent or len(beyond) == 1):
            edges.append(at[[a, b], :2])
    return [face for _, face, _ in shown], [shade for _, _, shade in shown], edges


def _draw_sheet(out: Sketch, sheet: DrawnShell, at: Array, colours: list[Colour] | None, own: Colour) -> None:
    """The faces of a shell, the far ones first: shaded, or less so in colours that mean something."""
    corner = at[sheet.cells]
    normal = normals(corner)
    length = np.linalg.norm(normal, axis=1)
    light = np.abs(normal @ (_LIGHT / np.linalg.norm(_LIGHT))) / np.where(length > 0.0, length, 1.0)
    tones = 0.4 + 0.6 * np.array(own)[None] / 255.0 if colours is None else np.array(colours) / 255.0
    deep = 0.4 if colours is None else 0.15
    shades = tones * (1.0 - deep + deep * light[:, None])
    for k in np.argsort(corner[..., 2].mean(axis=1), kind="stable"):
        out.area(corner[k, :, :2], 0.5, shades[k], 0.7 * shades[k])


def _ends(spring: Any, poses: dict[str, Array]) -> tuple[Array, Array]:
    start = point_of(poses.get(spring.body1, _STILL), np.asarray(spring.at1, dtype=float))
    return start, point_of(poses.get(spring.body2, _STILL), np.asarray(spring.at2, dtype=float))


def _coil(start: Array, end: Array, radius: float) -> tuple[Array, Array]:
    """A zigzag from point to point of the picture."""
    along = end[:2] - start[:2]
    length = float(np.linalg.norm(along)) or 1.0
    across = np.array([-along[1], along[0]]) / length * radius
    part = np.concatenate([[0.0], np.linspace(0.15, 0.85, 15), [1.0]])
    side = np.concatenate([[0.0, 0.0], np.tile([1.0, -1.0], 7)[:13], [0.0, 0.0]])
    points = start[:2] + part[:, None] * along + side[:, None] * across
    return points[:, 0], points[:, 1]


def _supports(out: Sketch, joint: Any, place: Array, axis: Array, r: float) -> None:
    """Axis of a joint, and hatching for a joint on the ground."""
    x, y, flat = place[0], place[1], float(np.hypot(axis[0], axis[1]))
    if joint.kind not in ("spherical", "fixed") and flat > 0.2:
        reach = 3.0 * r * axis[:2]
        out.line([place[:2] - reach, place[:2] + reach], 0.9, dashes=(6.0, 1.5, 1.0, 1.5))
    if GROUND in (joint.body1, joint.body2):
        base = y - 2.6 * r
        out.line(
            [[x - 0.6 * r, y - 0.8 * r], [x - 1.4 * r, base], [x + 1.4 * r, base], [x + 0.6 * r, y - 0.8 * r]], 0.9
        )
        ticks = np.linspace(x - 1.6 * r, x + 1.6 * r, 6)
        for tick in ticks:
            out.line([[tick, base], [tick - 0.6 * r, base - 0.7 * r]], 0.7)
        out.line([[ticks[0], base], [ticks[-1], base]], 0.9)


def _symbol(out: Sketch, joint: Any, place: Array, axis: Array, r: float) -> None:
    """Symbol of a joint: a circle where it turns, a rectangle where it slides."""
    flat = float(np.hypot(axis[0], axis[1]))
    if joint.kind in ("prismatic", "cylindrical", "fixed", "planar"):
        angle = math.atan2(axis[1], axis[0]) if flat > 0.2 else 0.0
        long, wide = (3.2 * r, 1.7 * r) if flat > 0.2 and joint.kind != "fixed" else (1.7 * r, 1.7 * r)
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        corners = 0.5 * np.array([[-long, -wide], [long, -wide], [long, wide], [-long, wide]])
        out.area(place[:2] + corners @ turn, 1.1, INK if joint.kind == "fixed" else PAPER)
    if joint.kind not in ("prismatic", "fixed", "planar"):
        out.area(_circle(place, 0.62 * r if joint.kind == "cylindrical" else r), 1.1, PAPER)
    if joint.kind in ("spherical", "universal"):
        out.area(_circle(place, 0.45 * r), 0.5, INK)


def _circle(place: Array, radius: float) -> Array:
    turns = np.linspace(0.0, 2.0 * math.pi, ROUND, endpoint=False)
    return place[:2] + radius * np.column_stack([np.cos(turns), np.sin(turns)])


def _names(out: Sketch, bodies: dict[str, Array], joints: dict[str, Array], size: float) -> None:
    """Names of bodies, and of joints, of which those at one place share a line."""
    groups: list[tuple[Array, list[str]]] = []
    for name, at in joints.items():
        near = next((names for place, names in groups if np.linalg.norm(place - at[:2]) < 0.04 * size), None)
        if near is None:
            groups.append((at[:2], [name]))
        else:
            near.append(name)
    out.taken.extend(at for at, _ in groups)
    out.words.extend(SketchLabel(at[:2], name, 8.0, INK) for name, at in bodies.items())
    out.words.extend(SketchLabel(at, ", ".join(names), 7.0, GREY) for at, names in groups)


def _bar(out: Sketch, cloud: Array, size: float) -> None:
    """A bar of a round length below the picture."""
    decade = 10.0 ** math.floor(math.log10(size / 3))
    length = decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= size / 3)
    left, low = float(cloud[:, 0].min()), float(cloud[:, 1].min()) - 0.16 * size
    out.line([[left, low], [left + length, low]], 1.6)
    text = f"{length:g} m" if length >= 0.5 else f"{1000.0 * length:g} mm"
    out.words.append(SketchLabel(np.array([left + 0.5 * length, low - 0.035 * size]), text, 7.5, INK, fixed=True))
