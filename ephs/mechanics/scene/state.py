"""A scene in another state: along its joint coordinates, adjusted to close, or taken from a solution."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from ephs.mechanics.scene.adjust import close_loops, mass_roots, project_velocities
from ephs.mechanics.scene.adjustment import Adjustment, Changed, Displacement
from ephs.mechanics.scene.assembly import gyration, measure
from ephs.mechanics.scene.build import component_path, initial_state, scene_system
from ephs.mechanics.scene.custom import Element
from ephs.mechanics.scene.errors import Fault, SceneError, fault, unknown_name
from ephs.mechanics.scene.following import stretched, tied
from ephs.mechanics.scene.gears import Gear
from ephs.mechanics.scene.geometry import body_twist
from ephs.mechanics.scene.joints import Asked
from ephs.mechanics.scene.kinematics import AssemblyJoint, Scale, elements, largest_gap, largest_slip, spanning_hops
from ephs.mechanics.scene.model import GROUND, KINDS, Body, Joint, Scene, frozen, mapped
from ephs.mechanics.scene.registry import REGISTERED
from ephs.mechanics.scene.shells import ShellSheet
from ephs.mechanics.scene.site import moved
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Storage
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces import rotations as so3
from ephs.semantics.spaces.rank import ASSEMBLY
from ephs.semantics.systems.initial import saved_at
from ephs.semantics.systems.kept import once

# Elements of registered sections in the states of a solution.

NEAR = 1e-6
"""Largest difference of an element's start from a state that it goes on from, relative to one plus its size."""


def inner_states(section: str, name: str, states: Mapping[Path, Array]) -> dict[str, Array]:
    """States of an element's boxes, by their paths below its own."""
    at = tuple(component_path(section, name))
    return {".".join(path[len(at) :]): value for path, value in states.items() if tuple(path[: len(at)]) == at}


def lost_states(scene: Scene, states: Mapping[Path, Array]) -> Iterator[Fault]:
    """Faults of elements that do not start in the states of a solution."""
    own = [*scene.all_elements(), *(("shells", name, of) for name, of in scene.all_shells())]
    if not own:
        return
    start, system = initial_state(scene), scene_system(scene)
    counted = {path for path, of in system.leaves() if isinstance(of, Storage) and of.environment}
    for section, name, _ in own:
        at = component_path(section, name)
        for inner, value in inner_states(section, name, states).items():
            path = Path([*at, *inner.split(".")])
            given = start[path]
            apart = _apart(given, value)
            if Path(path[:-1]) not in counted and apart > NEAR * (1.0 + float(np.abs(value).max(initial=0.0))):
                yield fault("not continued", f"{section}.{name}", f"the state {inner} = {value.tolist()}")


def _apart(given: Array, value: Array) -> float:
    """Largest difference; the quaternions q and −q are one rotation."""
    other = np.concatenate([-value[:4], value[4:]]) if value.size in (4, 7) else value
    return min(float(np.abs(given - each).max(initial=0.0)) for each in (value, other))


MOVED = 1e-12
"""Least reported change of a body's state in m, rad, m/s, rad/s: rounding of poses of size one."""


# Largest joint displacement per closing of the loops, rad or m.
STRIDE = 0.2


@final
@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """A scene's bodies as arrays, parts included, and its joints between them; the implicit free joints
    come last."""

    names: tuple[str, ...]
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    links: tuple[AssemblyJoint, ...]
    poses: Array
    twists: Array

    @staticmethod
    def of(scene: Scene) -> "Snapshot":
        """The snapshot of a scene."""
        pairs = list(scene.all_bodies())
        index = {name: i for i, (name, _) in enumerate(pairs)} | {GROUND: -1}
        joints = [j for _, j in scene.all_joints()] + [j for _, j in scene.implicit_joints()]
        bodies = tuple(body for _, body in pairs)
        return Snapshot(
            tuple(name for name, _ in pairs),
            bodies,
            tuple(joints),
            tuple(AssemblyJoint.of(j, index, near=np.array(j.coordinate)) for j in joints),
            np.array([body.pose for body in bodies]).reshape(-1, 7),
            np.array([body.twist for body in bodies]).reshape(-1, 6),
        )

    def coordinates(self) -> dict[str, Array]:
        """Coordinates (d,) of all joints."""
        pairs = zip(self.links, self.joints, strict=True)
        return {k.name: k.coupling.coordinates(np.asarray(j.coordinate)) for k, j in pairs}

    def roots(self) -> Array:
        """The bodies' inverse root inertias, the metric of every adjustment."""
        n = len(self.bodies)
        inertias = np.array([body.inertia for body in self.bodies]).reshape(n, 3, 3)
        return mass_roots(np.array([body.mass for body in self.bodies]), inertias)

    def scale(self, gravity: Array) -> Scale:
        """The length and rate by which gaps and velocities are measured."""
        radius = gyration((body.mass, body.inertia) for body in self.bodies)
        return Scale.of(self.links, self.poses, self.twists, radius, gravity)


