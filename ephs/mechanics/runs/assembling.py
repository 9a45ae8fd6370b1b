"""Mechanisms in systems without scene: their joints are found in the flat system and assembled.

A joint is a holonomic relation between two frames; frame changes lead from there to bodies, whose momentum is coupled
to a pose, to frames without one, as inside universal joints, or to the ground. Relative poses follow from poses and
poses from relative poses where they are not given; a joint that stays open is refused, as in scenes. Lengths of tendons
follow from both.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from ephs.mechanics.constraints.holding import ConfiguredMechanism
from ephs.mechanics.scene.adjust import mass_roots
from ephs.mechanics.scene.assembly import gyration
from ephs.mechanics.scene.geometry import JointCoupling
from ephs.mechanics.scene.kinematics import AssemblyJoint, extent, spanning_hops
from ephs.mechanics.tree.finding.frames import Frames, frames_of
from ephs.mechanics.tree.finding.tendons import tendon_lengths
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.semantics.primitives.primitives import Reversible
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rank import ASSEMBLY
from ephs.semantics.systems.system import System
from ephs.solve.posing.problem import Problem
from ephs.solve.result.record import RunRecord
from ephs.solve.running.ending import solution_of

OPEN = 1e-6
"""Largest joint residual of given initial states, in rad or parts of the mechanism's length."""
OFF = 1e-3
"""Error allowed in momenta off the joints, in parts of the mechanism's own or of the largest: nodal momenta of some
methods satisfy joints to their order."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class FlatJoints:
    """The joints of a flat system.

    Parameters
    ----------
    links
        Each with its bodies by number, −1 for the ground.
    relative
        Paths of their relative poses.
    poses
        Paths of the poses of bodies, and None of frames without one, by number.
    frames
        Links and joints as they are found in the system.
    """

    links: tuple[AssemblyJoint, ...]
    relative: tuple[Path, ...]
    poses: tuple[Path | None, ...]
    frames: Frames

    @property
    def holding(self) -> bool:
        """Whether a joint holds anything."""
        return any(link.coupling.dim < 6 for link in self.links)


def flat_joints(d: Descriptor) -> FlatJoints:
    """The joints of a flat system between bodies, frames and the ground."""
    found = frames_of(d)
    return FlatJoints(
        tuple(
            AssemblyJoint(
                str(j.path), j.first.link, j.second.link, j.first.offset, j.second.offset, JointCoupling(j.pair)
            )
            for j in found.joints
        ),
        tuple(j.state.path for j in found.joints),
        tuple(None if link.pose is None else link.pose.path for link in found.links),
        found,
    )


def start_of(joints: FlatJoints, system: System, given: Mapping[Path, Array]) -> dict[Path, Array]:
    """Initial states of a mechanism: those that its components carry, but ``given`` ones and what these move.

    Raises
    ------
    AssemblyError
        A joint stays open by more than the tolerance of assembly; it names the joint and the gap.
    """
    places = {path for path in (*joints.poses, *joints.relative) if path is not None}
    carried = system.initial
    placed = not places.isdisjoint(carried) and not places <= given.keys()  # else nothing carried counts
    out = assembled(joints, system.state(), carried) if placed else system.state()
    out |= given
    if not (placed and places.isdisjoint(given)):
        out = assembled(joints, out, given)
    known = {*carried, *given}
    return out | {path: length[None] for path, length in tendon_lengths(joints.frames, out) if path not in known}


def assembled(joints: FlatJoints, state: Mapping[Path, Array], given: Collection[Path]) -> dict[Path, Array]:
    """The states with poses that are not ``given`` set from relative poses, and then these from those.

    Bodies that no joint links to others keep their poses.

    Raises
    ------
    AssemblyError
        A joint stays open by more than the tolerance of assembly; it names the joint and the gap.
    """
    out = dict(state)
    known = {body for body, path in enumerate(joints.poses) if path in given}
    named = {k.name for k, path in zip(joints.links, joints.relative, strict=True) if path in given}
    poses = np.array([SE3.identity() if path is None else out[path] for path in joints.poses]).reshape(-1, 7)
    hops = spanning_hops(joints.links, len(poses), named)
    reached = known | {-1, *range(len(poses))} - {hop.body for hop in hops}
    for hop in hops:
        link = joints.links[hop.link]
        if hop.body not in known and link.other(hop.body) in reached:
            x = out[joints.relative[hop.link]]
            poses[hop.body] = link.placed(hop.body, poses, x)
            reached.add(hop.body)
    for path, pose in zip(joints.poses, poses, strict=True):
        if path is not None:
            out[path] = np.array(pose)
    length = extent(joints.links, poses)[1] or 1.0
    for link, path in zip(joints.links, joints.relative, strict=True):
        stays, loose = path in given, link.coupling.dim == 6
        x = out[path] if stays else link.coupling.fit(link.relative(poses), out[path])
        distance, angle = (0.0, 0.0) if loose and not stays else link.gap(poses, x)  # a loose one follows its bodies
        if distance > ASSEMBLY * length or angle > ASSEMBLY:
            raise AssemblyError("open-joint", link.name, found=f"{distance:.3g} m and {angle:.3g} rad")
        if not stays:
            out[path] = x
    return out


def constraints_of(joints: FlatJoints, problem: Problem) -> ConfiguredMechanism:
    """What the joints of a system hold in its initial state."""
    state, wiring = problem.initial, joints.frames.wiring
    links: list[AssemblyJoint] = []
    for link, joint in zip(joints.links, joints.frames.joints, strict=True):
        port = wiring.outer.get(joint.rate)
        signal = None if port is None else problem.signals.get(port)
        moved = signal is not None and signal.effort and joint.pair.dim == 1
        motion = float(signal.at(0.0, state)[0]) if signal is not None and moved else None
        links.append(replace(link, motion=motion, near=np.array(state[joint.state.path])))
    poses = _placed(joints, state)
    inertias = [link.inertia for link in joints.frames.links]
    heaviest = max(inertias, key=lambda inertia: float(inertia[5, 5]), default=np.eye(6))
    whole = [heaviest if inertia[5, 5] == 0.0 else inertia for inertia in inertias]  # some metric: frames have no mass
    roots = mass_roots(np.array([i[5, 5] for i in whole]), np.array([i[:3, :3] for i in whole]).reshape(-1, 3, 3))
    names = [link.name for link in links if link.coupling.dim < 6]
    return ConfiguredMechanism.between(names, links, poses, roots, _gears(joints))


def _placed(joints: FlatJoints, state: Mapping[Path, Array]) -> Array:
    """(links, 7) poses of bodies, and of frames without one: where the joint before puts them."""
    poses = np.array([SE3.identity() if path is None else state[path] for path in joints.poses]).reshape(-1, 7)
    for hop in spanning_hops(joints.links, len(poses), ()):
        if joints.poses[hop.body] is None:
            link, x = joints.links[hop.link], state[joints.relative[hop.link]]
            poses[hop.body] = link.placed(hop.body, poses, x)
    return poses


def length_of(joints: FlatJoints, state: Mapping[Path, Array]) -> float:
    """The mechanism's own length in m: see `ephs.mechanics.scene.kinematics.Scale`; 1 m of a point."""
    holding = [link for link in joints.links if link.coupling.dim < 6]
    turned = gyration((float(link.inertia[5, 5]), link.inertia[:3, :3]) for link in joints.frames.links)
    return max(extent(holding, _placed(joints, state))[1], turned) or 1.0


