"""Gaps between two surfaces: distance, normal and contact point as functions of a relative pose.

A gap is negative where the surfaces overlap. Each function takes the pose (7,) of the second surface's frame C2 in the
first one's C1; numbers or recorded values. Only sums, products, roots and absolute values occur, so that a gap has exact
slopes over a step (`ephs.semantics.derive.slopes`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.semantics.derive.functions import TINY
from ephs.semantics.spaces.rotations import quaternion_to_matrix

__all__ = ["Gap", "plane_rim", "plane_sphere", "ramp", "rounded_box_sphere"]


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
        Relative pose (7,) -> unit normal (3,) from the first surface to the second, and the contact point (3,) on the
        second surface, both in the axes and from the origin of C2, m.
    radius
        Radius of curvature of the second surface at the contact in m; 0 of a corner.
    numbers
        Sizes of both surfaces by name, m.
    """

    name: str
    distance: Callable[[Any], Any]
    contact: Callable[[Any], tuple[Any, Any]]
    radius: float
    numbers: tuple[tuple[str, float], ...]


def ramp(x: Any) -> Any:
    """x where it is positive, else 0; exact."""
    return 0.5 * (abs(x) + x)


def plane_sphere(radius: float) -> Gap:
    """Gap between the plane z = 0 of C1, solid below, and a sphere about the origin of C2; radius 0: a point."""

    def contact(pose: Any) -> tuple[Any, Any]:
        normal = quaternion_to_matrix(pose[:4])[2]
        return normal, -radius * normal

    return Gap("plane_sphere", lambda pose: pose[6] - radius, contact, radius, (("radius", radius),))


def plane_rim(radius: float) -> Gap:
    """Gap between the plane z = 0 of C1, solid below, and the circle in the plane z = 0 of C2 about its origin."""

    def lowest(pose: Any) -> tuple[Any, Any, Any]:
        normal = quaternion_to_matrix(pose[:4])[2]
        length = np.sqrt(normal[0] * normal[0] + normal[1] * normal[1] + TINY)
        return normal, length, np.array([-radius * normal[0] / length, -radius * normal[1] / length, 0.0 * length])

    def distance(pose: Any) -> Any:
        _, length, _ = lowest(pose)
        return pose[6] - radius * length

    def contact(pose: Any) -> tuple[Any, Any]:
        normal, _, point = lowest(pose)
        return normal, point

    return Gap("plane_rim", distance, contact, radius, (("radius", radius),))


def rounded_box_sphere(half: tuple[float, float, float], rounding: float, radius: float) -> Gap:
    """Gap between a box of half lengths ``half`` about C1, its edges rounded outwards, and a sphere about C2.

    With one half length it is a capsule along that axis, with none a sphere of radius ``rounding``. The centre of the
    second sphere has to stay outside of the box itself.
    """

    def beyond(pose: Any) -> tuple[Any, Any]:
        at = pose[4:]
        clamped = [0.5 * (abs(x + h) - abs(x - h)) if h else 0.0 for x, h in zip(at, half, strict=True)]
        away = np.array([x - c for x, c in zip(at, clamped, strict=True)])
        return away, np.sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2] + TINY)

    def distance(pose: Any) -> Any:
        return beyond(pose)[1] - (rounding + radius)

    def contact(pose: Any) -> tuple[Any, Any]:
        away, length = beyond(pose)
        normal = quaternion_to_matrix(pose[:4]).T @ away / length
        return normal, -radius * normal

    x, y, z = half
    sizes = (("half_x", x), ("half_y", y), ("half_z", z), ("rounding", rounding), ("radius", radius))
    return Gap("rounded_box_sphere", distance, contact, radius, sizes)
