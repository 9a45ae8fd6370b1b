"""A still of a mechanism, drawn flat: shaded bodies, symbols for joints, coils for springs, and a bar for the scale."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.show.motion import Array, best_side, point_of, rotate
from ephs.show.palette import GREY, INK, PAPER
from ephs.show.solids import Solid, held_at, solids_of
from ephs.show.symbols import MUTED, ink

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_still"]

GROUND = "ground"
_LIGHT = np.array([0.35, 0.5, 0.8])  # to the right, up, towards the eye
_SMOOTH = math.cos(math.radians(25.0))
_STILL = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def draw_still(axes: "Axes", scene: Any, poses: dict[str, Array], way: Array | None = None) -> None:
    """Draw a mechanism into some axes, seen from far off.

    Parameters
    ----------
    poses
        (7,) of each body.
    way
        (3,) from where; by default where its places are seen best.
    """
    from matplotlib.collections import LineCollection, PolyCollection

    joints, springs = dict(scene.all_joints()), dict(scene.all_springs())
    solids = solids_of(scene)
    ends = {name: _ends(spring, poses) for name, spring in springs.items()}
    places = {name: point_of(poses.get(j.body1, _STILL), np.asarray(j.frame1)[4:]) for name, j in joints.items()}
    corners = {name: poses[name][4:] + rotate(poses[name][:4], solid.vertices) for name, solid in solids.items()}
    cloud = np.concatenate(
        [*corners.values(), *(np.array(e) for e in ends.values()), *(p[None] for p in places.values())]
    )
    view = _view(best_side(cloud) if way is None else way)
    size = float(np.linalg.norm(np.ptp(cloud @ view[:, :2], axis=0))) or 1.0
    order = sorted(solids, key=lambda name: float((corners[name] @ view[:, 2]).mean()))
    for depth, name in enumerate(order):  # the far bodies first
        solid, tone = solids[name], MUTED if solids[name].kind == "stand-in" else ink(list(solids).index(name))
        faces, colours, edges = _surface(solid, corners[name] @ view, 0.4 + 0.6 * np.array(tone) / 255.0)
        level = 1.0 + depth / len(order)
        for point in held_at(name, joints.values(), springs.values()):
            if stick := solid.stick(point):
                across = (poses[name][4:] + rotate(poses[name][:4], np.array(stick))) @ view
                axes.plot(across[:, 0], across[:, 1], color=0.75 * np.array(tone) / 255.0, linewidth=2.0, zorder=level)
        axes.add_collection(PolyCollection(faces, facecolors=colours, edgecolors=colours, linewidths=0.4, zorder=level))
        axes.add_collection(LineCollection(edges, colors=INK, linewidths=0.7, zorder=level))
    for start, end in ends.values():
        axes.plot(*_coil(start @ view, end @ view, 0.018 * size), color=INK, linewidth=1.0, zorder=4)
    for name, joint in joints.items():
        axis = rotate(poses.get(joint.body1, _STILL)[:4], rotate(np.asarray(joint.frame1)[:4], np.array([0.0, 0, 1.0])))
        _joint(axes, joint, places[name] @ view, axis @ view, 0.022 * size)
    _bar(axes, cloud @ view, size)
    axes.set_aspect("equal")
    axes.axis("off")
    _words(axes, {name: poses[name][4:] @ view for name in solids}, {n: p @ view for n, p in places.items()}, size)


def _view(way: Array) -> Array:
    """(3, 3) columns: to the right, up, towards the eye."""
    up = np.array([0.0, 0.0, 1.0]) if abs(way[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, way)
    right = right / np.linalg.norm(right)
    return np.column_stack([right, np.cross(way, right), way])


def _surface(solid: Solid, at: Array, colour: Array) -> tuple[list[Array], list[Any], list[Array]]:
    """Faces that look at the eye, the far ones first, their shades, and the edges where the surface bends or ends."""
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
    for (a, b), normals in beside.items():
        seen = [n[2] > 0.0 for n in normals]
        bent = len(normals) == 2 and float(normals[0] @ normals[1]) < _SMOOTH
        if any(seen) and (not all(seen) or bent or len(normals) == 1):
            edges.append(at[[a, b], :2])
    return [face for _, face, _ in shown], [shade for _, _, shade in shown], edges


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


def _joint(axes: "Axes", joint: Any, place: Array, axis: Array, r: float) -> None:
    from matplotlib.patches import Circle, Rectangle

    x, y, flat = place[0], place[1], float(np.hypot(axis[0], axis[1]))
    if joint.kind == "free":
        return
    line = {"color": INK, "linewidth": 0.9, "zorder": 5}
    if joint.kind not in ("spherical", "fixed") and flat > 0.2:
        reach = 3.0 * r * axis[:2]
        axes.plot([x - reach[0], x + reach[0]], [y - reach[1], y + reach[1]], linestyle=(0, (6, 1.5, 1, 1.5)), **line)
    patch: dict[str, Any] = {"facecolor": PAPER, "edgecolor": INK, "linewidth": 1.1, "zorder": 6}
    if joint.kind in ("prismatic", "cylindrical", "fixed", "planar"):
        if joint.kind == "fixed":
            patch["facecolor"] = INK
        angle = math.degrees(math.atan2(axis[1], axis[0])) if flat > 0.2 else 0.0
        long, wide = (3.2 * r, 1.7 * r) if flat > 0.2 and joint.kind != "fixed" else (1.7 * r, 1.7 * r)
        axes.add_patch(
            Rectangle((x - long / 2, y - wide / 2), long, wide, angle=angle, rotation_point="center", **patch)
        )
    if joint.kind != "prismatic" and joint.kind != "fixed" and joint.kind != "planar":
        axes.add_patch(Circle((x, y), 0.62 * r if joint.kind == "cylindrical" else r, **patch))
    if joint.kind in ("spherical", "universal"):
        axes.add_patch(Circle((x, y), 0.45 * r, facecolor=INK, zorder=7))
    if joint.body1 == GROUND or joint.body2 == GROUND:
        base = y - 2.6 * r
        axes.plot([x - 0.6 * r, x - 1.4 * r, x + 1.4 * r, x + 0.6 * r], [y - 0.8 * r, base, base, y - 0.8 * r], **line)
        ticks = np.linspace(x - 1.6 * r, x + 1.6 * r, 6)
        for tick in ticks:
            axes.plot([tick, tick - 0.6 * r], [base, base - 0.7 * r], **{**line, "linewidth": 0.7})
        axes.plot([ticks[0], ticks[-1]], [base, base], **line)


def _words(axes: "Axes", bodies: dict[str, Array], joints: dict[str, Array], size: float) -> None:
    """Names beside what they name, each where there is room; joints at one place share a line."""
    from matplotlib.patheffects import withStroke

    halo: list[Any] = [withStroke(linewidth=2.2, foreground=PAPER)]
    groups: list[tuple[Array, list[str]]] = []
    for name, at in joints.items():
        near = next((names for place, names in groups if np.linalg.norm(place - at[:2]) < 0.04 * size), None)
        if near is None:
            groups.append((at[:2], [name]))
        else:
            near.append(name)
    axes.apply_aspect()
    inch = axes.get_figure(root=True)
    dots = 72.0 / (inch.dpi if inch is not None else 72.0)

    def points(at: Array) -> Array:
        return np.asarray(axes.transData.transform(at[:2]), dtype=float) * dots

    page = np.asarray(axes.bbox.extents, dtype=float) * dots
    taken = [_room(points(at), 0.0, 0.0, 11.0, 11.0) for at, _ in groups]
    named = [(at[:2], name, 8.0, INK) for name, at in bodies.items()]
    named += [(at, ", ".join(names), 7.0, GREY) for at, names in groups]
    for at, words, letter, colour in named:
        wide, high = 0.58 * letter * len(words), 1.15 * letter
        rooms = [_room(points(at), *shift, wide, high) for shift in _shifts(wide, high)]
        clashes = [sum(_overlap(room, other) for other in taken) + _beyond(room, page) for room in rooms]
        best = int(np.argmin(clashes))
        taken.append(rooms[best])
        style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": letter, "color": colour, "zorder": 9}
        shift = _shifts(wide, high)[best]
        axes.annotate(words, (at[0], at[1]), shift, textcoords="offset points", **style).set_path_effects(halo)


def _shifts(wide: float, high: float) -> list[tuple[float, float]]:
    """Candidate offsets of a name's centre from its object, in points, best first."""
    aside, over = 0.5 * wide + 8.0, 0.5 * high + 8.0
    near = [(0.0, over), (aside, 0.0), (aside, over), (-aside, over), (-aside, 0.0), (0.0, -over), (aside, -over)]
    return [(0.0, 0.0), *near, (-aside, -over), (0.0, 2.2 * over), (0.0, -2.2 * over)]


