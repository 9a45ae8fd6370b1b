"""Gaps between two surfaces: distance, normal and contact point as functions of a relative pose.

A gap is negative where the surfaces overlap. Each function takes the pose (7,) of the second surface's frame C2 in the
first one's C1: numbers, recorded values, or arrays of many instants (7, n). Only sums, products, roots and absolute
values occur, so that a gap has exact slopes over a step (`ephs.semantics.derive.slopes`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final, final

import numpy as np

from ephs.mechanics.shapes.selecting import Vector, chosen, most, moved
from ephs.semantics.bundles.support import Support
from ephs.semantics.derive.functions import TINY
from ephs.semantics.primitives.special import choose
from ephs.semantics.spaces.rotations import quaternion_to_matrix

UPRIGHT: Final = 1e-3
"""Inclination in rad below which a circle counts as flat: its gap is larger by this part of the radius at the most."""
PARALLEL: Final = 1e-6
"""Square of the sine of an angle below which segments count as parallel: any of their nearest points is taken."""
CROSSED: Final = 1e-15
"""The same of edges, which do not act where they are parallel."""
PASSES: Final = 3
"""Fixed-point passes for the nearest points of two segments: exact to rounding up to half lengths of ten radii."""
CROSSING: Final = 1.0 / 32.0
"""Square of the way aside, in radii of edges, that edges part by from where they cross to a corner, below which they
count as parallel: the gap at the corner is then larger by half of this part of a radius at the most."""
HEIGHT: Final = (6,)
PLACE: Final = (4, 5, 6)
"""Places of z, and of x, y, z, in a pose."""
ROUNDING: Final = 1e-12
"""Relative error of the coordinates that a support is held against."""
CENTRE: Final = (0.0, 0.0, 0.0)
PENETRATED: Final = 0.9
"""Part of half a thickness to which surfaces may overlap: beyond the middle the normal points to the other side."""


@final
@dataclass(frozen=True, slots=True)
class Gap:
    """Gap between two surfaces.

    Parameters
    ----------
    name
        Of the pair of shapes.
    distance
        Relative pose (7,) -> gap in m.
    contact
        Relative pose (7,) -> unit normal from the first surface to the second, and the contact point half-way between
        both surfaces in m, both in the axes and from the origin of C2.
    radius
        Radius in m on which the surfaces roll on each other, 1/(1/r₁ + 1/r₂), where a face is flat; 0 of a corner.
    numbers
        Sizes of both surfaces by name, m.
    support
        Of the relative pose: outside of it the gap is positive, and beyond its depth the normal may point to another
        side than that from which the surfaces met.
    thickness
        Least length of a straight way of C2 through the overlap, from side to side, in m; infinite behind a plane.
    """

    name: str
    distance: Callable[[Any], Any]
    contact: Callable[[Any], tuple[Vector, Vector]]
    radius: float
    numbers: tuple[tuple[str, float], ...]
    support: Support
    thickness: float = np.inf

    def on_second(self, pose: Any) -> tuple[Vector, Vector]:
        """The normal, and the point of the second surface, which turns with its body: that of hard contacts, which hold
        several points of a body without strain."""
        normal, point = self.contact(pose)
        return normal, moved(point, 0.5 * self.distance(pose), normal)


def apart(half1: Vector, half2: Vector, margin: float, middle: float) -> Support:
    """Support of gaps between boxes of these half lengths that are rounded by a margin in all; ``middle`` is the
    overlap in m in their middle."""
    wide, limit = margin * (1.0 + ROUNDING), math.hypot(*half1) + math.hypot(*half2)
    return Support(PLACE, limit + wide, (*half1, *half2), wide, depth=PENETRATED * middle)


def ramp(x: Any) -> Any:
    """x where it is positive, else 0; exact."""
    return 0.5 * (abs(x) + x)


def dot(a: Vector, b: Vector) -> Any:
    """⟨a|b⟩."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def times(factor: Any, a: Vector) -> Vector:
    """λ a."""
    return factor * a[0], factor * a[1], factor * a[2]


def _upwards(pose: Any) -> Vector:
    """The z axis of C1 in the axes of C2."""
    x, y, z = quaternion_to_matrix(pose[:4])[2]
    return x, y, z


def plane_sphere(radius: float) -> Gap:
    """Gap between the plane z = 0 of C1, solid below, and a sphere about the origin of C2; radius 0: a point."""

    def contact(pose: Any) -> tuple[Vector, Vector]:
        normal = _upwards(pose)
        return normal, times(-0.5 * (radius + pose[6]), normal)

    numbers = (("radius", radius),)
    return Gap("plane_sphere", lambda pose: pose[6] - radius, contact, radius, numbers, Support(HEIGHT, radius))