def scale_of(scene: Scene) -> Scale:
    """The length and rate of a scene, made once."""
    return once(scene, "scale", lambda: Snapshot.of(scene).scale(scene.world.gravity))


def with_state(
    scene: Scene, coordinates: Mapping[str, ArrayLike], rates: Mapping[str, ArrayLike], adjust: bool
) -> Scene:
    """See `Scene.with_state`."""
    now, where = Snapshot.of(scene), scene.source or scene.name
    wanted = _given(now, coordinates, "coordinates", where)
    speeds = _given(now, rates, "rates", where)
    wanted = tied(scene, now.coordinates(), wanted)
    speeds = tied(scene, {j.name: np.asarray(j.rate) for j in now.joints}, speeds)
    links = [replace(k, coordinates=wanted.get(k.name), rate=speeds.get(k.name)) for k in now.links]

    before = [np.asarray(j.coordinate) for j in now.joints]
    poses, xs = _carry(links, now.poses, before)
    scale = now.scale(scene.world.gravity)
    if adjust and largest_gap(links, poses, xs, scale) > ASSEMBLY:
        poses, xs = _carry_closed(links, now, before, scale) or (poses, xs)

    twists = now.twists.copy()
    for hop in spanning_hops(links, len(poses), speeds):
        rate = speeds.get(hop.name, now.joints[hop.link].rate)
        link, x = links[hop.link], xs[hop.link]
        twists[hop.body] = link.moved(hop.body, twists, x, rate)
    scale = replace(now, poses=poses, twists=twists).scale(scene.world.gravity)
    if adjust and largest_slip(links, twists, xs, scale) > ASSEMBLY:
        moved = project_velocities(links, poses, twists, now.roots(), frozenset(speeds), scale)
        twists = twists if moved is None else moved

    slips = [link.slip(twists, x) for link, x in zip(links, xs, strict=True)]
    scale = replace(now, poses=poses, twists=twists).scale(scene.world.gravity)
    faults = measure(links, xs, poses, slips, now.names, scale)
    if faults:
        raise SceneError(where, faults)
    return rebuilt(scene, now, poses, twists, xs)


def adjusted(scene: Scene, asked: Mapping[str, Asked]) -> tuple[Scene, list[Fault]]:
    """The nearest consistent state of a scene, with a report of what moved, if anything had to.

    Prescribed motions, and coordinates and rates that are ``asked`` of joints, are kept, and the bodies' poses and
    velocities give way; where they contradict each other, they give way, too, which the report says.
    """
    now = Snapshot.of(scene)
    scale, roots = now.scale(scene.world.gravity), now.roots()
    links = [_asked(link, asked.get(link.name)) for link in now.links]
    xs = elements(links, now.poses)
    gap, slip = largest_gap(links, now.poses, xs), largest_slip(links, now.twists, xs)
    consistent = largest_gap(links, now.poses, xs, scale) <= ASSEMBLY
    if consistent and largest_slip(links, now.twists, xs, scale) <= ASSEMBLY:
        return rebuilt(scene, now, now.poses, now.twists, xs), []
    poses = now.poses if consistent else _nearest(now, links, scale)
    if poses is None:
        worst = max(zip(links, xs, strict=True), key=lambda pair: max(pair[0].gap(now.poses, pair[1])))[0]
        who = " and ".join(now.names[b] for b in (worst.body1, worst.body2) if b >= 0)
        return scene, [fault("no assembly", f"joints.{worst.name}", f"a largest gap of {gap:.3g}", who=who)]
    given = np.array([_carried(u, q0, q1) for u, q0, q1 in zip(now.twists, now.poses, poses, strict=True)])
    twists: Array | None = given
    here = [replace(link, coordinates=None) for link in links]
    if largest_slip(here, given, elements(here, poses), scale) > ASSEMBLY:
        held = frozenset(link.name for link in here if link.rate is not None)
        twists = project_velocities(here, poses, given, roots, held, scale)
        if twists is None and held:
            twists = project_velocities(here, poses, given, roots, frozenset(), scale)
    if twists is None:
        return scene, [fault("no motion", "joints", f"a velocity residual of {slip:.3g}")]
    xs = elements(now.links, poses)
    report = Adjustment(
        gap, slip, tuple(_displacements(now, poses, given, twists)), tuple(_changes(links, xs, twists, scale))
    )
    return moved(replace(rebuilt(scene, now, poses, twists, xs), adjusted=report), scene), []


