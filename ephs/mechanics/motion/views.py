"""States by the names of a scene, as functions of inputs, events and controllers read them at one instant.

Names are those of `Solution`: ``state.joints.waist.coordinate``, ``state.bodies.tool.position``. What is not read costs
nothing.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar, final

import numpy as np

from ephs.mechanics.scene.build import body_box, component_path
from ephs.mechanics.scene.kinematics import AssemblyJoint, twist
from ephs.mechanics.scene.markers import Marker
from ephs.mechanics.scene.model import GROUND, Scene
from ephs.mechanics.scene.site import nodes_of_shells
from ephs.mechanics.scene.state import Snapshot
from ephs.mechanics.scene.thermal import ThermalNode
from ephs.mechanics.tree.equations.reading import JointStates
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import least_squares
from ephs.semantics.spaces.rotations import quaternion_to_matrix
from ephs.semantics.systems.kept import once
from ephs.solve.posing.errors import nearest_of
from ephs.solve.posing.problem import State

Item = TypeVar("Item")
AXIAL = frozenset({"revolute", "prismatic", "cylindrical", "screw"})
"""Pairs about one axis: components of twists along it are the same in all frames that they move to."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class BodyState:
    """Motion of a body.

    Parameters
    ----------
    pose
        (7,) ``[w, x, y, z, rx, ry, rz]`` of centre of mass and body axes in the world; m.
    twist
        (6,) angular and linear velocity in the body's frame; rad/s, m/s.
    """

    pose: Array
    twist: Array

    @property
    def position(self) -> Array:
        """(3,) of the centre of mass in the world, m."""
        return self.pose[4:]

    @property
    def quaternion(self) -> Array:
        """(4,) body to world, scalar first."""
        return self.pose[:4]

    @property
    def rotation(self) -> Array:
        """(3, 3) body to world."""
        return quaternion_to_matrix(self.pose[:4])

    @property
    def velocity(self) -> Array:
        """(3,) of the centre of mass in the world basis, m/s."""
        return self.rotation @ self.twist[3:]

    @property
    def angular_velocity(self) -> Array:
        """(3,) in the body basis, rad/s."""
        return self.twist[:3]

    def point(self, at: Array) -> tuple[Array, Array]:
        """Position and velocity (3,) in the world of a point (3,) in the body's frame."""
        turn = self.rotation
        return self.pose[4:] + turn @ at, turn @ (self.twist[3:] + np.cross(self.twist[:3], at))


@final
class JointState:
    """A joint: ``coordinate`` (d,) of C2 in C1 and ``rate`` (d,), its twist u_r; m, rad, seconds."""

    __slots__ = ("_name", "_view")

    def __init__(self, view: "StateView", name: str) -> None:
        self._view, self._name = view, name

    @property
    def coordinate(self) -> Array:
        """(d,) of the pose of C2 in C1, in the axes of C1."""
        return self._view.coordinate(self._name)

    @property
    def rate(self) -> Array:
        """(d,) the twist u_r, in the axes of C2."""
        return self._view.rate(self._name)


@final
@dataclass(frozen=True, slots=True, eq=False)
class MarkerState:
    """A marker: position in m and velocity in m/s, in the world; (3,) each."""

    position: Array
    velocity: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class ThermalState:
    """A thermal node: temperature in K, entropy in J/K since the start."""

    temperature: float
    entropy: float


