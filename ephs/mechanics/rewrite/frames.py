"""Joints and bodies found in a flat system: the frames and offsets of each joint.

Everything is read from the structures themselves, so that it is found before and after folding.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.rewrite.folding import transformations
from ephs.mechanics.rewrite.rewrite import SystemDraft
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Primitive, Reversible, Storage
from ephs.semantics.primitives.pullback import pulled_ports
from ephs.semantics.spaces import SE3, Pair
from ephs.semantics.spaces.rotations import matrix_to_quaternion

State = Mapping[Path, Array]
CONSTRAINED = "holonomic"


@final
@dataclass(frozen=True, slots=True, eq=False)
class DraftJoint:
    """A joint's relation in a draft.

    Parameters
    ----------
    box
        That of its relation.
    ends
        The junctions of the bodies' momenta; None for the ground.
    offsets
        (7,) poses of the joint frames in the bodies.
    relative
        Path of the state of its relative pose.
    """

    box: Path
    ends: tuple[Path | None, Path | None]
    offsets: tuple[Array, Array]
    pair: Pair
    relative: Path

    def across(self, pose: Array, state: State, *, forward: bool) -> Array:
        """The pose of the body at the other end: q₁ o₁ I(q_r) = q₂ o₂."""
        x = self.pair.include(state[self.relative])
        near, far = self.offsets if forward else self.offsets[::-1]
        step = x if forward else SE3.inverse(x)
        return SE3.normalise(SE3.compose(SE3.compose(SE3.compose(pose, near), step), SE3.inverse(far)))


@final
@dataclass(frozen=True, slots=True, eq=False)
class DraftBody:
    """A body in a draft: the junctions of its momentum and pose, their coupling, and its storages' paths."""

    momentum: Path
    pose: Path
    coupling: Path
    potential: Path

    @property
    def state(self) -> Path:
        """Path of the pose."""
        return self.potential / "q"


def bodies(draft: SystemDraft) -> dict[Path, DraftBody]:
    """The bodies that keep a pose, by the junction of their momentum."""
    out: dict[Path, DraftBody] = {}
    for box, part in draft.fillings.items():
        if part.name != "pkc" or not isinstance(part, Reversible):
            continue
        ports = {part.interface[port].quantity.kind: draft.wires[box][port].junction for port in part.bundle.ports}
        if set(ports) == {"pose", "momentum"} and (storage := draft.stored(ports["pose"])) is not None:
            out[ports["momentum"]] = DraftBody(ports["momentum"], ports["pose"], box, storage)
    return out


def joints(draft: SystemDraft) -> Iterator[DraftJoint]:
    """The joints whose relative pose is stored."""
    for box, part in draft.fillings.items():
        if part.name == CONSTRAINED and (found := joint_at(draft, box)) is not None:
            yield found


def joint_at(draft: SystemDraft, box: Path) -> DraftJoint | None:
    """The joint of a box; None where there is none, or its ends are no frames at constant offsets."""
    part = draft.fillings.get(box)
    if part is None or part.name != CONSTRAINED or part.kernel is None:
        return None
    read = Path.of("q_r")
    source = draft.stored(draft.wires[box][read].junction)
    if source is None:
        return None
    matrices = [matrix for *_, matrix in pulled_ports(part.kernel)] or [np.eye(6), np.eye(6)]
    ends: list[Path | None] = []
    offsets: list[Array] = []
    for port, first in zip((Path.of("p_j1"), Path.of("p_j2")), matrices, strict=False):
        if port not in draft.wires[box]:  # on the ground, at the previously folded offset
            ends.append(None)
            offsets.append(_offset(_folded(part, port)))
            continue
        matrix, junction = first, draft.wires[box][port].junction
        end: Path | None = junction
        if len(draft.on(junction)) == 2:  # behind an offset of its own
            for step, there in transformations(draft, junction):
                matrix, end = (matrix @ step if step.shape[1] else matrix), there
        if end is not None and any(there is None for _, there in transformations(draft, end)):
            end = None
        ends.append(end)
        offsets.append(_offset(matrix))
    space = part.interface[read].quantity.space
    return DraftJoint(box, (ends[0], ends[1]), (offsets[0], offsets[1]), Pair.from_space(space), source / "q_r")


def _folded(part: Primitive, port: Path) -> Array:
    """The product of the maps folded into a port, except the last, which has no efforts."""
    out = np.eye(6)
    for name, numbers in part.parameters:
        if name == f"T {port}" and isinstance(numbers, tuple) and len(numbers) == 36:
            out = out @ np.array(numbers).reshape(6, 6)
    return out


def _offset(matrix: Array) -> Array:
    """The pose o with Ad_{o⁻¹} = matrix."""
    turn = matrix[:3, :3]
    cross = matrix[3:, :3] @ turn.T
    at = np.array([cross[2, 1], cross[0, 2], cross[1, 0]])
    return SE3.normalise(SE3.inverse(np.concatenate([matrix_to_quaternion(turn), at])))


def reach(draft: SystemDraft, start: Path, known: set[Path | None]) -> tuple[tuple[DraftJoint, bool], ...] | None:
    """Joints from a known frame to a body, each with whether it is passed from its first to its second body."""
    at: dict[Path | None, list[tuple[DraftJoint, bool, Path | None]]] = {}
    for joint in joints(draft):
        one, two = joint.ends
        at.setdefault(one, []).append((joint, True, two))
        at.setdefault(two, []).append((joint, False, one))
    queue: list[tuple[Path | None, tuple[tuple[DraftJoint, bool], ...]]] = [(start, ())]
    seen: set[Path | None] = {start}
    while queue:
        here, way = queue.pop(0)
        for joint, leaving, there in at.get(here, []):
            if there in seen:
                continue
            # found from the body outwards, evaluated from the known frame inwards
            longer = ((joint, not leaving), *way)
            if there in known:
                return longer
            seen.add(there)
            queue.append((there, longer))
    return None


def anchor(way: tuple[tuple[DraftJoint, bool], ...]) -> Path | None:
    """The frame at which a way begins."""
    joint, forward = way[0]
    return joint.ends[0] if forward else joint.ends[1]


def inertia_at(draft: SystemDraft, momentum: Path) -> Array | None:
    """(6, 6) inertia of the quadratic storage of a momentum; None where there is none."""
    for box, _ in draft.on(momentum):
        part = draft.fillings[box]
        if isinstance(part, Storage) and part.kernel is not None and part.kernel.name == "quadratic":
            return np.linalg.inv(np.array(part.kernel.parameters).reshape(6, 6))
    return None
