"""The work of prescribed motions where they leave no degree of freedom: the energy that the mechanism gained, and the
heat.

Positions and velocities, and so energies, are then known but for the closing of loops. The multiplier of the motion
grows without bound near dead centres, where a quadrature of its power fails. How far that is from the work is counted
all the same: where a mechanism takes the other way out of a dead centre, velocities jump, and the two part.
"""

from collections.abc import Callable, Container
from functools import cached_property
from typing import Any, final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Storage
from ephs.solve.equations.mobility import mobility
from ephs.solve.posing.problem import Problem


@final
class Led:
    """Work of a mechanism moved entirely by prescribed motions, counted from its start.

    Parameters
    ----------
    booked
        States of heat that is booked as energy.
    moved
        Whether any motion is prescribed.
    """

    def __init__(self, problem: Problem, booked: Container[Path], *, moved: bool) -> None:
        self._problem, self._moved = problem, moved
        self._from: float | None = None
        self.apart = 0.0, 0.0
        """By how many J work and quadrature differ most, and the time in s."""
        self._booked = booked

    @cached_property
    def mechanical(self) -> Array:
        """(components,) 1 for storages of energy that is not booked as heat."""
        components, booked = self._problem.descriptor.components, self._booked
        kept = [
            isinstance(one.primitive, Storage) and not any(s.path in booked for s in one.reads) for one in components
        ]
        return np.array(kept, dtype=float)

    @property
    def holds(self) -> bool:
        """Whether no degree of freedom is left."""
        d = self._problem.descriptor
        return self._moved and not mobility(d, self._problem.point, self._problem.prescribed).mobility

    @property
    def counting(self) -> bool:
        """Whether work is computed from the energies."""
        return self._from is not None

    def start(self, energies: Callable[[], Array]) -> None:
        """Count from here, where no degree of freedom is left; energies (components,) in J are evaluated only there."""
        self._from = float(self._mechanical(energies())) if self.holds else None

    def work(self, times: Array, energies: Array, totals: Array) -> Array:
        """(rows,) the work in J since the start by energies (rows, components) and the heat, the first of the totals;
        the second, the sum of power, where the mechanism is not led."""
        if self._from is None:
            return totals[:, 1]
        found = self._mechanical(energies) - self._from + totals[:, 0]
        apart = np.abs(found - totals[:, 1])
        worst = int(np.argmax(apart))
        self.apart = max(self.apart, (float(apart[worst]), float(times[worst])))
        return found

    def _mechanical(self, energies: Array) -> Array:
        """(rows,) energy in J that is not booked as heat; a row's digits do not depend on the others."""
        return (energies * self.mechanical).sum(axis=-1)

    def stats(self) -> dict[str, Any]:
        """Statistics of a mechanism moved by prescribed motions."""
        return {} if self._from is None else {"work_apart": self.apart[0], "work_apart_at": self.apart[1]}
