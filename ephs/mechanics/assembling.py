"""Mechanisms in systems that no scene was made into: their joints are found in the flat system, and assembled.

A joint is a holonomic relation between two frames; frame changes lead from there to bodies, whose momentum is coupled
to a pose, or to the ground. Relative poses follow from poses and poses from relative poses where they are not given; a
joint that stays open is refused, as in scenes. Joints at frames without a pose, as inside universal joints, are left as
they are.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.batch import compose, inverse
from ephs.mechanics.scene.geometry import Coupling
from ephs.mechanics.scene.kinematics import Link, extent
from ephs.mechanics.scene.tree import spanning_hops
from ephs.mechanics.solve.solution import Solution
from ephs.operad import Path, quantity
from ephs.semantics.bundle import Array
from ephs.semantics.descriptor import Descriptor
from ephs.semantics.errors import AssemblyError
from ephs.semantics.primitives import Storage
from ephs.semantics.spaces import SE3, Pair
from ephs.semantics.spaces.rank import ASSEMBLY

__all__ = ["FlatJoints", "assembled", "flat_joints"]


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
        Paths of the bodies' poses, by number.
    """

    links: tuple[Link, ...]
    relative: tuple[Path, ...]
    poses: tuple[Path, ...]

    def gaps(self, solution: Solution) -> Array:
        """(n,) largest distance in m or angle in rad between where a joint and its bodies put the frame C2."""
        n = len(solution)
        worst = np.zeros(n)
        for link, path in zip(self.links, self.relative, strict=True):
            rows = solution[path].reshape(n, link.coupling.dim)
            inside = np.array([link.coupling.include(link.coupling.element(row)) for row in rows]).reshape(n, 7)
            first, second = (self._frame(solution, body, frame) for body, frame in _ends(link))
            gap = compose(inverse(second), compose(first, inside))
            angle = 2.0 * np.linalg.norm(gap[:, 1:4], axis=1)  # of small ones, and half turns still show
            worst = np.maximum(worst, np.maximum(angle, np.linalg.norm(gap[:, 4:], axis=1)))
        return worst

    def _frame(self, solution: Solution, body: int, frame: Array) -> Array:
        n = len(solution)
        poses = np.tile(SE3.identity(), (n, 1)) if body < 0 else solution[self.poses[body]]
        return compose(poses, np.broadcast_to(frame, (n, 7)))


def _ends(link: Link) -> tuple[tuple[int, Array], tuple[int, Array]]:
    return (link.body1, link.frame1), (link.body2, link.frame2)


def flat_joints(d: Descriptor) -> FlatJoints:
    """The joints of a flat system between bodies with poses, and the ground."""
    places = {slot.efforts[0]: slot.reads[0].path for slot in d.components if _stores_a_pose(slot.primitive)}
    body: dict[int, int] = {}  # effort where a momentum begins -> body
    frames: dict[int, tuple[int, Array]] = {}  # that of a joint frame -> momentum it is carried from, offset
    poses: list[Path] = []
    for slot in d.components:
        name, of = slot.primitive.name, slot.primitive.bundle
        first = {port: slot.efforts[where.start] for port, where, _ in of.items() if where.stop > where.start}
        kinds = {port: quantity for port, _, quantity in of.items()}
        if name == "pkc":
            pose = next((e for port, e in first.items() if kinds[port].kind == "pose"), None)
            carried = next((e for port, e in first.items() if kinds[port] == quantity.body_momentum), None)
            if pose in places and carried is not None:
                body[carried] = len(poses)
                poses.append(places[pose])
        elif name == "ground":
            body.update(dict.fromkeys(first.values(), -1))
        elif name == "frame_change":
            offset = np.array(dict(slot.primitive.parameters)["offset"], dtype=float)
            inner = next(port for port in first if str(port).startswith("p_j"))
            outer = next(port for port in first if port != inner)
            frames[first[inner]] = first[outer], offset
    links: list[Link] = []
    relative: list[Path] = []
    for slot in d.components:
        kernel = slot.primitive.kernel
        if kernel is None or kernel.name != "holonomic":  # others have offsets folded in by a reduction
            continue
        first = {str(port): slot.efforts[w.start] for port, w, _ in slot.primitive.bundle.items() if w.stop > w.start}
        if not {"p_j1", "p_j2"} <= first.keys():  # a reduction dropped the end that rests
            continue
        ends = [frames.get(first[port], (first[port], SE3.identity())) for port in ("p_j1", "p_j2")]
        if any(momentum not in body for momentum, _ in ends):
            continue
        (one, frame1), (two, frame2) = ends
        state = slot.reads[0]
        coupling = Coupling(Pair.from_space(state.quantity.space))
        links.append(Link(str(Path(tuple(slot.path)[:-1])), body[one], body[two], frame1, frame2, coupling))
        relative.append(state.path)
    return FlatJoints(tuple(links), tuple(relative), tuple(poses))


def _stores_a_pose(primitive: object) -> bool:
    return isinstance(primitive, Storage) and [q.kind for _, _, q in primitive.bundle.items()] == ["pose"]


def assembled(joints: FlatJoints, state: Mapping[Path, Array], given: Collection[Path]) -> dict[Path, Array]:
    """The states with poses that are not ``given`` set from relative poses, and then these from those.

    Raises
    ------
    AssemblyError
        A joint stays open by more than the tolerance of assembly; it names the joint and the gap.
    """
    out = dict(state)
    known = {body for body, path in enumerate(joints.poses) if path in given}
    named = {k.name for k, path in zip(joints.links, joints.relative, strict=True) if path in given}
    poses = np.array([out[path] for path in joints.poses]).reshape(-1, 7)
    reached = known | {-1}
    for hop in spanning_hops(joints.links, len(poses), named):
        link = joints.links[hop.link]
        if hop.body not in known and (link.body1 if hop.forward else link.body2) in reached:
            x = out[joints.relative[hop.link]]
            poses[hop.body] = link.place_second(poses, x) if hop.forward else link.place_first(poses, x)
            reached.add(hop.body)
    for path, pose in zip(joints.poses, poses, strict=True):
        out[path] = np.array(pose)
    length = extent(joints.links, poses)[1] or 1.0
    for link, path in zip(joints.links, joints.relative, strict=True):
        x = out[path] if path in given else link.coupling.fit(link.relative(poses), out[path])
        distance, angle = link.gap(poses, x)
        if distance > ASSEMBLY * length or angle > ASSEMBLY:
            raise AssemblyError("open-joint", link.name, found=f"{distance:.3g} m and {angle:.3g} rad")
        if path not in given:
            out[path] = x
    return out
