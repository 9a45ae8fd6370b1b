"""Results of the dynamics functions: constraints, energies, derivatives."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Storage
from ephs.solve.equations.model import Model


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

    @staticmethod
    def of(model: Model, energies: Array, environment: float) -> "Energies":
        """Energies of the components in J, and the environment's received entropy in J/K."""
        kind, sums = {"ke": 0, "pe": 1}, [0.0, 0.0, model.reference.temperature * environment]
        for slot, energy in zip(model.descriptor.components, energies, strict=True):
            if isinstance(slot.primitive, Storage):
                sums[kind.get(str(slot.path[-1]), 2)] += float(energy)
        return Energies(*sums)

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
    """Exact derivatives at a state, (n, n) on the tree's degrees of freedom in the order of `Dynamics.freedoms`.

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


@final
@dataclass(frozen=True, slots=True, eq=False)
class VelocityDerivatives:
    """Exact derivatives of velocities J(q) r by the tree's elements, the tree's rates r held.

    Increments are those of `Derivatives`. A Jacobian's own change with time is that along the motion: J̇ r is the
    derivative times r.

    Parameters
    ----------
    rows
        (m, n) of what `Constraints.rows` make of the rates.
    joints
        Joint that closes a loop -> (d, n) of its rates.
    bodies
        Body -> (6, n) of its twist, in its frame.
    """

    rows: Array
    joints: Mapping[str, Array]
    bodies: Mapping[str, Array]
