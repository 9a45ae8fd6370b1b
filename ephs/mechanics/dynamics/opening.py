"""Hard contacts and stops of a mechanism as functions of its state, which are right where all of them are open."""

from typing import final

import numpy as np

from ephs.mechanics.impacts.reading import CLOSED
from ephs.mechanics.impacts.touching import Touching
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import Outcome, SolveError, failing_at


@final
class HardContacts:
    """Hard contacts and stops, whose forces are impulses of steps: a state at which one presses has no rates."""

    def __init__(self, equations: ReducedEquations) -> None:
        self._equations = equations
        self._touching = None if equations.model.descriptor.strikes is None else Touching(equations)

    def check_open(self, q: Array, r: Array) -> None:
        """Check that each is open, or opens.

        Raises
        ------
        SimulationError
            One is closed, or surfaces overlap.
        """
        if (touching := self._touching) is None:
            return
        gaps, rates = touching.motion(q, r)
        near = CLOSED * self._equations.problem.length
        still = CLOSED * touching.speed(q, r, np.zeros(self._equations.n))
        closed = np.flatnonzero((gaps < -near) | ((gaps <= near) & (rates <= still)))
        if closed.size:
            with failing_at(0.0):
                reason = "a hard contact or stop that is closed presses by impulses of steps alone"
                raise SolveError(Outcome.UNDETERMINED, str(touching.paths[closed[0]]), reason)
