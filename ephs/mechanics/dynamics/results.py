"""Results of the dynamics functions: states of bodies, constraints, energies, derivatives."""

from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.semantics.bundle import Array
from ephs.semantics.spaces.rotations import quaternion_to_matrix

__all__ = ["BodyState", "Constraints", "Derivatives", "Energies"]


@final
@dataclass(frozen=True, slots=True, eq=False)
class BodyState:
    """Where a body is and how it moves.

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
@dataclass(frozen=True, slots=True, eq=False)
class Energies:
    """Energies of a mechanism in J.

    Parameters
    ----------
    kinetic, potential
        Of the bodies' motion; of gravity, from the world's origin, and of springs.
    thermal
        Of thermal nodes since their initial temperature, and of what the environment took up.
    """

    kinetic: float
    potential: float
    thermal: float

    @property
    def total(self) -> float:
        """All together."""
        return self.kinetic + self.potential + self.thermal


@final
@dataclass(frozen=True, slots=True, eq=False)
class Constraints:
    """The equations rows·a = target that prescribed joints and closed loops put on the tree's accelerations a.

    Parameters
    ----------
    rows
        (m, n) on the tree's rates: of prescribed joints first, then of cut ones.
    target
        (m,) what the rows' own change leaves: −(d rows/dt)·r.
    gaps
        (m,) by how much loops are open, in m, angles in rad times the mechanism's length; zero for prescribed joints.
    joints
        The joint of each row.
    rank
        How many rows are independent in the mass metric, to the tolerance that accelerations are computed with.
    """

    rows: Array
    target: Array
    gaps: Array
    joints: tuple[str, ...]
    rank: int


@final
@dataclass(frozen=True, slots=True, eq=False)
class Derivatives:
    """Exact derivatives at a state, (n, n) on the tree's freedoms in the order of `Dynamics.freedoms`.

    Derivatives by q are along left-trivialised increments of the joints' elements, q·exp(v) at v = 0, as
    `Dynamics.moved` takes them; cut joints follow the tree. Where loops are closed, what leads off them is that of the
    same formulas; only changes with rows·v = 0 mean motions.

    Parameters
    ----------
    acceleration_q, acceleration_r, acceleration_force
        Of the accelerations ṙ under given forces; those of forces on the tree's freedoms.
    acceleration_s
        (n, entropies) of the accelerations by entropies, in 1/(s² J/K): not zero where friction depends on temperature.
    force_q, force_r, force_a
        Of inverse dynamics at given accelerations; force_a is the mass matrix.
    entropy_q, entropy_r, entropy_s
        (entropies, n), (entropies, entropies) of the entropies' rates ṡ.
    """

    acceleration_q: Array
    acceleration_r: Array
    acceleration_force: Array
    acceleration_s: Array
    force_q: Array
    force_r: Array
    force_a: Array
    entropy_q: Array
    entropy_r: Array
    entropy_s: Array
