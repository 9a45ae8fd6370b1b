"""Contacts of a motion: gaps, forces, slip and heat at all instants, in closed form."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.elements.contact import lever, losses, shared
from ephs.mechanics.motion.batch import adjoint_inverse, compose, inverse, turned
from ephs.mechanics.motion.moving import Moving
from ephs.mechanics.scene.balls import ContactPoint
from ephs.mechanics.scene.build import component_path
from ephs.mechanics.scene.contacts import Contact, contact_points
from ephs.mechanics.scene.model import GROUND, Scene
from ephs.mechanics.shapes.gap import Gap, ramp
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import ConstitutiveLaw
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.rank import SPANNED


@final
@dataclass(frozen=True, slots=True, eq=False)
class ContactMotion:
    """A contact of two surfaces.

    Parameters
    ----------
    gap
        (n,) least gap of its points in m, negative where the surfaces overlap.
    force
        (n, 3) on the second body, in N and world axes.
    place
        (n, 3) where it acts in the world, in m: the mean of the points by their forces; the nearest where none touches.
    slip
        (n,) largest velocity of a touching point along the surfaces in m/s; 0 where none touches.
    heat
        (n,) power in W that it turns into heat.
    points
        (n, points, 3) force of each point on the second body, in N and world axes.
    mask
        (n, 3) where components of the force are indeterminate, since hard contacts share a load: those of ``force``
        are the ones of least norm, and the motion is the same with others.
    points_mask
        (n, points, 3) likewise of ``points``.
    """

    gap: Array
    force: Array
    place: Array
    slip: Array
    heat: Array
    points: Array
    mask: NDArray[np.bool_]
    points_mask: NDArray[np.bool_]


class Pressed(Moving, Protocol):
    """Source of the motion of bodies with hard contacts."""

    def pressed(self, contact: str, point: int) -> tuple[Array, list[Array]]:
        """(n, 3) force of a point of a hard contact on the second body, in world axes; and at each instant (3, m) its
        share of forces that balance each other."""
        ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class _PointMotion:
    """One point of a contact: the values of `ContactMotion`, and wrenches (n, 6) on bodies 1 and 2 in their frames."""

    gap: Array
    force: Array
    place: Array
    slip: Array
    heat: Array
    wrenches: tuple[Array, Array]


def contact_motion(scene: Scene, of: Contact, read: Pressed) -> ContactMotion:
    """Read a contact's motion."""
    points = [_read(point, of, read, i) for i, point in enumerate(contact_points(scene, of))]
    gaps, forces = np.array([point.gap for point in points]), np.array([point.force for point in points])
    weights = np.linalg.norm(forces, axis=2)
    touching = weights.any(axis=0)
    weights = np.where(touching, weights, gaps == gaps.min(axis=0))
    places = np.array([point.place for point in points])
    return ContactMotion(
        gaps.min(axis=0),
        forces.sum(axis=0),
        (weights[:, :, None] * places).sum(axis=0) / weights.sum(axis=0)[:, None],
        np.max([point.slip for point in points], axis=0),
        np.sum([point.heat for point in points], axis=0),
        forces.transpose(1, 0, 2),
        *_masks(of, read, len(points), len(touching)),
    )


def contact_poses(scene: Scene, read: Moving) -> Iterator[tuple[Path, Path | None, Array]]:
    """Relative poses of points of contacts by the poses of the bodies: the path of the state, that of a point of this
    contact before with equal axes, if any, and the place (n, 3) in m."""
    for name, of in scene.all_contacts():
        before: dict[object, Path] = {}
        into: dict[object, Array] = {}
        for i, point in enumerate(contact_points(scene, of)):
            (first, second), (frame1, frame2) = point.bodies, point.frames
            one, other = read.poses(first), read.poses(second)
            path = component_path("contacts", name) / f"point{i}" / "pe" / "q_r"
            axes, key = (point.bodies, frame1[:4].tobytes(), frame2[:4].tobytes()), (first, frame1.tobytes())
            if key not in into:  # points on a plane share it
                into[key] = inverse(compose(one, np.broadcast_to(frame1, one.shape)))
            end = other[:, 4:] + turned(other, np.broadcast_to(frame2[4:], (len(other), 3)))
            yield path, before.get(axes), into[key][:, 4:] + turned(into[key], end)
            before.setdefault(axes, path)


