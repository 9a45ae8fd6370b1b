"""Pairs of shapes that can touch: which gaps stand for them, and between which frames.

Planes meet spheres, capsules, cylinders and boxes; spheres meet spheres, capsules and boxes. A capsule meets a plane at
its two ends, a box at its corners, a cylinder at its two rims.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from typing import Any, Final

import numpy as np

from ephs.mechanics.shapes.gap import Gap, plane_rim, plane_sphere, rounded_box_sphere
from ephs.semantics.bundle import Array
from ephs.semantics.errors import StructureError
from ephs.semantics.spaces import SE3

__all__ = ["PAIRS", "SIZES", "Touch", "touches"]

Touch = tuple[Array, Array, Gap]
"""Frames (7,) on the first and on the second surface's body, and the gap between them."""
Shape = Mapping[str, Any]
SIZES: Final[Mapping[str, tuple[int, ...]]] = {
    "plane": (), "sphere": (), "capsule": (2,), "cylinder": (2,), "box": (3,)
}  # fmt: skip
"""Shapes -> shape of their sizes in m; a plane has none."""


def touches(shape1: Shape, frame1: Array, shape2: Shape, frame2: Array) -> tuple[tuple[Touch, ...], bool]:
    """Return the gaps between two surfaces.

    Parameters
    ----------
    shape1, shape2
        ``{"sphere": r}``, ``{"capsule": [r, length]}``, ``{"cylinder": [r, length]}``, ``{"box": [x, y, z]}``,
        ``{"plane": {}}``; lengths in m, axes along z, planes solid below z = 0.
    frame1, frame2
        (7,) poses of the shapes in their bodies.

    Returns
    -------
    tuple
        The gaps, and whether the second surface comes first in them.

    Raises
    ------
    StructureError
        Shapes of no pair.
    """
    kinds = tuple(next(iter(shape)) for shape in (shape1, shape2))
    for swapped in (False, True):
        one, other = kinds[::-1] if swapped else kinds
        if (found := PAIRS.get((one, other))) is not None:
            given = ((shape2, frame2), (shape1, frame1)) if swapped else ((shape1, frame1), (shape2, frame2))
            (first, near), (second, far) = given
            points = found(first[one], second[other])
            return tuple((near, _shifted(far, at), gap) for at, gap in points), swapped
    pairs = ", ".join(" and ".join(pair) for pair in PAIRS)
    raise StructureError("parameter", "contact", key="shapes", found=" and ".join(kinds), expected=pairs)


Points = Iterable[tuple[Any, Gap]]


def _shifted(frame: Array, at: Any) -> Array:
    return SE3.compose(frame, np.concatenate([[1.0, 0.0, 0.0, 0.0], np.asarray(at, dtype=float)]))


CENTRE: Final = (0.0, 0.0, 0.0)


def _ends(length: float) -> tuple[tuple[float, float, float], ...]:
    return ((0.0, 0.0, -0.5 * length), (0.0, 0.0, 0.5 * length))


def _corners(sizes: Sequence[float]) -> Points:
    return [(at, plane_sphere(0.0)) for at in product(*((-0.5 * x, 0.5 * x) for x in sizes))]


PAIRS: Final[Mapping[tuple[str, str], Callable[[Any, Any], Points]]] = {
    ("plane", "sphere"): lambda _, r: [(CENTRE, plane_sphere(r))],
    ("plane", "capsule"): lambda _, c: [(at, plane_sphere(c[0])) for at in _ends(c[1])],
    ("plane", "cylinder"): lambda _, c: [(at, plane_rim(c[0])) for at in _ends(c[1])],
    ("plane", "box"): lambda _, sizes: _corners(sizes),
    ("sphere", "sphere"): lambda one, other: [(CENTRE, rounded_box_sphere(CENTRE, one, other))],
    ("capsule", "sphere"): lambda c, r: [(CENTRE, rounded_box_sphere((0.0, 0.0, 0.5 * c[1]), c[0], r))],
    ("box", "sphere"): lambda b, r: [(CENTRE, rounded_box_sphere((b[0] / 2, b[1] / 2, b[2] / 2), 0.0, r))],
}
"""Kinds of both shapes -> the gaps, by where they are on the second one."""
