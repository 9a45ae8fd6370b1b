"""Placement: missing positions and velocities of bodies follow from their joints; then every joint is checked.

A body without a position is placed by its first joint with frames in the bodies, at that joint's
coordinate; a body without a velocity likewise, at its rate. What then remains open in a joint is a fault,
unless the scene is adjusted.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from ephs.mechanics.scene.bodies import BodyStart
from ephs.mechanics.scene.errors import Fault, fault
from ephs.mechanics.scene.geometry import body_twist
from ephs.mechanics.scene.joints import Asked
from ephs.mechanics.scene.kinematics import AssemblyJoint, Scale, pose_at
from ephs.mechanics.scene.model import GROUND, Body, Joint, Scene, frozen
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rank import ASSEMBLY

Bodies: TypeAlias = dict[str, Body]
Joints: TypeAlias = dict[str, Joint]
Start: TypeAlias = tuple[Joint, Asked]
"""A joint with the frames that its file has, and what this says of its start."""


def assemble(
    drafts: Sequence[tuple[Body, BodyStart]], joints: Sequence[Start], parts: Mapping[str, Scene], gravity: Array
) -> tuple[Bodies, Joints, list[Fault]]:
    """Bodies and joints in the initial state, and a fault for each joint that does not hold there.

    The bodies of ``parts`` are where they are; joints may name them.
    """
    others = [(f"{part}.{name}", body) for part, scene in parts.items() for name, body in scene.all_bodies()]
    everyone = [*((body.name, body) for body, _ in drafts), *others]
    names = [name for name, _ in everyone]
    index = {name: i for i, name in enumerate(names)} | {GROUND: -1}
    starts = [start for _, start in drafts]
    poses = _place(starts, joints, index, np.array([body.pose for _, body in everyone]).reshape(-1, 7))
    links = [_link(start, index, poses) for start in joints]
    xs = [link.element(poses) for link in links]
    twists = _move(starts, joints, links, xs, poses, np.array([body.twist for _, body in everyone]).reshape(-1, 6))
    bodies = {
        body.name: replace(body, pose=frozen(poses[i]), twist=frozen(twists[i])) for i, (body, _) in enumerate(drafts)
    }
    slips = [link.slip(twists, x) for link, x in zip(links, xs, strict=True)]
    radius = gyration((body.mass, body.inertia) for _, body in everyone)
    scale = Scale.of(links, poses, twists, radius, gravity)
    placed = {
        joint.name: replace(
            joint,
            frame1=frozen(link.frame1),
            frame2=frozen(link.frame2),
            coordinate=frozen(x),
            rate=frozen(rate),
        )
        for (joint, _), link, x, (rate, _) in zip(joints, links, xs, slips, strict=True)
    }
    return bodies, placed, measure(links, xs, poses, slips, names, scale)


def measure(
    links: Sequence[AssemblyJoint],
    xs: Sequence[Array],
    poses: Array,
    slips: Sequence[tuple[Array, Array]],
    names: Sequence[str],
    scale: Scale,
) -> list[Fault]:
    """A fault for each joint that has a gap, a velocity that it does not allow, or another rate than it was
    given; ``slips`` are the links' own."""
    faults: list[Fault] = []
    near, turn, slow = ASSEMBLY * scale.length, ASSEMBLY, ASSEMBLY * scale.rate
    limit = f"{near:.2g} m and {turn:.2g} rad"
    speeds = f"{slow * scale.length:.2g} m/s and {slow:.2g} rad/s"
    for link, x, (rate, residual) in zip(links, xs, slips, strict=True):
        who = " and ".join(names[b] for b in (link.body1, link.body2) if b >= 0)
        key = f"joints.{link.name}"
        distance, angle = link.gap(poses, x)
        if distance > near or angle > turn:
            found = f"a gap of {distance:.3g} m and {angle:.3g} rad"
            faults.append(fault("gap", key, found, who=who, limit=limit))
            continue
        spin, speed = _size(residual[:3]), _size(residual[3:])
        off = None if link.rate is None else link.coupling.basis(x) @ (rate - link.rate)
        apart = off is not None and (_size(off[:3]) > slow or _size(off[3:]) > slow * scale.length)
        if spin > slow or speed > slow * scale.length:
            text = f"velocities that open it by {speed:.3g} m/s and {spin:.3g} rad/s"
            faults.append(fault("velocity", key, text, who=who, limit=speeds))
        elif link.motion is not None and apart:
            text = f"a rate of {rate[0]:.9g}"
            faults.append(fault("motion differs", f"{key}.motion", text, motion=f"{link.motion:.9g}", who=who))
        elif link.rate is not None and apart:
            actual = _text(rate)
            faults.append(fault("rate differs", f"{key}.rate", _text(link.rate), actual=actual, who=who))
    return faults