@final
class NamedViews(Mapping[str, Item], Generic[Item]):
    """Elements of one kind by name, as attributes or keys: ``joints.waist``, ``joints["left.waist"]``."""

    __slots__ = ("_kind", "_names", "_read")

    def __init__(self, kind: str, names: Mapping[str, object], read: Callable[[str], Item]) -> None:
        self._kind, self._names, self._read = kind, names, read

    def __getitem__(self, name: str) -> Item:
        if name not in self._names:
            raise KeyError(self._unknown(name))
        return self._read(name)

    def __getattr__(self, name: str) -> Item:
        if name not in self._names:
            raise AttributeError(self._unknown(name))
        return self._read(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def _unknown(self, name: str) -> str:
        known = ", ".join(self._names) or "none"
        return f"no {self._kind}.{name}; there are: {known}{nearest_of(name, self._names)}"


@final
class Names:
    """The names of a scene, made once for all instants."""

    def __init__(self, scene: Scene) -> None:
        now = Snapshot.of(scene)
        self.links: dict[str, AssemblyJoint] = {}
        for link in now.links:  # a joint takes precedence over an implicit one of its name
            self.links.setdefault(link.name, link)
        self.axial = {name: _axial_rows(link) for name, link in self.links.items() if _axial(link)}
        self.implicit = {name for name, _ in scene.implicit_joints()} - {name for name, _ in scene.all_joints()}
        self.split = {name for name, j in scene.all_joints() if j.middle is not None}
        self.markers: dict[str, Marker] = dict(scene.all_markers())
        self.nodes: dict[str, ThermalNode] = dict(scene.all_thermal())
        bodies = dict(zip(now.names, now.bodies, strict=True)) | dict(nodes_of_shells(scene))
        self.number = {name: i for i, name in enumerate(bodies)}
        self.boxes = [body_box(scene, name) for name in bodies]
        self.inverse = [_inverse_inertia(body.mass, body.inertia) for body in bodies.values()]
        self.light = [i for i, body in enumerate(bodies.values()) if not body.mass > 0.0]

    def view(self, states: State) -> "StateView":
        """The view of one instant's states by path."""
        return StateView(self, states)


def view_of(scene: Scene) -> "Callable[[State], StateView]":
    """Views of a scene's states; its names are collected for the first one."""
    return lambda states: once(scene, "names of states", lambda: Names(scene)).view(states)


@final
class StateView(Mapping[Path, Array]):
    """States of a scene at one instant.

    Attributes
    ----------
    joints
        ``coordinate`` and ``rate`` of each joint, implicit free joints included.
    bodies
        ``position``, ``quaternion``, ``rotation``, ``velocity``, ``angular_velocity``, ``pose``, ``twist``.
    markers
        ``position`` and ``velocity``.
    thermal
        ``temperature`` and ``entropy``.

    By path there are the states of the system as they are stored: ``state["bodies.rod.ke.p"]``. Velocities of methods
    of the general form are those of their nodal momenta, which are on the joints to the method's order.
    """

    def __init__(self, names: Names, states: State) -> None:
        self._names, self._states = names, states

    def __getitem__(self, path: "str | Path") -> Array:
        return self._states[Path.of(path)]

    def __iter__(self) -> Iterator[Path]:
        return iter(self._states)

    def __len__(self) -> int:
        return len(self._states)

    @property
    def joints(self) -> NamedViews[JointState]:
        """Joints by name."""
        return NamedViews("joints", self._names.links, lambda name: JointState(self, name))

    @property
    def bodies(self) -> NamedViews[BodyState]:
        """Bodies by name."""
        return NamedViews("bodies", self._names.number, self._body)

    @property
    def markers(self) -> NamedViews[MarkerState]:
        """Markers by name."""
        return NamedViews("markers", self._names.markers, self._marker)

    @property
    def thermal(self) -> NamedViews[ThermalState]:
        """Thermal nodes by name."""
        return NamedViews("thermal", self._names.nodes, self._node)

    # ---- reading -------------------------------------------------------------------------------------------------

    def coordinate(self, joint: str) -> Array:
        """(d,) coordinates of a joint."""
        return self._names.links[joint].coupling.coordinates(self._element(joint))

    def rate(self, joint: str) -> Array:
        """(d,) rate of a joint."""
        if isinstance(self._states, JointStates):
            known = self._states.rate(joint)
            if known is not None:
                return known
        names = self._names
        if joint in names.implicit:
            return self._twists[names.number[joint]]
        link = names.links[joint]
        if joint in names.axial:
            first, second = names.axial[joint]
            return second @ twist(self._twists, link.body2) - first @ twist(self._twists, link.body1)
        return link.slip(self._twists, self._element(joint))[0]

    def _element(self, joint: str) -> Array:
        """(size,) the joint's stored element."""
        names = self._names
        if joint in names.implicit:
            return self._states[names.boxes[names.number[joint]] / "pe" / "q"]
        at = component_path("joints", joint)
        if joint in names.split:
            return np.concatenate([self._states[at / part / "pe" / "q_r"] for part in ("first", "second")])
        return self._states[at / "pe" / "q_r"]

    def _body(self, name: str) -> BodyState:
        number = self._names.number[name]
        return BodyState(self._states[self._names.boxes[number] / "pe" / "q"], self._twists[number])

    def _marker(self, name: str) -> MarkerState:
        marker = self._names.markers[name]
        if marker.body == GROUND:
            return MarkerState(np.array(marker.at), np.zeros(3))
        return MarkerState(*self._body(marker.body).point(np.array(marker.at)))

    def _node(self, name: str) -> ThermalState:
        at, states = component_path("thermal", name), self._states
        theta = self._names.nodes[name].temperature_of(lambda state: float(states[at / state][0]))
        return ThermalState(float(theta), float(states[at / "s"][0]))

    @cached_property
    def _twists(self) -> Array:
        """(bodies, 6) twists by momenta; of bodies without mass by their joints."""
        names = self._names
        out = np.zeros((len(names.number), 6))
        for i, box in enumerate(names.boxes):
            if i not in names.light:
                out[i] = names.inverse[i] @ self._states[box / "ke" / "p"]
        if names.light:
            out[names.light] = self._light_twists(out)
        return out

    def _light_twists(self, twists: Array) -> Array:
        """(light bodies, 6), with the joints' rates by least squares."""
        names = self._names
        links = [k for k in names.links.values() if k.body1 in names.light or k.body2 in names.light]
        first = 6 * len(names.light)
        width = first + sum(link.coupling.dim for link in links)
        rows, right, column = np.zeros((6 * len(links), width)), np.zeros(6 * len(links)), first
        for at, link in zip(range(0, rows.shape[0], 6), links, strict=True):
            x = self._element(link.name)
            for body, block in zip((link.body1, link.body2), link.rows(x), strict=True):
                if body in names.light:
                    k = 6 * names.light.index(body)
                    rows[at : at + 6, k : k + 6] += block
                else:
                    right[at : at + 6] -= block @ twist(twists, body)
            rows[at : at + 6, column : column + link.coupling.dim] = -link.coupling.basis(x)
            column += link.coupling.dim
        found = least_squares(rows, right)
        return np.asarray(found[:first], dtype=float).reshape(-1, 6)


def _axial(link: AssemblyJoint) -> bool:
    return link.coupling.middle is None and link.coupling.pair.name in AXIAL


def _axial_rows(link: AssemblyJoint) -> tuple[Array, Array]:
    """(d, 6) each: the rate of a joint about one axis from the twists of its bodies."""
    left = link.coupling.left_inverse(link.coupling.basis(link.coupling.identity()))
    first, second = (left @ SE3.adjoint(SE3.inverse(frame)) for frame in (link.frame1, link.frame2))
    return first, second


def _inverse_inertia(mass: float, inertia: Iterable[object]) -> Array:
    """(6, 6) from momentum to twist of a body; zeros of one without mass."""
    out = np.zeros((6, 6))
    if mass > 0.0:
        out[:3, :3], out[3:, 3:] = np.linalg.inv(np.asarray(inertia, dtype=float)), np.eye(3) / mass
    return out
