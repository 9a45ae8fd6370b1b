"""Gaps between features and solid bodies: points, segments and rims against polyhedra and cylinders.

A body gives the distance of points from its core; its surface is as far from the core as its radius says. A feature
gives its point that is nearest to a body. The gap is the distance of this point less both radii.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from ephs.mechanics.shapes.gap import (
    UPRIGHT,
    Gap,
    apart,
    clamped,
    dot,
    into,
    ramp,
    rounded,
    times,
)
from ephs.mechanics.shapes.hull import Hull, around
from ephs.mechanics.shapes.selecting import Vector, chosen, least, most, moved
from ephs.semantics.derive.functions import TINY
from ephs.semantics.primitives.special import choose, root
from ephs.semantics.spaces.rotations import quaternion_to_matrix

LEANING: Final = 1e-7
"""Inclination in rad below which the direction in which an axis leans is smooth."""
MIDDLE: Final = 1e-6
"""Distance from the axis of a cylinder, by its radius, at which the direction away from it is smooth."""
Spot = tuple[Vector, Any]
"""A point of a feature in the axes of a body, and what its distance is longer by."""


@final
@dataclass(frozen=True, slots=True)
class ConvexBody:
    """A convex body.

    Parameters
    ----------
    distance, normal
        Point in its axes -> distance from the core in m, inside that from the nearest face, negative; and unit normal
        away from it.
    pull
        Of a round body: point -> half the gradient of the squared distance.
    radius, halves, thickness
        Distance of the surface from the core, half lengths of a box about the frame that holds the core, its least
        thickness; m.
    """

    name: str
    distance: Callable[[Vector], Any]
    normal: Callable[[Vector], Vector]
    pull: Callable[[Vector], Vector] | None
    radius: float
    halves: tuple[float, float, float]
    thickness: float
    numbers: tuple[tuple[str, float], ...]


@final
@dataclass(frozen=True, slots=True)
class Feature:
    """A point, a segment along z or a circle about z, with a radius around it.

    Parameters
    ----------
    spot
        Centre and axis (unit) in a body's axes, and the body -> the nearest point.
    searched
        Whether this point of a round body is searched, which finds none where the feature meets its core.
    """

    name: str
    spot: Callable[[Vector, Vector, ConvexBody], Spot]
    radius: float
    halves: tuple[float, float, float]
    numbers: tuple[tuple[str, float], ...]
    searched: bool = True


def meeting(feature: Feature, body: ConvexBody, *, first: bool) -> Gap:
    """Gap between a feature and a body.

    Parameters
    ----------
    first
        The feature is that of the first surface, else of the second.
    """
    radii = feature.radius + body.radius

    def seen(pose: Any) -> tuple[Vector, Vector]:
        """Centre and axis of the feature in the body's axes."""
        axes = quaternion_to_matrix(pose[:4])
        place = pose[4], pose[5], pose[6]
        if first:
            return times(-1.0, into(pose, place)), (axes[2][0], axes[2][1], axes[2][2])
        return place, (axes[0][2], axes[1][2], axes[2][2])

    def distance(pose: Any) -> Any:
        at, longer = feature.spot(*seen(pose), body)
        return body.distance(at) + longer - radii

    def contact(pose: Any) -> tuple[Vector, Vector]:
        centre, axis = seen(pose)
        at, _ = feature.spot(centre, axis, body)
        normal = body.normal(at)
        middle = moved(at, 0.5 * (body.radius - feature.radius - body.distance(at)), normal)
        return (times(-1.0, normal), middle) if first else (into(pose, normal), into(pose, moved(middle, -1.0, centre)))

    halves = (feature.halves, body.halves) if first else (body.halves, feature.halves)
    return Gap(
        f"{feature.name}_{body.name}" if first else f"{body.name}_{feature.name}",
        distance,
        contact,
        feature.radius,
        (*feature.numbers, *body.numbers),
        apart(*halves, radii, radii if feature.searched and body.pull is not None else 0.5 * body.thickness + radii),
        body.thickness + 2.0 * radii,
    )


# ---- features ----------------------------------------------------------------------------------------------------