def _masks(of: Contact, read: Pressed, points: int, instants: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(n, 3) and (n, points, 3) where the force of a contact, and of its points, is indeterminate."""
    whole, each = np.zeros((instants, 3), dtype=bool), np.zeros((instants, points, 3), dtype=bool)
    if isinstance(of.law, Impact):
        balanced = [read.pressed(of.name, i)[1] for i in range(points)]
        for k in range(instants):
            shares = np.array([point[k] for point in balanced])
            each[k] = np.linalg.norm(shares, axis=2) > SPANNED
            whole[k] = np.linalg.norm(shares.sum(axis=0), axis=1) > SPANNED
    return whole, each


def _read(point_of: ContactPoint, of: Contact, read: Pressed, number: int) -> _PointMotion:
    bodies, (frame1, frame2), gap = point_of.bodies, point_of.frames, point_of.gap
    poses = [read.poses(name) for name in bodies]
    ends = [compose(pose, np.broadcast_to(o, pose.shape)) for pose, o in zip(poses, (frame1, frame2), strict=True)]
    relative = compose(inverse(ends[0]), ends[1])
    twist1, twist2 = (_twist(read.twists, name, len(relative)) for name in bodies)
    offset1 = compose(np.broadcast_to(frame1, relative.shape), relative)
    twist = np.einsum("nij,nj->ni", adjoint_inverse(np.broadcast_to(frame2, relative.shape)), twist2)
    twist -= np.einsum("nij,nj->ni", adjoint_inverse(offset1), twist1)
    normal, point = gap.contact(relative.T)
    distance = np.asarray(gap.distance(relative.T))
    velocity = twist[:, 3:] + np.cross(twist[:, :3], _rows(point, len(relative)))
    law = shared(of.law, point_of.share)
    if isinstance(law, Impact):
        pressed = _turned_back(ends[1], read.pressed(of.name, number)[0])
        wrench = np.column_stack([np.cross(_rows(point, len(relative)), pressed), pressed])
        heat = np.maximum(-np.einsum("ni,ni->n", wrench, twist), 0.0)
        touching = np.any(pressed, axis=1)
    else:
        wrench, heat = _elastic(gap, law, relative, twist, lever(normal, point), distance)
        touching = distance < 0.0
    slip = np.linalg.norm(np.cross(_rows(normal, len(relative)), velocity), axis=1)
    place = ends[1][:, 4:] + turned(ends[1], _rows(point, len(relative)))
    one, two = (_carried(o, wrench) for o in (offset1, np.broadcast_to(frame2, relative.shape)))
    return _PointMotion(distance, turned(poses[1], two[:, 3:]), place, np.where(touching, slip, 0.0), heat, (-one, two))


def _elastic(
    gap: Gap, law: ConstitutiveLaw, relative: Array, twist: Array, normal: tuple[Any, ...], distance: Array
) -> tuple[Array, Array]:
    """(n, 6) wrenches of an elastic contact on the second body, in the axes of C2, and its heat flow (n,)."""
    wrench = _rows(normal, len(relative)) * law.force(ramp(-distance))[:, None]
    heat = np.zeros(len(relative))
    for factor, w in losses(gap, law, relative.T, twist.T):
        direction = _rows(w, len(relative))
        rate = np.einsum("ni,ni->n", direction, twist)
        wrench -= direction * (factor * rate)[:, None]
        heat += factor * rate**2
    return wrench, heat


def _turned_back(poses: Array, vectors: Array) -> Array:
    """(n, 3) vectors of the world in the axes of poses (n, 7)."""
    return turned(np.column_stack([poses[:, :1], -poses[:, 1:4], poses[:, 4:]]), vectors)


def _rows(components: Sequence[Any], count: int) -> Array:
    """(n, k) of components that are numbers or (n,)."""
    return np.column_stack([np.broadcast_to(x, count) for x in components])


def _twist(twists: Mapping[str, Array], name: str, count: int) -> Array:
    return np.zeros((count, 6)) if name == GROUND else twists[name]


def _carried(offset: Array, wrench: Array) -> Array:
    """Wrenches (n, 6) in a frame at offsets (n, 7) in a body, as seen in the body."""
    force, moment = turned(offset, wrench[:, 3:]), turned(offset, wrench[:, :3])
    return np.column_stack([moment + np.cross(offset[:, 4:], force), force])
