"""Outer ports and states of a mechanism's system, by the states of its linearisation in joint coordinates.

Its motions are among those of the system in all its independent states, which `LinearSystem` has: there every port is
linear, those of what is attached at joints too.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import final

import numpy as np

from ephs.mechanics.linear.system import LinearSystem
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import least_squares
from ephs.semantics.spaces.rank import ELIMINATION, TINY
from ephs.solve.posing.problem import Problem


@final
class Ports:
    """The ports of one system about a state.

    Parameters
    ----------
    x
        Its states.
    shown
        State -> (d, size) what the states of the linearisation do to it.
    moved
        Ports at which the motion of a joint is prescribed: it is followed, and no input.
    """

    def __init__(self, problem: Problem, x: Array, shown: Mapping[Path, Array], moved: frozenset[Path]) -> None:
        self._problem, self._x, self._shown = problem, x, shown
        self.names = tuple(str(slot.path) for slot in problem.descriptor.outer if slot.path not in moved)
        self.states = {str(path): rows for path, rows in shown.items()}

    @cached_property
    def _system(self) -> LinearSystem:
        return LinearSystem(self._problem, self._x)

    @cached_property
    def _spanned(self) -> Array:
        """(n_w, size) all states by those of the linearisation; of the environment, nothing."""
        size = next((rows.shape[1] for rows in self._shown.values()), 0)
        out = np.zeros((self._system.pencil.n_w, size))
        for slot in self._problem.descriptor.states:
            if slot.path in self._shown:
                out[slot.rates] = self._shown[slot.path]
        return out

    def given(self, name: str) -> Array:
        """(size, d) what an input does to the states' rates.

        Raises
        ------
        OptionError
            It holds states.
        """
        system = self._system
        system.refuse([name])
        rates = system.X @ system.B[:, system.columns[name]]
        size = np.maximum(np.abs(self._spanned).max(axis=0, initial=0.0), TINY)
        return least_squares(self._spanned / size, rates, part=ELIMINATION) / size[:, None]

    def seen(self, name: str) -> Array:
        """(d, size) the power conjugate of an input, by the states."""
        system = self._system
        return system.ports[name][:, : system.k] @ self._spanned[system.which]

    def through(self, seen: str, given: str) -> Array:
        """(d, d) the power conjugate of an input, by an input."""
        system = self._system
        return system.ports[seen][:, system.k :][:, system.columns[given]]