def rounded(level: Any, upright: Any) -> tuple[Any, Any]:
    """Contact point of a circle and a plane, in radii: distance from the axis by the sine, and depth below the centre.

    The point is nearly that of an ellipsoid with the axis ratio `UPRIGHT`: it moves through the centre when the circle
    comes to lie flat. The depth is exact at inclinations of 0 and 90 degrees, and smaller than the circle's between.

    Parameters
    ----------
    level, upright
        Squares of the sine and the cosine of the inclination.
    """
    length = np.sqrt(level + UPRIGHT**2 * upright)
    return (1.0 - UPRIGHT**2) / length + 4.0 * UPRIGHT * upright, length - UPRIGHT * upright * upright


def plane_rim(radius: float) -> Gap:
    """Gap between the plane z = 0 of C1, solid below, and the circle in the plane z = 0 of C2 about its origin."""

    def inclined(pose: Any) -> tuple[Vector, Any, Any]:
        normal = _upwards(pose)
        return normal, *rounded(normal[0] * normal[0] + normal[1] * normal[1], normal[2] * normal[2])

    def contact(pose: Any) -> tuple[Vector, Vector]:
        normal, out, below = inclined(pose)
        lowest = -radius * out * normal[0], -radius * out * normal[1], 0.0
        return normal, moved(lowest, 0.5 * (radius * below - pose[6]), normal)

    def distance(pose: Any) -> Any:
        return pose[6] - radius * inclined(pose)[2]

    return Gap("plane_rim", distance, contact, radius, (("radius", radius),), Support(HEIGHT, radius))


def clamped(x: Any, most: float) -> Any:
    """x between −most and most."""
    return 0.5 * (abs(x + most) - abs(x - most))


def into(pose: Any, vector: Vector) -> Vector:
    """A vector of the axes of C1 in those of C2."""
    axes = quaternion_to_matrix(pose[:4])
    x, y, z = (dot((axes[0][i], axes[1][i], axes[2][i]), vector) for i in range(3))
    return x, y, z


def segments(half1: float, radius1: float, half2: float, radius2: float) -> Gap:
    """Gap between two capsules about the z axes of C1 and C2: segments of these half lengths, with radii.

    The gap is the least of |x₂ − x₁| + ½ κ a² − r₁ − r₂ over points x₁ = a z of the first segment and x₂ of the second.
    So it is smooth where segments are parallel, larger than the distance by at most `PARALLEL` half₁²/(8 (r₁ + r₂)).
    Since κ is constant, its slope is that of |x₂ − x₁| where both points stay on their segments (envelope theorem): the
    wrench of the normal at x₂, but for what `PASSES` leave, κ a da q² |g|/|x₂ − x₁| with q = κ half₁²/|x₂ − x₁|.
    """
    return _capsules("segments", (half1, radius1, half2, radius2), PARALLEL, PASSES)


def _capsules(name: str, sizes: tuple[float, float, float, float], parallel: float, passes: int) -> Gap:
    half1, radius1, half2, radius2 = sizes
    radii = radius1 + radius2
    bend = 0.25 * parallel / radii
    """κ."""

    def least(pose: Any) -> tuple[Vector, Any, Any, Any]:
        """x₂ − x₁ with its length, and both points' places along the segments.

        A pass finds the least |x₂ − x₁|² + k a², k the weight; wanted is that with k = κ |x₂ − x₁|. Passes begin with
        the length of a touch, off by g. A length changes with k by a²/|x₂ − x₁| or less, so each pass leaves a part q
        of what it is off by; the slope is off by κ − k/|x₂ − x₁|, times a da.
        """
        axes = quaternion_to_matrix(pose[:4])
        x, y, z = axes[0][2], axes[1][2], axes[2][2]
        aside, level = x * pose[4] + y * pose[5], x * x + y * y
        along = aside + z * pose[6]

        def nearest(weight: Any) -> tuple[Vector, Any, Any, Any]:
            one = clamped((level * pose[6] - z * aside) / (level + weight), half1)
            two = clamped(one * z - along, half2)
            one = clamped((pose[6] + two * z) / (1.0 + weight), half1)
            away = pose[4] + two * x, pose[5] + two * y, pose[6] + two * z - one
            return away, np.sqrt(dot(away, away) + TINY), one, two

        found = nearest(bend * radii)
        for _ in range(passes - 1):
            found = nearest(bend * found[1])
        return found

    def distance(pose: Any) -> Any:
        _, length, at, _ = least(pose)
        return length + 0.5 * bend * (at * at) - radii

    def contact(pose: Any) -> tuple[Vector, Vector]:
        away, length, _, at = least(pose)
        normal = times(1.0 / length, into(pose, away))
        return normal, moved((0.0, 0.0, at), 0.5 * (radius1 - radius2 - length), normal)

    return Gap(
        name,
        distance,
        contact,
        radius1 * radius2 / radii,
        (("half1", half1), ("radius1", radius1), ("half2", half2), ("radius2", radius2)),
        apart((0.0, 0.0, half1), (0.0, 0.0, half2), radii, radii),
        2.0 * radii,
    )