def point(radius: float) -> Feature:
    """A ball about the origin."""
    numbers = (("radius", radius),)
    return Feature("point", lambda at, _axis, _body: (at, 0.0), radius, (0.0, 0.0, 0.0), numbers, searched=False)


def segment(half: float, radius: float) -> Feature:
    """A capsule about a segment: one point, which moves to an end, or to the edge of the body, where it tilts."""

    def spot(centre: Vector, axis: Vector, body: ConvexBody) -> Spot:
        stay, pull = UPRIGHT * (radius + body.radius) / half, body.pull
        assert pull is not None

        def rising(place: Any, x: Any, y: Any, z: Any, u: Any, v: Any, w: Any) -> Any:
            """Half the slope of the squared distance and of a square, least in the middle."""
            return dot(pull(moved((x, y, z), place, (u, v, w))), (u, v, w)) + stay * place

        reach = 2.0 * (np.sqrt(dot(centre, centre)) + math.hypot(*body.halves))  # beyond, the centre is nearer
        place = clamped(root(rising, -reach, reach, *centre, *axis), half)
        at = moved(centre, place, axis)
        far = ramp(body.distance(at))
        return at, np.sqrt(far * far + stay * place * place + TINY) - far

    return Feature("segment", spot, radius, (0.0, 0.0, half), (("half", half), ("radius", radius)))


def rim(size: float, radius: float) -> Feature:
    """A circle of a radius ``size``, rounded, and the disc in it: one point.

    Its contact with a face is that with a plane (`rounded`); flat on a cap, it is near the axis of the other cylinder.
    """

    def spot(centre: Vector, axis: Vector, body: ConvexBody) -> Spot:
        if body.pull is not None:
            return _disc(centre, axis, size, body.pull), 0.0
        normal = body.normal(centre)
        inward = moved(normal, -dot(normal, axis), axis)
        level = dot(inward, inward)
        out, lower = rounded(level, dot(normal, axis) ** 2)
        return moved(centre, -size * out, inward), size * (level * out - lower)

    return Feature("rim", spot, radius, (size, size, 0.0), (("size", size), ("radius", radius)))


def side(size: float, half: float, radius: float) -> Feature:
    """The side of a cylinder, where it crosses that of another: one point.

    Parallel sides touch along a line, whose ends are of rims: the point is in its middle, and goes to an end by a tilt
    of `UPRIGHT`. Sides that would cross beyond an end touch at rims alone: the gap is larger there.
    """

    def spot(centre: Vector, axis: Vector, body: ConvexBody) -> Spot:
        barrel = UPRIGHT * (size + body.halves[0]) / half
        level = axis[0] * axis[0] + axis[1] * axis[1]
        crossing = -(centre[0] * axis[0] + centre[1] * axis[1]) / (level + barrel)
        high = centre[2] + crossing * axis[2]
        along = clamped(crossing + (clamped(high, body.halves[2]) - high) * axis[2], half)
        inside = moved(centre, along, axis)
        square = inside[0] * inside[0] + inside[1] * inside[1] + TINY
        far, beyond, over = np.sqrt(square), along - crossing, inside[2] - clamped(inside[2], body.halves[2])
        nearer = 1.0 - size / far
        at = nearer * inside[0], nearer * inside[1], inside[2]
        return at, np.sqrt(square + barrel * along * along) - far + (beyond * beyond + over * over) / radius

    numbers = (("size", size), ("half", half), ("radius", radius))
    return Feature("side", spot, radius, (size, size, half), numbers)


