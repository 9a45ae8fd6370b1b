"""Gaps between features and solid bodies: points, segments and rims against polyhedra and cylinders.

A body gives the distance of points from its core; its surface is as far from the core as its radius says. A feature
gives its points that may be nearest to a body. The gap is the least distance less both radii; each of these points
bounds it from above, whether it is the nearest one or not.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from ephs.mechanics.shapes.gap import (
    CROSSING,
    PARALLEL,
    UPRIGHT,
    Gap,
    Vector,
    apart,
    clamped,
    cross,
    dot,
    into,
    ramp,
    times,
)
from ephs.mechanics.shapes.hull import Hull, around
from ephs.mechanics.shapes.selecting import chosen, least, most, moved
from ephs.semantics.derive.functions import TINY
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.special import choose

STEPS: Final = 4
"""Steps along a segment to the point nearest to a rim: a projection, then Newton's."""
TURNS: Final = 6
PROJECTIONS: Final = 3
"""Steps around a rim, and how many of them are projections, before Newton's."""
WIDEST: Final = 0.5
"""Largest turn of a step around a rim, rad."""
REGION: Final = 1e-3
"""Distance beyond a cap or a side, by the size, from which on Newton's steps include its curvature."""
MIDDLE: Final = 1e-6
"""Distance from the axis of a cylinder, by its radius, at which the direction away from it is smooth."""
Spot = tuple[Vector, Any]
"""A point of a feature in the axes of a body, and what its distance is longer by."""


@final
@dataclass(frozen=True, slots=True)
class Body:
    """A convex body.

    Parameters
    ----------
    distance, normal
        Point in its axes -> distance from the core in m, and unit normal away from it.
    bend
        Point and direction u -> u·H u of half the squared distance.
    curved
        It is not flat wherever it is near: steps find its nearest points.
    axial
        Half length of a cylinder's core, 0 of others.
    radius, halves, thickness
        Distance of the surface from the core, half lengths of a box about the frame that holds the core, its least
        thickness; m.
    """

    name: str
    distance: Callable[[Vector], Any]
    normal: Callable[[Vector], Vector]
    bend: Callable[[Vector, Vector], Any]
    curved: bool
    axial: float
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
    spots
        Centre and axis (unit) in a body's axes, and the body -> points that may be nearest.
    """

    name: str
    spots: Callable[[Vector, Vector, Body], Sequence[Spot]]
    radius: float
    halves: tuple[float, float, float]
    numbers: tuple[tuple[str, float], ...]


def meeting(feature: Feature, body: Body, *, first: bool) -> Gap:
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
        found: Any = None
        for at, longer in feature.spots(*seen(pose), body):
            one = body.distance(at) + longer
            found = one if found is None else least(found, one)
        return found - radii

    def contact(pose: Any) -> tuple[Vector, Vector]:
        centre, axis = seen(pose)
        (at, longer), *others = feature.spots(centre, axis, body)
        far = body.distance(at)
        for other, more in others:
            away = body.distance(other)
            nearer = far + longer - away - more
            at = chosen(nearer, other, at)
            far, longer = choose(nearer, away, far), choose(nearer, more, longer)
        normal = body.normal(at)
        if first:
            out = times(body.radius - far, normal)
            return times(-1.0, normal), (at[0] + out[0], at[1] + out[1], at[2] + out[2])
        away = into(pose, (at[0] - centre[0], at[1] - centre[1], at[2] - centre[2]))
        normal = into(pose, normal)
        on = times(-feature.radius, normal)
        return normal, (away[0] + on[0], away[1] + on[1], away[2] + on[2])

    halves = (feature.halves, body.halves) if first else (body.halves, feature.halves)
    return Gap(
        f"{feature.name}_{body.name}" if first else f"{body.name}_{feature.name}",
        distance,
        contact,
        body.radius if first else feature.radius,
        (*feature.numbers, *body.numbers),
        apart(*halves, radii),
        body.thickness + 2.0 * radii,
    )


# ---- features ----------------------------------------------------------------------------------------------------


def point(radius: float) -> Feature:
    """A ball about the origin."""
    return Feature("point", lambda at, _axis, _body: [(at, 0.0)], radius, (0.0, 0.0, 0.0), (("radius", radius),))


def segment(half: float, radius: float) -> Feature:
    """A capsule about a segment: one point, which moves to an end, or to the edge of the body, where it tilts."""

    def spots(centre: Vector, axis: Vector, body: Body) -> list[Spot]:
        stay = UPRIGHT * (radius + body.radius) / half
        level = axis[0] * axis[0] + axis[1] * axis[1] + PARALLEL
        side = clamped(-(centre[0] * axis[0] + centre[1] * axis[1]) / level, half)  # nearest to the cylinder's axis
        upright = clamped(centre[2] + side * axis[2], body.axial) - centre[2]
        along = clamped(upright * axis[2] / (axis[2] * axis[2] + PARALLEL), half)
        for step in range(STEPS):
            at = moved(centre, along, axis)
            slope = body.distance(at) * dot(body.normal(at), axis) + stay * along
            along = clamped(along - (slope / (body.bend(at, axis) + stay) if step else slope), half)
        found: list[Spot] = []
        for place in (side, along):
            at = moved(centre, place, axis)
            far = body.distance(at)
            found.append((at, np.sqrt(far * far + stay * place * place + TINY) - far))
        return found

    return Feature("segment", spots, radius, (0.0, 0.0, half), (("half", half), ("radius", radius)))


def rim(size: float, radius: float) -> Feature:
    """A circle of a radius ``size``, rounded: one point, which goes through the centre where the circle lies flat.

    It moves as that of an ellipsoid, as flat as `UPRIGHT`.
    """

    def across(way: Vector, axis: Vector) -> Vector:
        """Part of a vector in the plane of the circle."""
        return moved(way, -dot(way, axis), axis)

    def softly(way: Vector) -> tuple[Vector, Any]:
        """A direction, or less of a short vector, and the vector's length."""
        length = np.sqrt(dot(way, way) + UPRIGHT**2)
        return times(1.0 / length, way), length

    def spots(centre: Vector, axis: Vector, body: Body) -> list[Spot]:
        way: Vector = (0.0, 0.0, 0.0)
        for step in range(TURNS if body.curved else 0):
            at = moved(centre, size, way)
            far, normal = body.distance(at), body.normal(at)
            if step < PROJECTIONS:
                nearest = moved(at, -far, normal)
                off = nearest[0] - centre[0], nearest[1] - centre[1], nearest[2] - centre[2]
                way, _ = softly(times(1.0 / size, across(off, axis)))
            else:
                side = cross(axis, way)
                bend = size * body.bend(at, side) - far * dot(normal, way)
                bend = np.sqrt(bend * bend + (PARALLEL * size) ** 2)
                turn = clamped(-far * dot(normal, side) / bend, WIDEST)
                way = times(1.0 / np.sqrt(1.0 + turn * turn), moved(way, turn, side))
        way, length = softly(times(-1.0, across(body.normal(moved(centre, size, way)), axis)))
        return [(moved(centre, size, way), -size * UPRIGHT**2 / length)]

    wide = size * float(np.hypot(1.0, UPRIGHT))  # upright points of the ellipsoid are this far from the axis
    return Feature("rim", spots, radius, (wide, wide, UPRIGHT * size), (("size", size), ("radius", radius)))


