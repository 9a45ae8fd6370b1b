"""The parts of a problem's flat system in joint coordinates: links, joints as edges, forces, heat and what acts.

Whatever has no place among them is refused by its path.
"""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.mechanics.tree.finding.contraction import network_of
from ephs.mechanics.tree.finding.frames import Frame, Frames, Link, LinkJoint, Unplaced, frames_of
from ephs.mechanics.tree.finding.holding import check_determined
from ephs.mechanics.tree.finding.network import Network
from ephs.mechanics.tree.finding.roles import Role
from ephs.mechanics.tree.finding.spanning import Edge, islands
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Irreversible, Primitive, Storage
from ephs.semantics.spaces import SE3, pair
from ephs.semantics.systems.kept import once
from ephs.solve.posing.motion_law import MotionLaw, PolynomialMotion
from ephs.solve.posing.problem import Problem, Signal

FREE = pair("free")
OF_COORDINATES = ("no_potential", "pair_spring", "beam_spring")
"""Energies of a free joint that may lead to a body; with others it is a force between two frames."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class WrenchPort:
    """An outer port at which a wrench acts on a frame of a link."""

    port: Path
    frame: Frame


@final
@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """Parts of a flat system.

    Parameters
    ----------
    names
        (links,) what solutions call each; None of frames without a body.
    weights
        (links,) component of the potential of a weight, −1.
    gravity
        (3,) in m/s², of all links with a mass.
    joints, forces
        Edges that may carry a link, and those that only act between frames.
    spans
        Joints that hold nothing and carry no link: relative poses that something attached reads.
    entropies
        State -> component that stores it, of heat that is booked as energy.
    conduction
        (component, entropy, entropy).
    network
        What is attached at joints and heat.
    attached
        Edges at which it is, by their junctions.
    """

    links: tuple[Link, ...]
    names: tuple[str | None, ...]
    weights: tuple[int, ...]
    gravity: Array
    joints: tuple[Edge, ...]
    forces: tuple[Edge, ...]
    spans: tuple[Edge, ...]
    entropies: dict[Path, int]
    conduction: tuple[tuple[int, int, int], ...]
    acting: tuple[WrenchPort, ...]
    network: Network
    attached: dict[int, Edge]


def parts_of(problem: Problem) -> Parts:
    """The parts of a problem's system; found once for its prescribed motions and names, and kept with the descriptor.

    Raises
    ------
    Unplaced
        A component, or what is prescribed at a port, has no place in joint coordinates.
    """
    return once(problem.descriptor, ("parts", determined_by(problem)), lambda: _PartsReader(problem).parts())


def determined_by(problem: Problem) -> Hashable:
    """Key of the parts of a system: prescribed motions, and whether a scene, whose system has no other, names them."""
    motions = tuple((path, one.effort, _prescribed(one)) for path, one in problem.signals.items())
    return motions, bool(problem.names)


def _prescribed(signal: Signal) -> MotionLaw | bytes | None:
    """A prescribed motion; None where it is a function, or where a force is given."""
    if not signal.effort or isinstance(signal.value, MotionLaw):
        return signal.value if isinstance(signal.value, MotionLaw) else None
    return None if callable(signal.value) else np.asarray(signal.value, dtype=float).tobytes()


@final
class _PartsReader:
    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.found: Frames = frames_of(problem.descriptor)
        self.wiring, self.roles = self.found.wiring, self.found.roles
        self.placed = set(self.found.placed)
        self.ports: set[Path] = set()
        self.entropy: dict[int, int] = {}
        self.entropies: dict[Path, int] = {}
        self.rates = {joint.rate: joint.pair.dim for joint in self.found.joints}
        self._rate = {joint.state.path: joint.rate for joint in self.found.joints}
        for number, role in enumerate(self.roles):
            if role in (Role.HEAT, Role.ENVIRONMENT) and self._booked(number):
                self.entropy[next(iter(self.wiring.ports[number].values()))] = len(self.entropies)
                self.entropies[self.wiring.components[number].reads[0].path] = number
                self.placed.add(number)

    def parts(self) -> Parts:
        links = self.found.links
        if self.found.faults:
            raise self.found.faults[0]
        names = tuple(None if link.path is None else self._name(link.path) for link in links)
        joints: list[Edge] = []
        forces: list[Edge] = []
        spans: list[Edge] = []
        taken: dict[str, int] = {}
        edges = {joint.rate: self._edge(joint, taken) for joint in self.found.joints}
        potentials, drags, conduction = self._weights(), list(self._drags()), tuple(self._conduction())
        network = self._network()
        attached = {junction: edges[junction] for junction, _ in network.rates}
        for joint in self.found.joints:
            of = joints if self._carries(joint, joint.rate in attached) else spans if joint.rate in attached else forces
            of.append(edges[joint.rate])
        spans, forces = self._side_by_side(joints, spans), self._side_by_side(joints, forces)
        held = {body for edge in joints for body in (edge.body1, edge.body2)}
        joints += [self._free(i, str(names[i])) for i in range(len(links)) if i not in held]
        for group in islands(len(links), joints):  # those that nothing ties to the ground move with their first one
            joints.append(self._free(min(group, key=lambda i: (links[i].pose is None, i)), ""))
        weights, gravity = potentials
        forces += [*self._potentials(weights), *drags]
        acting = tuple(self._acting())
        return Parts(
            links, names, tuple(weights), gravity, tuple(joints), tuple(forces), tuple(spans), self.entropies,
            conduction, acting, network, attached,
        )  # fmt: skip

    # ---- attachments -------------------------------------------------------------------------------------------

    def _booked(self, number: int) -> bool:
        """Whether heat comes to a store of it by irreversible components only: then it is booked as energy."""
        (junction,) = self.wiring.ports[number].values()
        others = (self.wiring.components[other].primitive for other, _ in self.wiring.neighbours(junction, number))
        return junction not in self.wiring.outer and all(isinstance(other, Irreversible) for other in others)

    def _network(self) -> Network:
        """All that is neither a link, a joint, a force, nor heat.

        Raises
        ------
        Unplaced
            It meets what is no joint.
        """
        left = [number for number in range(len(self.roles)) if number not in self.placed]
        for number in left:
            if self.roles[number] not in (
                Role.OTHER,
                Role.FRICTION,
                Role.RESISTANCE,
                Role.CONDUCTION,
                Role.HEAT,
                Role.ENVIRONMENT,
            ):
                raise Unplaced(self.wiring.components[number].path, "belongs to no body and no joint")
        found = network_of(self.wiring, left, self.rates, self.entropy, self._prescribed, self._bare)
        check_determined(found, self.wiring.components)
        self.placed |= set(left)
        self.ports |= found.ports()
        return found

    def _prescribed(self, port: Path) -> bool:
        return self.problem.signal(port).effort

    def _bare(self, junction: int) -> str | None:
        """Why nothing can be attached to a junction; None where it can."""
        if junction in self.found.frames:
            return "acts on the twist of a body; a joint's rate can be acted on"
        on = {self.roles[number] for number, _ in self.wiring.on[junction]}
        if on & {Role.POSE, Role.RELATIVE, Role.KINETIC, Role.JOINT} and junction not in self.rates:
            return "acts on the state of a body or a joint; a joint's rate can be acted on"
        return None

    # ---- joints ------------------------------------------------------------------------------------------------

    def _name(self, path: Path) -> str:
        return self.problem.names.get(path, str(path))

    def _edge(self, joint: LinkJoint, taken: dict[str, int]) -> Edge:
        """A joint with the components at its momentum: a potential, friction, an outer port."""
        name, d = self._name(joint.path), joint.pair.dim
        start = taken.get(name, 0)
        taken[name] = start + d
        friction = heat = -1
        for number, _ in self.wiring.neighbours(joint.rate, joint.relation):
            if friction >= 0 or not self._resists(number, joint):
                continue
            *_, hot = self.wiring.ports[number].values()
            friction, heat = number, self.entropy[hot]
            self.placed.add(number)
        port = self.wiring.outer.get(joint.rate)
        return Edge(
            name, joint.path, joint.first.link, joint.second.link, joint.first.offset, joint.second.offset, joint.pair,
            None if port is None else self._motion(port, d),
            slice(start, start + d), joint.state.path, port, joint.potential, friction, heat, self._place(joint),
        )  # fmt: skip

    def _resists(self, number: int, joint: LinkJoint) -> bool:
        """Whether a component is friction of a joint, or of all those whose relative poses one potential stores."""
        read = [state.path for state in self.wiring.components[number].reads]
        *rates, hot = self.wiring.ports[number].values()
        if self.roles[number] is Role.FRICTION:
            own = set(read) <= {joint.state.path}
        else:
            stored = [state.path for state in self.wiring.components[joint.potential].reads]
            own = self.roles[number] is Role.RESISTANCE and read == stored and rates == [self._rate[p] for p in stored]
        return own and hot in self.entropy

    def _place(self, joint: LinkJoint) -> int:
        """Place of a joint's relative pose among those that its potential stores."""
        stored = [state.path for state in self.wiring.components[joint.potential].reads]
        return stored.index(joint.state.path)

    def _motion(self, port: Path, freedoms: int) -> MotionLaw | None:
        """Prescribed effort of a joint's port; None where a force is given."""
        self.ports.add(port)
        signal = self.problem.signal(port)
        if not signal.effort:
            return None
        if freedoms != 1:
            raise Unplaced(port, "prescribes rates of several degrees of freedom")
        if isinstance(signal.value, MotionLaw):
            return signal.value
        if callable(signal.value):
            raise Unplaced(port, "prescribes a rate by a function without derivative; a motion law has one")
        return PolynomialMotion((float(np.atleast_1d(signal.value)[0]),))

    def _carries(self, joint: LinkJoint, attached: bool) -> bool:
        """Whether a joint may lead to a link: a free one does where neither a force between its frames belongs to it
        nor, where it has no energy, anything that is attached.
        """
        energy = self.wiring.components[joint.potential].primitive.name
        kept = OF_COORDINATES[attached:]
        return joint.pair != FREE or energy in kept or joint.rate in self.wiring.outer

    def _side_by_side(self, joints: list[Edge], others: list[Edge]) -> list[Edge]:
        """Edges with those of one potential one after the other, in the order of the relative poses that it stores.

        Raises
        ------
        Unplaced
            Not all poses of a potential of several are among them, or one leads to a body.
        """
        of: dict[int, list[Edge]] = {}
        for edge in (*joints, *others):
            if edge.spring >= 0 and self.roles[edge.spring] is Role.SEVERAL:
                of.setdefault(edge.spring, []).append(edge)
        carrying = {edge.spring for edge in joints}
        for number, edges in of.items():
            slot = self.wiring.components[number]
            if len(edges) < len(slot.reads) or number in carrying:
                raise Unplaced(slot.path, "stores relative poses, which are not all alike those of free joints")
        apart = [edge for edge in others if edge.spring not in of]
        return apart + [edge for edges in of.values() for edge in sorted(edges, key=lambda edge: edge.place)]

    def _free(self, link: int, name: str) -> Edge:
        """The free joint of a link that nothing else ties to the ground."""
        pose, unit = self.found.links[link].pose, SE3.identity()
        state = None if pose is None else pose.path
        return Edge(name, None, -1, link, unit, unit, FREE, None, slice(0, 6), state, None, -1, -1, -1)

    # ---- forces ------------------------------------------------------------------------------------------------

    def _weights(self) -> tuple[list[int], Array]:
        """Component of each link's weight, and the acceleration that all have: zero where they differ."""
        weights = [-1] * len(self.found.links)
        accelerations: list[set[tuple[float, ...]]] = []
        for i, link in enumerate(self.found.links):
            if link.light:
                continue
            component = None if link.potential < 0 else self.wiring.components[link.potential].primitive
            if component is None or component.name != "gravity":
                return [-1] * len(weights), np.zeros(3)
            weights[i] = link.potential
            accelerations.append(_accelerations(component, float(link.inertia[5, 5])))
        common = set.intersection(*accelerations) if accelerations else set[tuple[float, ...]]()
        if not common:
            return [-1] * len(weights), np.zeros(3)
        return weights, np.array(min(common, key=lambda one: len(repr(one))))

    def _potentials(self, weights: list[int]) -> Iterator[Edge]:
        """Potentials of poses that are no common weight, as forces between the ground and the link."""
        for i, (link, weight) in enumerate(zip(self.found.links, weights, strict=True)):
            if link.potential >= 0 and weight < 0 and not _idle(self.wiring.components[link.potential].primitive):
                yield self._on_link(Frame(i, SE3.identity()), link.potential, -1, -1)

    def _drags(self) -> Iterator[Edge]:
        """Friction on the twists of frames."""
        for number, role in enumerate(self.roles):
            if role is not Role.DRAG:
                continue
            slot = self.wiring.components[number]
            frame = self.found.frames[next(iter(self.wiring.ports[number].values()))]
            pose = None if frame.link < 0 else self.found.links[frame.link].pose
            at_centre = np.array_equal(frame.offset, SE3.identity())
            if slot.reads and not (at_centre and pose is not None and slot.reads[0].path == pose.path):
                raise Unplaced(slot.path, "reads another pose than that of the body that it slows down")
            self.placed.add(number)
            yield self._on_link(frame, -1, number, self._heat(number))

    def _on_link(self, frame: Frame, spring: int, friction: int, heat: int) -> Edge:
        path = self.wiring.components[max(spring, friction)].path
        unit = SE3.identity()
        return Edge(
            str(path), path, -1, frame.link, unit, frame.offset, FREE, None, slice(0, 6), None, None, spring, friction,
            heat,
        )  # fmt: skip

    # ---- heat and ports ----------------------------------------------------------------------------------------

    def _heat(self, number: int) -> int:
        """Entropy of the node that a component heats."""
        *_, junction = self.wiring.ports[number].values()
        if junction not in self.entropy:
            raise Unplaced(self.wiring.components[number].path, "heats what is no store of heat")
        return self.entropy[junction]

    def _conduction(self) -> Iterator[tuple[int, int, int]]:
        for number, role in enumerate(self.roles):
            if role is Role.CONDUCTION:
                ends = [self.entropy.get(junction, -1) for junction in self.wiring.ports[number].values()]
                if -1 in ends:
                    continue
                self.placed.add(number)
                yield number, ends[0], ends[1]

    def _acting(self) -> Iterator[WrenchPort]:
        """The outer ports of links, where wrenches act.

        Raises
        ------
        Unplaced
            A twist is prescribed, or the port is none of a joint or a link.
        """
        for junction, port in self.wiring.outer.items():
            if port in self.ports:
                continue
            frame = self.found.frames.get(junction)
            if frame is None:
                raise Unplaced(port, "is a port of neither a joint nor a body")
            if self.problem.signal(port).effort:
                raise Unplaced(port, "prescribes the motion of a body; a joint's can be prescribed")
            yield WrenchPort(port, frame)


def _accelerations(weight: Primitive, mass: float) -> set[tuple[float, ...]]:
    """The accelerations a, a few roundings apart, whose m a is a weight to the last bit."""
    force = -np.array(dict(weight.parameters)["weight"], dtype=float)
    near = force / mass
    found = [
        sorted({x for x in (np.nextafter(a, -np.inf), a, np.nextafter(a, np.inf)) if mass * x == f})
        for a, f in zip(near, force, strict=True)
    ]
    return {(float(x), float(y), float(z)) for x in found[0] for y in found[1] for z in found[2]} or {
        tuple(near.tolist())
    }


def _idle(primitive: object) -> bool:
    return isinstance(primitive, Storage) and primitive.kernel is not None and primitive.kernel.name == "no_effort"