def _gears(joints: FlatJoints) -> dict[str, dict[str, float]]:
    """Box of a rigid gear -> joint -> factor of its rate in the sum that vanishes."""
    wiring, out = joints.frames.wiring, dict[str, dict[str, float]]()
    named = {joint.rate: str(joint.path) for joint in joints.frames.joints if joint.pair.dim == 1}
    for number, slot in enumerate(wiring.components):
        primitive, ports = slot.primitive, wiring.ports[number]
        if not isinstance(primitive, Reversible) or primitive.reads or not named.keys() >= set(ports.values()):
            continue
        _, rows = primitive.structure({})
        box = Path(tuple(slot.path)[:-1]) if len(slot.path) > 1 else slot.path
        for k, row in enumerate(rows):
            ratios = zip(ports.values(), row.tolist(), strict=True)
            out[f"{box}" if len(rows) == 1 else f"{box}[{k}]"] = {named[at]: ratio for at, ratio in ratios}
    return out


def check_closed(problem: Problem, momentum: Array, t0: float) -> None:
    """Check given states at t0 s against the joints; ``momentum`` (6,) is of the mechanism's mass, length and rate.

    Raises
    ------
    AssemblyError
        A joint is open, or a momentum contradicts the joints by more than methods leave it off them.
    """
    d = problem.descriptor
    x = problem.point
    once = RunRecord(np.array([t0]), x[None, :], np.zeros((1, len(d.components))), np.zeros((1, 5)))
    assert problem.motion is not None
    motion = problem.motion(solution_of(problem, once, {}))
    if max((float(gap[0]) for gap in motion.gaps(1).values()), default=0.0) > OPEN:
        raise AssemblyError("open-joint", problem.name, found=f"{float(motion.constraint_error()[0]):.1e} m or rad")
    for path, value in motion.state(0).items():
        given = problem.initial[path]
        if value.shape == momentum.shape and path[-1] == "p":
            off = float(np.abs((value - given) / momentum).max()) / max(1.0, float(np.abs(given / momentum).max()))
            if off > OFF:
                raise AssemblyError("off-joint", path, found=off)
