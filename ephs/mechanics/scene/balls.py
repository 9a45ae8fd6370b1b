"""Balls at the nodes of shells, by which these touch: their radius, share of the stiffness and depth."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, final

import numpy as np

from ephs.mechanics.scene.element import GROUND
from ephs.mechanics.scene.shells import ShellSheet
from ephs.mechanics.shapes.gap import Gap
from ephs.mechanics.shapes.hull import hull_of
from ephs.mechanics.shapes.pairs import Shape, touches
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3

if TYPE_CHECKING:
    from ephs.mechanics.scene.model import Scene
    from ephs.mechanics.scene.surfaces import Surface

PARTS: Final = (np.arange(17.0) / 16.0).tolist()
"""Places along both sides of an element at which its points are held against its nodes."""
NARROW: Final = 2.0
"""Least sum of half a surface's width and the radius of balls, by the largest distance of points from nodes."""
STRETCHED: Final = 1.5
"""Stretch of elements up to which no surface comes through between their nodes."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class ContactPoint:
    """A point at which two surfaces can touch.

    Attributes
    ----------
    bodies
        The two, in the order of the gap; a node of a shell by its name in pictures.
    frames
        (7,) poses of the gap's frames on these.
    gap
        Between the frames.
    share
        Part of the contact's stiffness.
    """

    bodies: tuple[str, str]
    frames: tuple[Array, Array]
    gap: Gap
    share: float = 1.0


def node_points(scene: "Scene", sheet: ShellSheet, own: "Surface", other: "Surface") -> Iterator[ContactPoint]:
    """Points of a shell's nodes and another surface; not of those that are joined to the body of this.

    A run ends where a surface is so deep in a ball that its middle may have come between nodes: see `STRETCHED`.
    """
    shell, joined = sheet.shell(), sheet.joined(pinned=True)
    areas = shell.shares(shell.areas)
    radius, beside = ball_radius(sheet, own), set(joined.get(other.body, ()))
    deepest = half_width(other.shape) + radius - STRETCHED * reach(shell.points[shell.cells])
    poses = {GROUND: SE3.identity()} | {name: body.pose for name, body in scene.all_bodies()}
    for i, (body, at) in enumerate(sheet.ends(poses)):
        if body == other.body or i in beside:
            continue
        found, swapped = touches({"sphere": radius}, at, other.shape, other.frame)
        for one, two, gap in found:
            depth = min(gap.support.depth, deepest)
            bodies = (other.body, body) if swapped else (body, other.body)
            limited = replace(gap, support=replace(gap.support, depth=depth))
            yield ContactPoint(bodies, (one, two), limited, float(areas[i] / areas.sum()))


def ball_radius(sheet: ShellSheet, own: "Surface") -> float:
    """Radius in m of the balls: that of its shape, or half the thickness."""
    return float(own.shape["sphere"]) if own.shape else 0.5 * sheet.stack().thickness


def too_narrow(sheet: ShellSheet, own: "Surface", other: "Surface") -> Mapping[str, Any] | bool:
    """Half the width of a surface that could come through between the nodes, and the least, m; else True."""
    least = NARROW * reach(sheet.mesh().points[sheet.mesh().cells]) - ball_radius(sheet, own)
    width = half_width(other.shape)
    return width >= least or {"width": width, "least": least}


def half_width(shape: Shape) -> float:
    """Radius in m of the largest ball inside of a shape; infinite of a plane."""
    ((kind, sizes),) = shape.items()
    match kind:
        case "sphere":
            return float(sizes)
        case "capsule":
            return float(sizes[0])
        case "cylinder":
            return float(min(sizes[0], 0.5 * sizes[1]))
        case "box":
            return 0.5 * float(min(sizes))
        case "mesh":
            return hull_of(sizes).radius
        case _:
            return np.inf


def reach(corners: Array) -> float:
    """Largest distance in m of a point of elements with corners (n, 4, 3) from the nearest of these."""
    u, v = np.meshgrid(PARTS, PARTS)
    weights = np.stack([(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v]).reshape(4, -1)
    points = np.einsum("kp,nkx->npx", weights, corners)
    far = np.linalg.norm(points[:, :, None] - corners[:, None], axis=3).min(axis=2)
    return float(far.max())