def _disc(centre: Vector, axis: Vector, size: float, pull: Callable[[Vector], Vector]) -> Vector:
    """The point of a disc that is nearest to a cylinder.

    The disc is a family of chords perpendicular to the cylinder's axis; of each, the point nearest to the axis is the
    nearest. From the first chord to the last it gets nearer, and then further again. The tangent of half an angle,
    whose sine says which chord it is and whose cosine how long it is, goes from −1 to 1.
    """
    x, y = axis[0] + LEANING, axis[1]
    level = np.sqrt(x * x + y * y)
    x, y = x / level, y / level
    lean, rise = x * axis[0] + y * axis[1], axis[2]
    along, aside = x * centre[0] + y * centre[1], x * centre[1] - y * centre[0]

    def rising(place: Any, along: Any, beside: Any, up: Any, lean: Any, rise: Any) -> Any:
        """The slope of the distance along the chords, but for a factor."""
        sine, cosine = turned(place)
        off = ramp(beside - size * cosine)
        way = pull((along + size * rise * sine, off, up - size * lean * sine))
        return way[0] * rise * cosine + way[1] * sine - way[2] * lean * cosine

    def turned(place: Any) -> tuple[Any, Any]:
        below = 1.0 + place * place
        return 2.0 * place / below, (1.0 - place * place) / below

    sine, cosine = turned(root(rising, -1.0, 1.0, along, abs(aside), centre[2], lean, rise))
    across, upon = size * rise * sine, clamped(-aside, size * cosine)
    off = x * across - y * upon, y * across + x * upon, -size * lean * sine
    return moved(moved(centre, 1.0, off), -dot(off, axis), axis)  # chords are in the disc but for `LEANING`


# ---- bodies ------------------------------------------------------------------------------------------------------


def cylinder(size: float, half: float, radius: float, domed: float = 0.0) -> ConvexBody:
    """A cylinder about z, of the radius ``size`` and this half length, rounded outwards.

    Parameters
    ----------
    domed
        Distance in m from the core at which the edges of the caps count as lower by half of `UPRIGHT` times the radius,
        so that a flat disc has its contact point near the axis; 0 for flat caps.
    """
    middle, dome = (MIDDLE * size) ** 2, UPRIGHT / (size * domed) if domed else 0.0

    def pull(at: Vector) -> Vector:
        """Half the gradient of the squared distance."""
        square = at[0] * at[0] + at[1] * at[1]
        wide, up = np.sqrt(square + middle), at[2] - clamped(at[2], half)
        aside, more = ramp(wide - size) / wide, dome * up * up
        return (aside + more) * at[0], (aside + more) * at[1], up + dome * square * up

    def heights(at: Vector) -> tuple[Any, Any]:
        """Above the side and above the nearer cap."""
        return np.sqrt(at[0] * at[0] + at[1] * at[1] + middle) - size, abs(at[2]) - half

    def distance(at: Vector) -> Any:
        square, (around, above) = at[0] * at[0] + at[1] * at[1], heights(at)
        out, up = ramp(around), at[2] - clamped(at[2], half)
        return np.sqrt(out * out + up * up + dome * square * up * up + TINY) - ramp(-most([around, above]))

    def normal(at: Vector) -> Vector:
        way, (around, above) = pull(at), heights(at)
        outwards = times(1.0 / np.sqrt(at[0] * at[0] + at[1] * at[1] + TINY), (at[0], at[1], 0.0))
        inside = chosen(above - around, (0.0, 0.0, at[2] / (abs(at[2]) + TINY)), outwards)
        return chosen(most([around, above]), times(1.0 / np.sqrt(dot(way, way) + TINY), way), inside)

    sizes = (("size", size), ("half_length", half), ("rounding", radius), *((("domed", domed),) if domed else ()))
    halves, thickness = (size, size, half), 2.0 * min(size, half)
    return ConvexBody("dome" if domed else "cylinder", distance, normal, pull, radius, halves, thickness, sizes)


