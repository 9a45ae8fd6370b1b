"""A mesh of shell elements: energy, forces and sparse exact tangents of all elements at once.

The coordinates of a node are its turn in its own axes and its shift in the world's: a change (ω, s) of a pose (R, r)
makes (R exp ω, r + s). So forces are moments in the nodes' axes and forces in the world's.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self, final

import numpy as np
from scipy.sparse import coo_array
from scipy.spatial.transform import Rotation

from ephs.mechanics.elements.shell import edges
from ephs.mechanics.elements.shell.mesh import Indices, checked, corner_normals, edge_ends, section_axes, unit
from ephs.mechanics.elements.shell.section import ShellSection
from ephs.mechanics.elements.shell.stiffness import EDGES, stiffness
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from scipy.sparse import csc_array


@final
@dataclass(frozen=True, slots=True, eq=False)
class ShellSlopes:
    """Derivatives at a configuration, by the 24 coordinates of each element's nodes.

    Attributes
    ----------
    strain
        (n, 24, 24) of the logarithms of the edges.
    bend
        (n, 24, 24) of the forces at a constant stress.
    """

    strain: Array
    bend: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Shell:
    """Elements between nodes that are bodies; at rest the nodes' axes are the world's.

    Attributes
    ----------
    points
        (m, 3) nodes at rest, m.
    cells
        (n, 4) nodes of elements, counter-clockwise about the normal.
    section
        Of all elements.
    axes
        (n, 4, 4) quaternions of the sections at the elements' corners in their nodes.
    rest
        (n, 4, 6) logarithms of the edges without stress: rad, m.
    matrix
        (n, 24, 24) K of the energy ½ Δᵀ K Δ.
    rows
        (n, 8, 24) resultants of Δ.
    """

    points: Array
    cells: Indices
    section: ShellSection
    axes: Array
    rest: Array
    matrix: Array
    rows: Array

    @classmethod
    def of(
        cls,
        points: "ArrayLike",
        cells: "ArrayLike",
        section: ShellSection,
        normals: "ArrayLike | None" = None,
        *,
        crease: float = np.pi / 6.0,
        along: "ArrayLike | None" = None,
    ) -> Self:
        """The shell of a mesh.

        Parameters
        ----------
        points, cells
            (m, 3) in m, (n, 4) nodes of each element.
        normals
            (m, 3) of the surface, or (n, 4, 3) at each corner; where None the mean of the neighbours'.
        crease
            Angle from that mean, rad, beyond which a corner has its element's own normal.
        along
            (3,) direction from whose projection the angles of layers count; the element's first axis where None.

        Raises
        ------
        StructureError
            Points, elements or normals do not match, or an element is degenerate, not convex, warped, turned over, or
            the third one at an edge; the message names it.
        """
        points, given_cells = np.array(points, dtype=float), np.array(cells)
        checked(points, given_cells)
        cells = given_cells.astype(np.int64)
        if normals is None:
            given = corner_normals(points, cells, crease)
        else:
            given = np.array(normals, dtype=float)
            if given.shape not in (points.shape, (*cells.shape, 3)) or not np.linalg.norm(given, axis=-1).all():
                expected = f"vectors {points.shape} or {(*cells.shape, 3)}, none of them 0"
                found = f"an array of shape {given.shape}"
                raise StructureError("parameter", "shell", key="normals", found=found, expected=expected)
            given = unit(given[cells] if given.ndim == 2 else given)
        frames = section_axes(points, cells, given, None if along is None else np.array(along, dtype=float))
        axes = Rotation.from_matrix(frames.reshape(-1, 3, 3)).as_quat(scalar_first=True).reshape(-1, 4, 4)
        made = cls(points, cells, section, axes, np.zeros((len(cells), 4, 6)), np.zeros(0), np.zeros(0))
        rest = made.logarithms(made.poses)
        return cls(points, cells, section, axes, rest, *stiffness(rest, section))

    @property
    def poses(self) -> Array:
        """(m, 7) poses of the nodes at rest."""
        turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(self.points), 1))
        return np.concatenate([turns, self.points], axis=1)

    @property
    def size(self) -> float:
        """Largest extent at rest along an axis, m."""
        return float(np.ptp(self.points, axis=0).max())

    @property
    def areas(self) -> Array:
        """(n,) of the elements at rest, m²."""
        corner = self.points[self.cells]
        return 0.5 * np.linalg.norm(np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]), axis=1)

    def shares(self, values: Array) -> Array:
        """(m,) of values (n,) of elements a quarter at each node."""
        return np.bincount(self.cells.ravel(), np.repeat(0.25 * values, 4), len(self.points)).astype(float)

    @property
    def inertia(self) -> Array:
        """(m, 6) rotary inertia, that of a sphere, and mass of the nodes: ρh³A/12 and ρhA of an element, shared."""
        mass = self.shares(self.section.mass * self.areas)
        return np.outer(mass, np.repeat([self.section.thickness**2 / 12.0, 1.0], 3)).astype(float)

    def tensors(self, *, spread: bool = False) -> Array:
        """(m, 3, 3) rotary inertia of the nodes in their axes, kg m²: that of `inertia`.

        ``spread``: about the normals that of the elements' area instead of the thickness, ρhA²/48 of each at each node.
        So fast turns about the normal are as slow as other motions; slow motions change by the order of the elements.
        """
        mass, h = 0.25 * self.section.mass * self.areas, self.section.thickness
        out = np.array([np.diag(row) for row in self.inertia[:, :3]])
        if spread:
            normal = _rotation(self.axes).as_matrix()[:, :, 2].reshape(-1, 4, 3)
            more = (mass * np.maximum(self.areas - h * h, 0.0) / 12.0)[:, None, None, None]
            np.add.at(out, self.cells, more * normal[..., :, None] * normal[..., None, :])
        return out

    def _sections(self, poses: Array) -> tuple[Array, Rotation]:
        nodes = poses[self.cells]
        turned = _rotation(nodes[..., :4]) * _rotation(self.axes)
        turns = turned.as_quat(scalar_first=True).reshape(-1, 4, 4)
        return np.concatenate([turns, nodes[..., 4:]], axis=2), turned

    def logarithms(self, poses: Array) -> Array:
        """(n, 4, 6) logarithms of the relative poses along the edges, of poses (m, 7)."""
        return edges.logarithms(*edge_ends(self._sections(poses)[0])).reshape(-1, 4, 6)

    def changes(self, poses: Array) -> Array:
        """(n, 24) Δ of poses (m, 7)."""
        return (self.logarithms(poses) - self.rest).reshape(-1, 24)

    def stress(self, poses: Array) -> Array:
        """(n, 24) K Δ: moments in N m and forces in N of the edges, conjugate to their logarithms."""
        return self.of_changes(self.changes(poses))

    def of_changes(self, changes: Array) -> Array:
        """(n, 24) K Δ of changes (n, 24)."""
        return np.einsum("nij,nj->ni", self.matrix, changes)

    def energy(self, poses: Array) -> Array:
        """(n,) strain energy of the elements, J."""
        changes = self.changes(poses)
        return 0.5 * np.sum(changes * self.of_changes(changes), axis=1)

    def resultants(self, poses: Array) -> Array:
        """(n, 8) in the middle of elements, in their axes: membrane forces 11, 22, 12 in N/m, moments alike in N,
        transverse forces 1, 2 in N/m.
        """
        return np.einsum("nij,nj->ni", self.rows, self.changes(poses))

    def slopes(self, poses: Array, stress: Array) -> ShellSlopes:
        """Derivatives at poses (m, 7), those of the forces at a stress (n, 24)."""
        sections, turned = self._sections(poses)
        by, bends = edges.slopes(edges.logarithms(*edge_ends(sections)), stress.reshape(-1, 6))
        parts = np.zeros((len(self.cells), 4, 6, 6))
        parts[..., :3, :3] = np.swapaxes(_rotation(self.axes).as_matrix(), 1, 2).reshape(-1, 4, 3, 3)
        parts[..., 3:, 3:] = np.swapaxes(turned.as_matrix(), 1, 2).reshape(-1, 4, 3, 3)
        n = len(self.cells)
        strain, back = np.zeros((n, 4, 6, 4, 6)), np.zeros((n, 4, 6, 4, 6))
        rows, columns = by.reshape(n, 4, 6, 12), bends.reshape(n, 4, 12, 6)
        for e, ends in enumerate(EDGES):
            for k, node in enumerate(ends):
                own = slice(6 * k, 6 * k + 6)
                strain[:, e, :, node] = rows[:, e, :, own] @ parts[:, node]
                back[:, node, :, e] = np.swapaxes(parts[:, node], 1, 2) @ columns[:, e, own]
        strain, back = strain.reshape(n, 24, 24), back.reshape(n, 24, 24)
        bend = back @ strain
        force = np.einsum("nij,ni->nj", strain, stress).reshape(n, 4, 6)[..., 3:]
        nodes = _rotation(poses[:, :4]).as_matrix()[self.cells]
        turning = -np.cross(force[..., None, :], np.swapaxes(nodes, -1, -2))  # −f × the columns of R, in rows
        for node in range(4):
            bend[:, 6 * node + 3 : 6 * node + 6, 6 * node : 6 * node + 3] += np.swapaxes(turning[:, node], 1, 2)
        return ShellSlopes(strain, bend)

    def gathered(self, values: Array) -> Array:
        """(6m,) sum at the nodes of values (n, 24) at the elements' coordinates."""
        return np.bincount(self.places().ravel(), values.ravel(), 6 * len(self.points)).astype(float)

    def forces(self, poses: Array) -> Array:
        """(m, 6) derivative of the energy by the nodes' coordinates: N m in their axes, N in the world's."""
        stress = self.stress(poses)
        return self.gathered(np.einsum("nij,ni->nj", self.slopes(poses, stress).strain, stress)).reshape(-1, 6)

    def tangent(self, poses: Array, stress: Array | None = None) -> "csc_array":
        """(6m, 6m) derivative of `forces`, exact; at another stress (n, 24) than the poses' where one is given."""
        return self.assembled(self.slopes(poses, self.stress(poses) if stress is None else stress))

    def assembled(self, slopes: ShellSlopes, *, elastic: bool = True) -> "csc_array":
        """The tangent of slopes, with the part Bᵀ K B or without."""
        values = slopes.bend
        if elastic:
            values = values + np.swapaxes(slopes.strain, 1, 2) @ self.matrix @ slopes.strain
        at = self.places()
        where = (np.repeat(at, 24, axis=1).ravel(), np.tile(at, (1, 24)).ravel())
        return coo_array((values.ravel(), where), shape=(6 * len(self.points),) * 2).tocsc()

    def places(self) -> Indices:
        """(n, 24) numbers of the elements' coordinates."""
        return (6 * self.cells[..., None] + np.arange(6)).reshape(-1, 24)


def moved(poses: Array, change: Array) -> Array:
    """Poses (m, 7) after changes (m, 6) of the nodes' coordinates."""
    turned = _rotation(poses[:, :4]) * Rotation.from_rotvec(change[:, :3])
    return np.concatenate([turned.as_quat(scalar_first=True), poses[:, 4:] + change[:, 3:]], axis=1)


def _rotation(quaternions: Array) -> Rotation:
    return Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=True)