def _room(at: Array, x: float, y: float, wide: float, high: float) -> tuple[float, float, float, float]:
    middle = at + np.array([x, y])
    return (middle[0] - wide / 2, middle[1] - high / 2, middle[0] + wide / 2, middle[1] + high / 2)


def _beyond(room: tuple[float, float, float, float], page: Array) -> float:
    """The area that leaves the picture."""
    whole = (room[2] - room[0]) * (room[3] - room[1])
    return whole - _overlap(room, (page[0], page[1], page[2], page[3]))


def _overlap(one: tuple[float, float, float, float], other: tuple[float, float, float, float]) -> float:
    """Common area."""
    wide = min(one[2], other[2]) - max(one[0], other[0])
    high = min(one[3], other[3]) - max(one[1], other[1])
    return max(0.0, wide) * max(0.0, high)


def _bar(axes: "Axes", cloud: Array, size: float) -> None:
    """A bar of a round length under the picture."""
    decade = 10.0 ** math.floor(math.log10(size / 3))
    length = decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= size / 3)
    left, low = float(cloud[:, 0].min()), float(cloud[:, 1].min()) - 0.16 * size
    axes.plot([left, left + length], [low, low], color=INK, linewidth=1.6, solid_capstyle="butt")
    words = f"{length:g} m" if length >= 0.5 else f"{1000.0 * length:g} mm"
    axes.text(left + 0.5 * length, low - 0.02 * size, words, ha="center", va="top", fontsize=7.5, color=INK)
    axes.update_datalim([(float(cloud[:, 0].max()), low - 0.08 * size)])
    axes.autoscale_view()