def polyhedron(hull: Hull, centre: np.ndarray, radius: float) -> ConvexBody:
    """A convex polyhedron about a centre (3,), rounded outwards. Distances within are those from the nearest face.

    A point outside is nearest to an edge, or to a face above which it is: the least of all distances from edges, and of
    the heights above faces, each increased beside its face by at least the distance from it.
    """
    corners = hull.corners - centre
    planes = _planes(hull, corners)
    sides = [_sides(hull, corners, k) for k in range(len(hull.faces))]
    edges = []
    for i, j in hull.edges:
        along = corners[j] - corners[i]
        length = float(np.linalg.norm(along))
        edges.append((_vector(0.5 * (corners[i] + corners[j])), _vector(along / length), 0.5 * length))
    steep = float(np.linalg.norm(hull.corners - hull.centre, axis=1).max()) / hull.radius
    """Largest distance of a point outside by its height above all planes."""

    def squares(at: Vector) -> tuple[list[Any], list[tuple[Any, Vector]]]:
        """Heights above faces; squares of distances, with the ways from faces (unit) and edges."""
        heights = [dot(normal, at) - offset for normal, offset in planes]
        found: list[tuple[Any, Vector]] = []
        for height, (normal, _), (lines, sharp) in zip(heights, planes, sides, strict=True):
            aside = ramp(most([dot(way, at) - offset for way, offset in lines]))
            found.append((height * height + sharp * aside * aside, normal))
        for middle, way, half in edges:
            off = at[0] - middle[0], at[1] - middle[1], at[2] - middle[2]
            away = moved(off, -clamped(dot(way, off), half), way)
            found.append((dot(away, away), away))
        return heights, found

    def distance(at: Vector) -> Any:
        heights, found = squares(at)
        height = most(heights)
        near = found[0][0]
        for square, _ in found[1:]:
            near = least(near, square)
        return least(np.sqrt(near + TINY), steep * ramp(height)) - ramp(-height)

    def normal(at: Vector) -> Vector:
        heights, found = squares(at)
        (square, way), *others = found
        for other, new in others:
            square, way = choose(square - other, other, square), chosen(square - other, new, way)
        length = np.sqrt(dot(way, way) + TINY)
        height, inner = heights[0], planes[0][0]
        for other, (new, _) in zip(heights[1:], planes[1:], strict=True):
            height, inner = choose(other - height, other, height), chosen(other - height, new, inner)
        return chosen(height, times(1.0 / length, way), inner)

    numbers = _numbers(corners, radius)
    halves = _halves(corners)
    return ConvexBody("polyhedron", distance, normal, None, radius, halves, 2.0 * hull.radius, numbers)


def faces(hull: Hull, centre: np.ndarray, radius: float) -> list[ConvexBody]:
    """The faces of a convex polyhedron, rounded outwards, each as a body: a point above it is as far as it is high.

    Other points are further from it than from the polyhedron.
    """
    corners = hull.corners - centre
    planes = _planes(hull, corners)
    out: list[ConvexBody] = []
    for k, (normal, _) in enumerate(planes):
        lines, sharp = _sides(hull, corners, k)

        def distance(at: Vector, k: int = k, lines: Any = lines, steep: float = float(np.sqrt(sharp))) -> Any:
            heights = [dot(normal, at) - offset for normal, offset in planes]
            aside = ramp(most([dot(way, at) - offset for way, offset in lines]))
            return 2.0 * most(heights) - heights[k] + steep * aside

        def upwards(_: Vector, normal: Vector = normal) -> Vector:
            return normal

        numbers = (("face", float(k)), *_numbers(corners, radius))
        made = distance, upwards, None, radius, _halves(corners), 2.0 * hull.radius, numbers
        out.append(ConvexBody("face", *made))
    return out


# ---- small parts -------------------------------------------------------------------------------------------------


def _planes(hull: Hull, corners: np.ndarray) -> list[tuple[Vector, float]]:
    return [(_vector(face.normal), float(face.normal @ corners[face.corners[0]])) for face in hull.faces]


def _sides(hull: Hull, corners: np.ndarray, k: int) -> tuple[list[tuple[Vector, float]], float]:
    """Outward normals and offsets of a face's sides in its plane, and the square of the largest distance of a point of
    the plane beside the face, by that from all of the sides."""
    face = hull.faces[k]
    ways = []
    for i, j in around(face.corners):
        way = np.cross(corners[j] - corners[i], face.normal)
        ways.append((way / np.linalg.norm(way), i))
    turns = [ways[m][0] @ ways[m - 1][0] for m in range(len(ways))]
    return [(_vector(way), float(way @ corners[i])) for way, i in ways], float(2.0 / (1.0 + min(turns)))


def _numbers(corners: np.ndarray, radius: float) -> tuple[tuple[str, float], ...]:
    named = [
        (f"{axis}{i}", float(x)) for i, corner in enumerate(corners) for axis, x in zip("xyz", corner, strict=True)
    ]
    return (*named, ("rounding", radius))


def _halves(corners: np.ndarray) -> tuple[float, float, float]:
    x, y, z = np.abs(corners).max(axis=0).tolist()
    return x, y, z


def _vector(numbers: np.ndarray) -> Vector:
    x, y, z = numbers.tolist()
    return x, y, z