def _place(starts: Sequence[BodyStart], joints: Sequence[Start], index: Mapping[str, int], poses: Array) -> Array:
    open_bodies = [i for i, start in enumerate(starts) if not start.placed]
    if not open_bodies:
        return poses
    links = {start[0].name: _link(start, index, poses) for start in joints if start[1].in_bodies}

    def follow(body: int, name: str) -> None:
        link = links[name]
        x = link.coupling.identity() if link.coordinates is None else link.coupling.element(link.coordinates)
        poses[body] = link.placed(body, poses, x)

    _place_open(open_bodies, list(links.values()), follow)
    return poses


def _move(
    starts: Sequence[BodyStart],
    joints: Sequence[Start],
    links: Sequence[AssemblyJoint],
    xs: Sequence[Array],
    poses: Array,
    twists: Array,
) -> Array:
    for i, start in enumerate(starts):
        if start.velocities is not None:
            twists[i] = body_twist(poses[i], *start.velocities)
    elements = {link.name: x for link, x in zip(links, xs, strict=True)}
    by_name = {link.name: link for link in links}

    def follow(body: int, name: str) -> None:
        link, x = by_name[name], elements[name]
        rate = np.zeros(link.coupling.dim) if link.rate is None else link.rate
        twists[body] = link.moved(body, twists, x, rate)

    # A joint with `at` and `axis` moves a body only if its rate is specified.
    leading = [
        link
        for (_, asked), link in zip(joints, links, strict=True)
        if asked.in_bodies or (asked.rate is not None and asked.rate.any())
    ]
    _place_open([i for i, start in enumerate(starts) if start.velocities is None], leading, follow)
    return twists


def _place_open(open_bodies: list[int], links: Sequence[AssemblyJoint], follow: Callable[[int, str], None]) -> None:
    """Place each open body by its first link, once the body at the link's other end is settled.

    Where all wait for each other, a body follows any of its links whose other end is settled, or stays
    where it is.
    """
    of: dict[int, list[AssemblyJoint]] = {b: [] for b in open_bodies}
    for link in links:
        for b in dict.fromkeys((link.body1, link.body2)):
            if b in of:
                of[b].append(link)
    waiting = {b: None for b in open_bodies if of[b]}  # in order
    followers: dict[int, list[int]] = {}
    for b in waiting:
        followers.setdefault(of[b][0].other(b), []).append(b)
    ready = deque(b for b in waiting if of[b][0].other(b) not in waiting)
    while waiting:
        if ready:
            body = ready.popleft()
            link = of[body][0]
        else:
            ways = ((b, link) for b in waiting for link in of[b] if link.other(b) not in waiting)
            body, link = next(ways, (next(iter(waiting)), None))
        if link is not None:
            follow(body, link.name)
        del waiting[body]
        ready.extend(b for b in followers.get(body, []) if b in waiting)


def _link(start: Start, index: Mapping[str, int], poses: Array) -> AssemblyJoint:
    joint, asked = start
    link = AssemblyJoint.of(joint, index, coordinates=asked.coordinates, rate=asked.rate)
    if asked.in_bodies:
        return link
    frames = {
        key: SE3.compose(SE3.inverse(pose_at(poses, body)), frame)
        for key, body, frame in (("frame1", link.body1, link.frame1), ("frame2", link.body2, link.frame2))
    }
    return replace(link, coordinates=np.zeros(joint.dim), **frames)


def gyration(bodies: Iterable[tuple[float, Array]]) -> float:
    """The largest radius of gyration in m of bodies with masses and inertias (3, 3); some models have negative ones."""
    squares = (float(np.trace(inertia)) / (2.0 * mass) for mass, inertia in bodies if mass > 0.0)
    return math.sqrt(max((0.0, *squares)))


def _size(vector: Array) -> float:
    return float(np.linalg.norm(vector))


def _text(rate: Array) -> str:
    return f"{rate[0]:.9g}" if rate.shape == (1,) else "[" + ", ".join(f"{entry:.9g}" for entry in rate) + "]"