def side(size: float, half: float, radius: float) -> Feature:
    """The side of a cylinder, where it crosses that of another: one point, of axes that are not parallel.

    Parallel sides touch along a line, whose ends are of rims; so do sides that cross beyond an end. The gap is larger
    there, so that no force jumps.
    """

    def spots(centre: Vector, axis: Vector, body: Body) -> list[Spot]:
        level = axis[0] * axis[0] + axis[1] * axis[1]
        along = -(centre[0] * axis[0] + centre[1] * axis[1]) / (level + PARALLEL)
        beyond = ramp(abs(along) - half)
        inside = moved(centre, clamped(along, half), axis)
        up = axis[0] * inside[0] + axis[1] * inside[1]
        way = up * axis[0] - inside[0], up * axis[1] - inside[1], up * axis[2]
        at = moved(inside, size / np.sqrt(dot(way, way) + TINY), way)
        parallel = ramp(1.0 - level / CROSSING)
        return [(at, beyond * beyond / radius + (half + body.axial) * (parallel * parallel))]

    numbers = (("size", size), ("half", half), ("radius", radius))
    return Feature("side", spots, radius, (size, size, half), numbers)


# ---- bodies ------------------------------------------------------------------------------------------------------


def cylinder(size: float, half: float, radius: float) -> Body:
    """A cylinder about z, of the radius ``size`` and this half length, rounded outwards."""

    near, middle = (REGION * min(size, half)) ** 2, (MIDDLE * size) ** 2

    def beyond(at: Vector) -> tuple[Any, Any, Any, Any]:
        """Distance from the axis; outwards from the side, along the axis from the caps, and in all."""
        wide = np.sqrt(at[0] * at[0] + at[1] * at[1] + middle)
        out, up = ramp(wide - size), at[2] - clamped(at[2], half)
        return wide, out, up, np.sqrt(out * out + up * up + TINY)

    def normal(at: Vector) -> Vector:
        wide, out, up, far = beyond(at)
        return out * at[0] / (wide * far), out * at[1] / (wide * far), up / far

    def bend(at: Vector, way: Vector) -> Any:
        wide, out, up, _ = beyond(at)
        inward = (way[0] * at[0] + way[1] * at[1]) / wide * (out * out / (out * out + near))
        aside = (way[1] * at[0] - way[0] * at[1]) / wide
        return inward * inward + out / wide * aside * aside + way[2] * way[2] * (up * up / (up * up + near))

    return Body(
        "cylinder",
        lambda at: beyond(at)[3],
        normal,
        bend,
        True,
        half,
        radius,
        (size, size, half),
        2.0 * min(size, half),
        (("size", size), ("half_length", half), ("rounding", radius)),
    )


def polyhedron(hull: Hull, centre: np.ndarray, radius: float) -> Body:
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
    return Body("polyhedron", distance, normal, _flat, False, 0.0, radius, halves, 2.0 * hull.radius, numbers)


def faces(hull: Hull, centre: np.ndarray, radius: float) -> list[Body]:
    """The faces of a convex polyhedron, rounded outwards, each as a body: a point above it is as far as it is high.

    Other points are further from it than from the polyhedron.
    """
    corners = hull.corners - centre
    planes = _planes(hull, corners)
    out: list[Body] = []
    for k, (normal, _) in enumerate(planes):
        lines, sharp = _sides(hull, corners, k)

        def distance(at: Vector, k: int = k, lines: Any = lines, steep: float = float(np.sqrt(sharp))) -> Any:
            heights = [dot(normal, at) - offset for normal, offset in planes]
            aside = ramp(most([dot(way, at) - offset for way, offset in lines]))
            return 2.0 * most(heights) - heights[k] + steep * aside

        def upwards(_: Vector, normal: Vector = normal) -> Vector:
            return normal

        numbers = (("face", float(k)), *_numbers(corners, radius))
        made = distance, upwards, _flat, False, 0.0, radius, _halves(corners), 2.0 * hull.radius, numbers
        out.append(Body("face", *made))
    return out


# ---- small parts -------------------------------------------------------------------------------------------------


def _flat(_at: Vector, _way: Vector) -> Any:
    return 0.0


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