def _asked(link: AssemblyJoint, asked: Asked | None) -> AssemblyJoint:
    return link if asked is None else replace(link, coordinates=asked.coordinates, rate=asked.rate)


def _nearest(now: Snapshot, links: Sequence[AssemblyJoint], scale: Scale) -> Array | None:
    """The nearest poses that close all joints, those with coordinates at these; without, where these cannot be."""
    roots, held = now.roots(), frozenset(link.name for link in links if link.coordinates is not None)
    closed = close_loops(links, now.poses, roots, held, scale)
    if closed is None and held:
        closed = close_loops(now.links, now.poses, roots, frozenset(), scale)
        if closed is not None:
            there = replace(now, poses=closed)
            carried = _carry_closed(links, there, elements(now.links, closed), scale)
            closed = closed if carried is None else carried[0]
    return closed


def _changes(links: Sequence[AssemblyJoint], xs: Sequence[Array], twists: Array, scale: Scale) -> Iterable[Changed]:
    for link, x in zip(links, xs, strict=True):
        rate = link.slip(twists, x)[0]
        for what, wanted, found, unit in (
            ("coordinate", link.coordinates, link.coupling.coordinates(x), 1.0),
            ("rate", link.rate, rate, scale.rate),
        ):
            size = max(unit, unit * scale.length)
            if wanted is not None and np.abs(found - wanted).max(initial=0.0) > 100.0 * ASSEMBLY * size:
                yield Changed(link.name, what, tuple(map(float, wanted)), tuple(map(float, found)))


def rebuilt(scene: Scene, now: Snapshot, poses: Array, twists: Array, xs: Sequence[Array]) -> Scene:
    """The scene with its bodies in another configuration, its joints at these elements, rates to match."""
    bodies = {n: (frozen(q), frozen(u)) for n, q, u in zip(now.names, poses, twists, strict=True)}
    joints = {link.name: (frozen(x), frozen(link.slip(twists, x)[0])) for link, x in zip(now.links, xs, strict=True)}

    def body(path: str, b: Body) -> Body:
        pose, twist = bodies[path + b.name]
        return replace(b, pose=pose, twist=twist)

    def joint(path: str, j: Joint) -> Joint:
        coordinate, rate = joints[path + j.name]
        return replace(j, coordinate=coordinate, rate=rate)

    before = now.coordinates()
    after = {k.name: k.coupling.coordinates(x) for k, x in zip(now.links, xs, strict=True)}

    def gear(path: str, g: Gear) -> Gear:
        return stretched(g, path, before, after)

    index = {name: i for i, name in enumerate(now.names)}

    def sheet(path: str, of: ShellSheet) -> ShellSheet:
        ends = {name: index[path + name] for name in of.named("side") if path + name in index}
        gone = {name: i for name, i in ends.items() if not np.allclose(poses[i], now.poses[i], MOVED, MOVED)}
        motions = {name: SE3.compose(poses[i], SE3.inverse(now.poses[i])) for name, i in gone.items()}
        return of.carried(motions) if motions else of

    return moved(mapped(scene, {"bodies": body, "joints": joint, "gears": gear, "shells": sheet}), scene)


def at_solution(scene: Scene, solution: Any, time: float) -> Scene:
    """See `Scene.at`."""
    times = np.asarray(solution.t)
    k = saved_at(times, time)
    if k is None:
        raise SceneError(scene.name, [fault("no time", "time", time, first=times[0], last=times[-1])])
    now, named = Snapshot.of(scene), {name for name, _ in scene.all_joints()}
    poses, twists = now.poses.copy(), now.twists.copy()
    for i, name in enumerate(now.names):
        body = solution.body(name)
        poses[i] = np.concatenate((body.quaternion[k], body.position[k]))
        twists[i] = body_twist(poses[i], body.velocity[k], body.angular_velocity[k])
    links = [
        replace(link, near=link.coupling.element(np.asarray(solution.joint(link.name).coordinate[k])))
        if link.name in named
        else link
        for link in now.links
    ]
    there = rebuilt(scene, now, poses, twists, elements(links, poses))
    heat = {name: float(solution.thermal(name).temperature[k]) for name, _ in scene.all_thermal()}
    states = solution.state_at(k)
    found = resumed(
        mapped(there, {"thermal": lambda path, node: replace(node, temperature=heat[path + node.name])}), states
    )
    if faults := list(lost_states(found, states)):
        raise SceneError(scene.name, faults)
    return moved(found, scene)