def edges(half1: float, radius1: float, half2: float, radius2: float) -> Gap:
    """Gap between two edges of bodies whose corners meet the other body, too: `segments` that cross.

    Edges that are parallel within `CROSSING` touch along a line, whose ends are corners. The gap is
    larger there by up to the lengths, so that no force jumps from end to end of a line when it tilts; by how much
    depends on the angle alone, so that the slope has a moment about the common normal beside the force at the contact.
    """
    whole, length = _capsules("edges", (half1, radius1, half2, radius2), CROSSED, 1), half1 + half2
    square = CROSSING * min(radius1, radius2) * (radius1 + radius2) / max(half1, half2) ** 2

    def distance(pose: Any) -> Any:
        axes = quaternion_to_matrix(pose[:4])
        x, y = axes[0][2], axes[1][2]
        parallel = ramp(1.0 - (x * x + y * y) / square)
        return whole.distance(pose) + length * (parallel * parallel)

    wide = whole.support.margin
    support = replace(whole.support, parallel=square * max(0.0, 1.0 - math.sqrt(wide / length)))
    return replace(whole, distance=distance, support=support)


def sphere_rounded_box(radius: float, half: Vector, rounding: float) -> Gap:
    """Gap between a sphere about the origin of C1 and a rounded box about that of C2: `rounded_box_sphere` turned."""

    def centre(pose: Any) -> Vector:
        return times(-1.0, into(pose, (pose[4], pose[5], pose[6])))

    def contact(pose: Any) -> tuple[Vector, Vector]:
        at = centre(pose)
        normal = _normal_of_box(at, half)
        return times(-1.0, normal), moved(at, 0.5 * (rounding - radius - _beyond_box(at, half)), normal)

    sizes = zip(("half_x", "half_y", "half_z"), half, strict=True)
    return Gap(
        "sphere_rounded_box",
        lambda pose: _beyond_box(centre(pose), half) - (rounding + radius),
        contact,
        radius,
        (("radius", radius), *sizes, ("rounding", rounding)),
        apart(CENTRE, half, rounding + radius, min(half) + rounding + radius),
        2.0 * (min(half) + rounding + radius),
    )


def rounded_box_sphere(half: Vector, rounding: float, radius: float) -> Gap:
    """Gap between a box of half lengths ``half`` about C1, its edges rounded outwards, and a sphere about C2.

    With one half length it is a capsule along that axis, with none a sphere of radius ``rounding``.
    """

    def contact(pose: Any) -> tuple[Vector, Vector]:
        at = pose[4], pose[5], pose[6]
        normal = into(pose, _normal_of_box(at, half))
        return normal, times(0.5 * (rounding - radius - _beyond_box(at, half)), normal)

    rolling = radius if all(half) else rounding * radius / (rounding + radius)
    sizes = zip(("half_x", "half_y", "half_z"), half, strict=True)
    return Gap(
        "rounded_box_sphere",
        lambda pose: _beyond_box((pose[4], pose[5], pose[6]), half) - (rounding + radius),
        contact,
        rolling,
        (*sizes, ("rounding", rounding), ("radius", radius)),
        apart(half, CENTRE, rounding + radius, min(half) + rounding + radius),
        2.0 * (min(half) + rounding + radius),
    )


def _beside_box(at: Vector, half: Vector) -> tuple[Vector, Any]:
    """Way to a point from the nearest one of a box, zero inside, and its length."""
    x, y, z = (x - clamped(x, h) if h else x for x, h in zip(at, half, strict=True))
    return (x, y, z), np.sqrt(x * x + y * y + z * z + TINY)


def _beyond_box(at: Vector, half: Vector) -> Any:
    """Distance of a point from a box, inside that from the nearest face, negative."""
    length = _beside_box(at, half)[1]
    return length - ramp(-most([abs(x) - h for x, h in zip(at, half, strict=True)])) if all(half) else length


def _normal_of_box(at: Vector, half: Vector) -> Vector:
    """Unit normal of a box at a point, inside that of the nearest face."""
    away, length = _beside_box(at, half)
    outside = times(1.0 / length, away)
    if not all(half):
        return outside
    height, inside = abs(at[0]) - half[0], (at[0] / (abs(at[0]) + TINY), 0.0, 0.0)
    for other, face in (
        (abs(at[1]) - half[1], (0.0, at[1] / (abs(at[1]) + TINY), 0.0)),
        (abs(at[2]) - half[2], (0.0, 0.0, at[2] / (abs(at[2]) + TINY))),
    ):
        height, inside = choose(other - height, other, height), chosen(other - height, face, inside)
    return chosen(height, outside, inside)
