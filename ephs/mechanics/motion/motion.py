"""A solution as mechanics: poses, velocities and joints of a scene, for all instants at once.

Velocities are those of the continuous relations: the stored momenta projected on the joints in the mass metric.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar, final

import numpy as np

from ephs.mechanics.motion.batch import adjoint_inverse, compose, included, rotations
from ephs.mechanics.motion.beams import BeamMotion, beam_motion
from ephs.mechanics.motion.contacts import ContactMotion, contact_motion, contact_poses
from ephs.mechanics.motion.gaps import Opening, chunks_of, largest_opening, relative_openings
from ephs.mechanics.motion.leaps import leaps
from ephs.mechanics.motion.moving import ByPath, Moving
from ephs.mechanics.motion.own_motion import OwnMotion, own_motion
from ephs.mechanics.motion.readout import freedoms_of, summary, variables
from ephs.mechanics.motion.reduced import motion_of
from ephs.mechanics.motion.shells import ShellMotion, shell_motion, with_nodes
from ephs.mechanics.scene.build import body_box, component_path, node_boxes
from ephs.mechanics.scene.geometry import JointCoupling, coupling_of
from ephs.mechanics.scene.model import GROUND, Joint, Scene
from ephs.mechanics.tree.finding.tendons import length_errors
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import listed
from ephs.semantics.spaces import SE3
from ephs.semantics.systems.markup import table
from ephs.solve.result.dataset import DatasetVariable
from ephs.solve.result.labels import Labels

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

Item = TypeVar("Item")


@final
@dataclass(frozen=True, slots=True, eq=False)
class ThermalMotion:
    """A thermal node: temperature in K, entropy in J/K since the start; (n,) each."""

    temperature: Array
    entropy: Array


def _ranges(title: str, values: Mapping[str, Array]) -> str:
    """A table of the first, last, least and largest values, a row for each component."""
    rows: list[tuple[str, ...]] = []
    for name, of in values.items():
        for k, each in enumerate(of.T if len(of) else ()):
            label = name if of.shape[1] == 1 else f"{name} {k + 1}"
            rows.append((label, *(f"{x:.5g}" for x in (each[0], each[-1], each.min(), each.max()))))
    return table(title, ("", "first", "last", "least", "largest"), rows)


@final
class BodyMotion:
    """The motion of a body.

    Attributes
    ----------
    position
        (n, 3) centre of mass in the world, in m.
    quaternion
        (n, 4) body to world.
    """

    def __init__(self, motion: Moving, name: str) -> None:
        self._motion, self._name = motion, name
        pose = motion.poses(name)
        self.quaternion, self.position = pose[:, :4], pose[:, 4:]

    @cached_property
    def rotation(self) -> Array:
        """(n, 3, 3), body to world."""
        return rotations(self.quaternion)

    @cached_property
    def twist(self) -> Array:
        """(n, 6) angular and linear velocity in the body frame."""
        return self._motion.twists[self._name]

    def _repr_html_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        values = {
            "position [m]": self.position, "velocity [m/s]": self.velocity,
            "angular velocity [rad/s]": self.angular_velocity,
        }  # fmt: skip
        return _ranges(f"Motion of body {self._name}", values)

    @property
    def velocity(self) -> Array:
        """(n, 3) of the centre of mass in the world basis, in m/s."""
        return np.einsum("nij,nj->ni", self.rotation, self.twist[:, 3:])

    @property
    def angular_velocity(self) -> Array:
        """(n, 3) in the body basis, in rad/s."""
        return self.twist[:, :3]


@final
class JointMotion:
    """The motion of a joint.

    Attributes
    ----------
    coordinate
        (n, d) coordinates of C2 in C1; m, rad.
    """

    def __init__(self, motion: Moving, name: str, coordinate: Array) -> None:
        self._motion, self._name, self.coordinate = motion, name, coordinate

    def _repr_html_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        values = {"coordinates [rad, m]": self.coordinate, "rate [rad/s, m/s]": self.rate}
        return _ranges(f"Motion of joint {self._name}", values | {"moment, force [N m, N]": self.wrench})

    @property
    def rate(self) -> Array:
        """(n, d) the twist u_r, in the axes of C2; m/s, rad/s."""
        return self._motion.rates[self._name]

    @cached_property
    def wrench(self) -> Array:
        """(n, 6) λ on body 2 in the joint frame C2 (moment, force), NaN where statically indeterminate."""
        return self._motion.wrench(self._name)


@final
@dataclass(frozen=True, slots=True, eq=False)
class MarkerMotion:
    """A marker: position in m and velocity in m/s, in the world; (n, 3) each."""

    position: Array
    velocity: Array


@final
class SceneMotion:
    """The motion of a scene, read from a solution.

    Velocities and wrenches are those of the solution's problem, or of ``found``.
    """

    def __init__(self, scene: Scene, solution: "Solution", found: Callable[[], ByPath] | None = None) -> None:
        self._scene, self._solution, self._given = scene, solution, found
        self._bodies = dict(scene.all_bodies())
        self._joints = dict(scene.all_joints())
        self._implicit = dict(scene.implicit_joints())
        self._couplings = {name: coupling_of(joint) for name, joint in self._joints.items()}
        self._nodes = node_boxes(scene)

    @property
    def freedoms(self) -> Mapping[str, Labels]:
        """Names and units of the coordinates of each joint."""
        return {name: freedoms_of(joint) for name, joint in self._joints.items()}

    # ---- reading -----------------------------------------------------------------------------------------------

    def body(self, name: str) -> BodyMotion:
        """The motion of a body, or of a node of a shell."""
        if name not in self._nodes:
            self._scene.body(name)
        return BodyMotion(self, name)

    def joint(self, name: str) -> JointMotion:
        """The motion of a joint, or of a body's implicit free joint."""
        joint = self._scene.joint(name)
        if name in self._implicit:
            return JointMotion(self, name, coupling_of(joint).pair.coordinates(self.poses(name)))
        return JointMotion(self, name, self.coordinates(name))

    def thermal(self, name: str) -> ThermalMotion:
        """The temperature of a thermal node."""
        node = _of_name("thermal node", name, dict(self._scene.all_thermal()))
        at = component_path("thermal", name)
        return ThermalMotion(node.temperature_of(lambda state: self._solution[at / state]), self._solution[at / "s"])

    def pressed(self, contact: str, point: int) -> tuple[Array, list[Array]]:
        """(n, 3) force of a point of a hard contact on the second body in N and world axes; and at each instant (3, m)
        its share of forces that balance each other."""
        return self._found.pressed(component_path("contacts", contact) / f"point{point}")

    def contact(self, name: str) -> ContactMotion:
        """Gap, force, slip and heat of a contact."""
        return contact_motion(self._scene, _of_name("contact", name, dict(self._scene.all_contacts())), self)

    def contact_poses(self) -> Iterator[tuple[Path, Path | None, Array]]:
        """Relative poses of points of contacts by the poses of the bodies; see `contacts.contact_poses`."""
        return contact_poses(self._scene, self)

    def beam(self, name: str) -> BeamMotion:
        """Nodes, strains, forces and moments of a beam."""
        beam = _of_name("beam", name, dict(self._scene.all_beams()))

        def warmth(node: str) -> Array:
            return self.thermal(node).temperature

        return beam_motion(self._scene, beam, self.poses, self.inclusion, self.wrench, warmth)

    def shell(self, name: str) -> ShellMotion:
        """Nodes, resultants and energies of a shell."""
        sheet, at = _of_name("shell", name, dict(self._scene.all_shells())), component_path("shells", name)
        return shell_motion(self._scene, sheet, lambda node: self._solution[at / node / "pe" / "q"], self.poses)

    def marker(self, name: str) -> MarkerMotion:
        """The motion of a marker."""
        marker = _of_name("marker", name, dict(self._scene.all_markers()))
        at, carrier = marker.at, marker.body
        if carrier == GROUND:
            still = np.tile(at, (len(self._solution), 1))
            return MarkerMotion(still, np.zeros_like(still))
        body = self.body(carrier)
        swung = body.twist[:, 3:] + np.cross(body.twist[:, :3], at)
        return MarkerMotion(body.position + body.rotation @ at, np.einsum("nij,nj->ni", body.rotation, swung))

    def poses(self, name: str) -> Array:
        """(n, 7) of a body, or of the ground."""
        if name == GROUND:
            return np.broadcast_to(SE3.identity(), (len(self._solution), 7))
        return self._solution[body_box(self._scene, name) / "pe" / "q"]

    def coordinates(self, name: str) -> Array:
        """(n, d) of a joint: of the pose of C2 in C1, in the axes of C1."""
        at = component_path("joints", name)
        if self._joints[name].middle is not None:
            parts = [self._solution[at / part / "pe" / "q_r"] for part in ("first", "second")]
            return np.column_stack(parts)
        return self._solution[at / "pe" / "q_r"].reshape(len(self._solution), self._couplings[name].dim)

    # ---- residuals ---------------------------------------------------------------------------------------------

    def constraint_error(self) -> Array:
        """(n,) largest distance or angle between where a joint's coordinates and its bodies put the frame C2."""
        return largest_opening(self._openings, len(self._solution), len(self._joints))

    def gaps(self, every: int) -> dict[Path, Array]:
        """Per joint the residual of its position at every so many instants: rad, or a part of the mechanism's length.

        The last instant is the first of these.
        """
        problem = self._solution.problem
        worst = relative_openings(self._openings(slice(None, None, -every)), 1.0 if problem is None else problem.length)
        return {component_path("joints", name): row for name, row in zip(self._joints, worst, strict=True)}

    def _openings(self, at: slice) -> list[Opening]:
        return [
            (
                self.poses(joint.body1)[at],
                joint.frame1,
                self.inclusion(name)[at],
                self.poses(joint.body2)[at],
                joint.frame2,
            )
            for name, joint in self._joints.items()
        ]

    def leaps(self, h: float) -> Iterator[tuple[Path, int, float]]:
        """Contacts that a step of at most h s passed: path, instant after it, the step's way in thicknesses."""
        return leaps(self._solution, h)

    def length_errors(self) -> Iterator[tuple[Path, int, float]]:
        """Tendons: path, instant at which the state is farthest from the points' distances, part of the length."""
        return length_errors(self._solution)

    def velocity_error(self) -> Array:
        """(n,) largest component of any joint's velocity residual."""
        worst = np.zeros(len(self._solution))
        for at, name, first, second, basis in self._rows():
            joint = self._joints[name]
            residual = np.zeros((first.shape[0], 6))
            for body, rows in ((joint.body1, first), (joint.body2, second)):
                if body != GROUND:
                    residual += np.einsum("nij,nj->ni", rows, self.twists[body][at])
            residual += np.einsum("nij,nj->ni", basis, self.rates[name][at])
            worst[at] = np.maximum(worst[at], np.abs(residual).max(axis=1))
        return worst

    # ---- velocities --------------------------------------------------------------------------------------------

    @cached_property
    def _own(self) -> "OwnMotion | None":
        return own_motion(self._solution, SceneMotion)

    @cached_property
    def _found(self) -> ByPath:
        return motion_of(self._solution) if self._given is None else self._given()

    @cached_property
    def _velocities(self) -> tuple[dict[str, Array], dict[str, Array]]:
        if self._own is not None:
            return self._own.velocities()
        found = self._found.twists
        twists = {name: found[component_path("bodies", name)] for name in self._bodies}
        rates = {name: np.hstack([self._found.rate(box) for box in self._boxes(name)]) for name in self._joints}
        return twists, rates | {name: twists[name] for name in self._implicit}

    def _boxes(self, name: str) -> list[Path]:
        """The boxes of a joint: a universal one is two."""
        at = component_path("joints", name)
        return [at] if self._joints[name].middle is None else [at / "first", at / "second"]

    @property
    def twists(self) -> dict[str, Array]:
        """(n, 6) by body."""
        return self._velocities[0] | {name: self._found.twists[path] for name, path in self._nodes.items()}

    def outline(self) -> Scene:
        """The scene as it is drawn."""
        return with_nodes(self._scene) if self._nodes else self._scene

    @property
    def rates(self) -> dict[str, Array]:
        """(n, d) by joint, implicit free joints included."""
        return self._velocities[1]

    def wrench(self, name: str) -> Array:
        """(n, 6) of a joint; see `JointMotion`."""
        if name in self._implicit:
            return np.zeros((len(self._solution), 6))
        return self._found.wrench(self._boxes(name)[-1]) if self._own is None else self._own.wrench(name)

    def variables(self, *, wrenches: bool) -> dict[str, DatasetVariable]:
        """Bodies, joints, thermal nodes and markers as labelled arrays."""
        return variables(self._scene, self, wrenches=wrenches)

    def state(self, i: int) -> dict[Path, Array]:
        """The states at the i-th instant, momenta projected on the joints."""
        state = self._solution.state_at(i)
        for name, body in self._bodies.items():
            if body.mass > 0.0:
                u = self.twists[name][i]
                state[component_path("bodies", name) / "ke" / "p"] = np.concatenate(
                    [body.inertia @ u[:3], body.mass * u[3:]]
                )
        return state

    def _rows(self) -> Iterator[tuple[slice, str, Array, Array, Array]]:
        for at in chunks_of(len(self._solution), len(self._joints)):
            for name, first, second, basis in self.joint_rows(at):
                yield at, name, first, second, basis

    def joint_rows(self, at: slice) -> Iterator[tuple[str, Array, Array, Array]]:
        """Per joint: Ad_{I⁻¹}Ad_{o₁⁻¹}, −Ad_{o₂⁻¹}, B, each (size, 6, ·), at some instants."""
        for name, joint in self._joints.items():
            coupling = self._couplings[name]
            relative = self.inclusion(name)[at]
            first = adjoint_inverse(compose(np.broadcast_to(joint.frame1, relative.shape), relative))
            second = -np.broadcast_to(SE3.adjoint(SE3.inverse(joint.frame2)), first.shape)
            yield name, first, second, self._basis(joint, coupling, name, at)

    def _basis(self, joint: Joint, coupling: JointCoupling, name: str, at: slice) -> Array:
        x = self.coordinates(name)[at]
        if joint.middle is None:
            return np.broadcast_to(coupling.basis(coupling.identity()), (x.shape[0], 6, coupling.dim))
        return np.array([coupling.basis(row) for row in x])

    def inclusion(self, name: str) -> Array:
        """(n, 7) poses of C2 in C1 by the joint's coordinates."""
        return self._inclusions[name]

    @cached_property
    def _inclusions(self) -> dict[str, Array]:
        return {name: included(coupling, self.coordinates(name)) for name, coupling in self._couplings.items()}

    # ---- summary -----------------------------------------------------------------------------------------------

    def summary(self) -> dict[str, Any]:
        """Values at the end, mobility, and the number of redundant constraints."""
        return summary(self._scene, self._solution, self, [*self._joints, *self._implicit])


def _of_name(kind: str, name: str, known: Mapping[str, Item]) -> Item:
    if name not in known:
        raise KeyError(f"{name}: no such {kind}; the {kind}s are {listed(name, known)}")
    return known[name]