def resumed(scene: Scene, states: Mapping[Path, Array]) -> Scene:
    """The scene with the states of elements of their own where states of its system have them."""

    def continued(section: str) -> Callable[[str, Any], Any]:
        return lambda path, of: of.continued(inner_states(section, path + of.name, states))

    own = {section for section, kind in {**KINDS, **REGISTERED}.items() if kind.continued is not Element.continued}
    return mapped(scene, {section: continued(section) for section in own})


def _given(now: Snapshot, values: Mapping[str, ArrayLike], what: str, where: str) -> dict[str, Array]:
    """The values by joint, each (d,) and finite."""
    dims = {link.name: link.coupling.dim for link in now.links}
    found: dict[str, Array] = {}
    faults: list[Fault] = []
    for name, value in values.items():
        if name not in dims:
            faults += unknown_name("joint", name, dims).faults
            continue
        array = np.atleast_1d(np.asarray(value, dtype=np.float64))
        if array.shape != (dims[name],):
            text = f"{dims[name]} numbers" if dims[name] != 1 else "a number"
            faults.append(fault("state length", f"{what}.{name}", f"shape {array.shape}", what=text))
        elif not np.isfinite(array).all():
            faults.append(fault("finite", f"{what}.{name}", array.tolist()))
        found[name] = array
    if faults:
        raise SceneError(where, faults)
    return found


def _carry(links: Sequence[AssemblyJoint], poses: Array, before: Sequence[Array]) -> tuple[Array, list[Array]]:
    """Poses and joint elements when the tree's joints go to their coordinates, or stay where they were."""
    poses = poses.copy()
    named = {link.name for link in links if link.coordinates is not None}
    for hop in spanning_hops(links, len(poses), named):
        link = links[hop.link]
        x = before[hop.link] if link.coordinates is None else link.coupling.element(link.coordinates)
        poses[hop.body] = link.placed(hop.body, poses, x)
    return poses, elements(links, poses)


def _carry_closed(
    links: Sequence[AssemblyJoint], now: Snapshot, before: Sequence[Array], scale: Scale
) -> tuple[Array, list[Array]] | None:
    """The same with every loop closed, in small steps so that the mechanism keeps its way of assembly."""
    held = frozenset(link.name for link in links if link.coordinates is not None)
    starts = [link.coupling.coordinates(x) for link, x in zip(links, before, strict=True)]
    ends = [start if k.coordinates is None else k.coordinates for k, start in zip(links, starts, strict=True)]
    far = max((float(np.abs(b - a).max(initial=0.0)) for a, b in zip(starts, ends, strict=True)), default=0.0)
    steps = max(1, int(np.ceil(far / STRIDE)))
    roots, poses, xs = now.roots(), now.poses, list(before)
    for step in range(1, steps + 1):
        here = [
            replace(k, near=x, coordinates=None if k.coordinates is None else a + (b - a) * (step / steps))
            for k, x, a, b in zip(links, xs, starts, ends, strict=True)
        ]
        closed = close_loops(here, _carry(here, poses, xs)[0], roots, held, scale)
        if closed is None:
            return None
        poses, xs = closed, elements(here, closed)
    return poses, xs


def _carried(twist: Array, before: Array, after: Array) -> Array:
    """The twist whose velocity is the same in the world after the body was turned."""
    velocity = so3.quaternion_to_matrix(before[:4]) @ twist[3:]
    return body_twist(after, velocity, twist[:3])


def _displacements(now: Snapshot, poses: Array, given: Array, twists: Array) -> Iterable[Displacement]:
    for i, name in enumerate(now.names):
        turn = SE3.log(SE3.compose(SE3.inverse(now.poses[i]), poses[i]))[:3]
        spin, speed = twists[i, :3] - given[i, :3], twists[i, 3:] - given[i, 3:]
        sizes = [float(np.linalg.norm(v)) for v in (poses[i, 4:] - now.poses[i, 4:], turn, speed, spin)]
        if max(sizes) > MOVED:
            yield Displacement(name, *sizes)
