"""Links and joints of a flat system, by its structure: no names are read, and nesting does not matter.

A link is a momentum of the body's kind with what moves along with it at constant offsets; a joint is a holonomic
relation between the frames of two links, with the junctions of its relative pose and of its momentum.
"""

from collections import Counter, deque
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.tree.finding.roles import Role, offset_of, role_of
from ephs.mechanics.tree.finding.wiring import Incidence
from ephs.operad import Path, quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import Descriptor, StateSlot
from ephs.semantics.primitives.primitives import Primitive
from ephs.semantics.spaces import SE3, Pair
from ephs.semantics.systems.kept import once

GROUND = -1
"""Number of the ground among links."""
KINETIC = 1e-14
"""Relative difference, times the condition number, below which an energy counts as one about a centre of mass."""


@final
class Unplaced(ValueError):
    """A component that has no place in joint coordinates: its path, and why."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(f"{str(path) if tuple(path) else 'the system'} {reason}")
        self.path, self.reason = path, reason

    def __reduce__(self) -> tuple[object, ...]:
        return (Unplaced, (self.path, self.reason))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A frame of a link, −1 for the ground, at an offset (7,)."""

    link: int
    offset: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A body, or a frame without mass.

    Parameters
    ----------
    path
        Of the box that it lies in: what solutions and messages call it; None for a frame of nothing.
    inertia
        (6, 6) about the centre of mass in the link's axes.
    potential
        Component that stores its pose; −1 where none does.
    pose, momentum
        States of its pose and momentum, None where they are not stored.
    """

    path: Path | None
    inertia: Array
    potential: int
    pose: StateSlot | None
    momentum: StateSlot | None

    @property
    def light(self) -> bool:
        """Whether it has no mass."""
        return not self.inertia[5, 5] > 0.0


@final
@dataclass(frozen=True, slots=True, eq=False)
class LinkJoint:
    """A joint between two links.

    Parameters
    ----------
    path
        Of the box that it lies in.
    relation
        Component of its relation.
    potential, state
        Component that stores its relative pose, and that state.
    rate
        Junction of its momentum.
    """

    path: Path
    relation: int
    first: Frame
    second: Frame
    pair: Pair
    potential: int
    state: StateSlot
    rate: int


@final
@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """Links and joints of a flat system.

    Parameters
    ----------
    links
        Bodies in the order of their components, then frames without mass.
    frames
        Junction of a momentum -> the frame that it belongs to.
    placed
        Components that links and joints are made of.
    roles
        (components,) role of each.
    faults
        Bodies and joints that are not whole, and bodies that are joined without a joint.
    """

    wiring: Incidence
    links: tuple[Link, ...]
    joints: tuple[LinkJoint, ...]
    frames: dict[int, Frame]
    placed: frozenset[int]
    roles: tuple[Role, ...]
    faults: tuple[Unplaced, ...]


def frames_of(descriptor: Descriptor) -> Frames:
    """The links and joints of a flat system."""
    return once(descriptor, "frames", lambda: _Finder(descriptor).found())


@final
class _Finder:
    def __init__(self, descriptor: Descriptor) -> None:
        self.wiring, n = Incidence.of(descriptor), descriptor.numbering
        roles = [role_of(primitive) for primitive in n.primitives]
        self.roles = tuple(roles[i] for i in n.primitive.tolist())
        self.placed: set[int] = set()
        self.faults: list[Unplaced] = []
        self.frames: dict[int, Frame] = {}
        self.links: list[Link] = []
        self._through: dict[int, int] = {}  # junction -> the offset by which it was reached
        self._inertias: dict[tuple[int, int], Array | None] = {}  # by kernel and parameters, which equal bodies share
        self._shared = Counter(map(self._around, [*self._with(Role.POSE), *self._with(Role.KINETIC)]))
        self._of_joints = Counter(map(self._around, self._with(Role.JOINT)))
        self._beside: dict[int, list[tuple[int, int, bool]]] = {}
        for number in self._with(Role.OFFSET):
            outer, inner = self.wiring.ports[number].values()
            self._beside.setdefault(outer, []).append((number, inner, True))
            self._beside.setdefault(inner, []).append((number, outer, False))

    def found(self) -> Frames:
        for number in self._with(Role.GROUND):
            self._carry(next(iter(self.wiring.ports[number].values())), GROUND, number)
        bodies: set[int] = set()
        for number, role in enumerate(self.roles):
            if role in (Role.KINETIC, Role.COUPLING, Role.GYROSCOPIC):
                at = self._momentum(number)
                if at is not None and at not in bodies:
                    bodies.add(at)
                    self._carry(at, len(self.links), number)
                    self.links.append(self._link(at))
        relations = self._with(Role.JOINT)
        for number in relations:
            for port in ("p_j1", "p_j2"):
                self._bare(self.wiring.ports[number][port], number)
        joints = tuple(joint for number in relations if (joint := self._joint(number)) is not None)
        self.placed |= set(self._with(Role.GROUND)) | set(self._with(Role.OFFSET))
        return Frames(
            self.wiring, tuple(self.links), joints, self.frames, frozenset(self.placed), self.roles, tuple(self.faults)
        )

    def _with(self, role: Role) -> list[int]:
        return [number for number, found in enumerate(self.roles) if found is role]

    def _momentum(self, number: int) -> int | None:
        """Junction of the body's momentum of a component."""
        slot = self.wiring.components[number]
        for port, _, of in slot.primitive.bundle.items():
            if of == quantity.body_momentum:
                return self.wiring.ports[number][str(port)]
        return None

    def _carry(self, junction: int, link: int, number: int) -> None:
        """Give the frames at constant offsets from a junction to a link, but for those that belong to another."""
        queue = deque([(junction, SE3.identity(), number)])
        passed: set[int] = set()
        while queue:
            here, offset, by = queue.popleft()
            if here in self.frames:
                self._fault(self._through.get(here, by), "joins two bodies, or a body and the ground, without a joint")
                continue
            self.frames[here] = Frame(link, offset)
            if here != junction:
                self._through[here] = by
            for number, there, outwards in self._beside.get(here, []):
                step = offset_of(self.wiring.components[number].primitive)
                if number in passed or step is None:
                    continue
                passed.add(number)
                step = step if outwards else SE3.inverse(step)
                queue.append((there, step if here == junction else SE3.compose(offset, step), number))

    def _link(self, junction: int) -> Link:
        """The body whose momentum a junction is."""
        inertia, potential, pose, momentum, turning = np.zeros((6, 6)), -1, None, None, None
        mine: list[int] = []
        for number, port in self.wiring.on[junction]:
            role, slot = self.roles[number], self.wiring.components[number]
            if role is Role.KINETIC:
                key = id(slot.primitive.kernel), id(slot.primitive.parameters)
                if key not in self._inertias:
                    self._inertias[key] = inertia_of(slot.primitive)
                found = self._inertias[key]
                if found is None:
                    self._fault(number, "is no kinetic energy about a centre of mass")
                    continue
                inertia, momentum = found, slot.reads[0]
            elif role is Role.GYROSCOPIC:
                turning = number
            elif role is Role.COUPLING:
                (at,) = (j for p, j in self.wiring.ports[number].items() if p != port)
                stored = self.wiring.stored(at)
                if pose is not None or stored is None or self.roles[stored[0]] is not Role.POSE:
                    self._fault(number, "couples a body to no pose, or to a second one")
                    continue
                potential, pose = stored
                mine.append(potential)
            else:
                continue
            mine.append(number)
        if (turning is None) != (momentum is None):
            self._fault(mine[0], "belongs to a body without kinetic energy, or without gyroscopic forces")
        self.placed |= set(mine)
        box = self._box(potential if potential >= 0 else mine[0], self._shared, 2) if mine else None
        return Link(box, inertia, potential, pose, momentum)

    def _bare(self, junction: int, number: int) -> None:
        """Make a junction a frame without mass where it belongs to no link yet."""
        if junction in self.frames:
            return
        above, passed = junction, {junction}
        while ways := [there for _, there, outwards in self._beside.get(above, []) if not outwards]:
            above = ways[0]
            if above in passed:  # offsets in a circle
                break
            passed.add(above)
        self._carry(above, len(self.links), number)
        self.links.append(Link(None, np.zeros((6, 6)), -1, None, None))

    def _joint(self, number: int) -> LinkJoint | None:
        """The joint of a relation; None where it is not whole."""
        wiring, ports = self.wiring, self.wiring.ports[number]
        state, rate = wiring.components[number].reads[0], ports["p_r"]
        for other, port in wiring.neighbours(rate, number):
            if self.roles[other] is Role.COUPLING:
                (at,) = (j for p, j in wiring.ports[other].items() if p != port)
                stored = wiring.stored(at)
                known = stored is not None and self.roles[stored[0]] in (Role.RELATIVE, Role.SEVERAL)
                if stored is not None and known and stored[1].path == state.path:
                    self.placed |= {number, other, stored[0]}
                    first, second = self.frames[ports["p_j1"]], self.frames[ports["p_j2"]]
                    pair = Pair.from_space(state.quantity.space)
                    box = self._box(number, self._of_joints, 1)
                    return LinkJoint(box, number, first, second, pair, stored[0], state, rate)
        self._fault(number, "is a joint whose relative pose does not follow from its rate")
        return None

    def _around(self, number: int) -> Path:
        return self.wiring.components[number].path.parent

    def _box(self, number: int, sharing: Counter[Path], most: int) -> Path:
        """The box that a component lies in; its own where that is the whole system, or has other bodies or joints."""
        around = self._around(number)
        return around if tuple(around) and sharing[around] <= most else self.wiring.components[number].path

    def _fault(self, number: int, reason: str) -> None:
        self.faults.append(Unplaced(self.wiring.components[number].path, reason))


def inertia_of(primitive: Primitive) -> Array | None:
    """(6, 6) of a quadratic energy ½⟨p|𝕀⁻¹p⟩ about the centre of mass; None of others."""
    numbers = () if primitive.kernel is None else primitive.kernel.parameters
    inverse = np.array(numbers).reshape(6, 6)
    entries, out = dict(primitive.parameters), np.zeros((6, 6))
    if {"mass", "inertia"} <= entries.keys():
        out[:3, :3] = np.array(entries["inertia"], dtype=float).reshape(3, 3)
        out[3:, 3:] = np.array(entries["mass"], dtype=float) * np.eye(3)
    else:
        out = np.linalg.inv(inverse)
        out[3:, 3:] = np.mean(np.diag(out)[3:]) * np.eye(3)
        out[3:, :3] = out[:3, 3:] = 0.0
    size = 6.0 * float(np.abs(out).max() * np.abs(inverse).max())  # not below the condition number over 6
    near = np.abs(out @ inverse - np.eye(6)).max() <= KINETIC * size
    return out if near else None
