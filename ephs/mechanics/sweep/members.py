"""Marches of many members in one call of compiled code, and the energies at some of their instants.

Calls and arrays of the structure are bound once a thread. A member is a row in stacks of arrays: its start, what its
march keeps, and those tables whose numbers differ from member to member.
"""

from collections.abc import Sequence
from typing import Any, final

import numpy as np

from ephs.mechanics.methods.marching import March
from ephs.mechanics.sweep.images import Truths
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.stage.repeating import Repeated
from ephs.solve.equations.sparse import Index
from ephs.solve.march.account import RunAccount
from ephs.solve.march.records import Ending, MarchControl

Stack = tuple["np.ndarray[Any, Any]", "np.ndarray[Any, Any]"]
"""An array of bound calls, and one of its shape for every member, in rows."""
OWN = ("q", "y", "carry", "rows_t", "rows_q", "rows_y")
"""Memory of a march that each member has; the rest is written before it is read."""


@final
class Marches:
    """Marches of members, each as a run of its own.

    Parameters
    ----------
    leg
        A march that has not begun, from any start.
    tables
        Tables that differ from member to member.
    most
        Number of members.

    Attributes
    ----------
    q, y
        (members, …) elements, and y as in `ephs.solve.march.Memory`: after `run` at the end.
    rows_t, rows_q, rows_y
        (members, instants, …) the instants that were kept.
    """

    def __init__(self, leg: March, tables: Sequence[Stack], most: int) -> None:
        self._leg, arrays = leg, self._arrays(leg)
        self._fresh = [array.copy() for array in arrays]
        self._stacks: list[Any] = [np.zeros((most, *array.shape), dtype=array.dtype) for array in arrays]
        self.q, self.y, _, *rows, self._counts, self._reals, _, self._account = self._stacks
        kept = slice(leg.times.size - leg.span.saved)
        self.rows_t, self.rows_q, self.rows_y = (each[:, kept] for each in rows)
        self._run = Repeated(leg.march, [*zip(arrays, self._stacks, strict=True), *tables])

    @staticmethod
    def _arrays(leg: March) -> list[Any]:
        return [*(leg.memory[name] for name in OWN), *leg.steering.arrays, *leg.account.arrays]

    def run(self, q: Array, y: Array, steps: int) -> Index:
        """March from starts (members, …), of elements, and y without increments, with so many steps at most.

        Returns each member's `Ending`: `Ending.CAREFUL` where a step needs Python, see `take`.
        """
        count = len(q)
        for stack, fresh in zip(self._stacks, self._fresh, strict=True):
            stack[:count] = fresh
        self.q[:count], self.y[:count, self._leg.method.equations.nv :] = q, y
        return self._run(count, steps) if self._leg.explicit else np.full(count, int(Ending.CAREFUL))

    def take(self, member: int, leg: March) -> None:
        """Take over the end of a member whose march was taken otherwise."""
        for stack, array in zip(self._stacks, self._arrays(leg), strict=True):
            stack[member] = array

    @property
    def steps(self) -> Index:
        """(members,) accepted steps."""
        return self._counts[:, MarchControl.steps.offset]

    @property
    def rejected(self) -> Index:
        """(members,) rejected steps."""
        return self._counts[:, MarchControl.rejected.offset]

    @property
    def least(self) -> Array:
        """(members,) the least entropy in J/K that a component made in a step."""
        return self._reals[:, MarchControl.least.offset]

    @property
    def put(self) -> Array:
        """(members, instants + 1) energies in J that corrections had put in, at last those at the end."""
        return np.column_stack([self.rows_t[:, :, 2], self._account[:, RunAccount.put.offset]])


@final
class MemberEnergies:
    """All states of a system, and their energies, at some instants of every member.

    Parameters
    ----------
    tables, most
        As of `Marches`.
    instants
        Number of a member's instants.
    """

    def __init__(self, equations: ReducedEquations, tables: Sequence[Stack], most: int, instants: int) -> None:
        self._equations, paper = equations, equations.booking.paper
        q, r = np.zeros((instants, equations.reduced.coordinates)), np.zeros((instants, equations.n))
        stored, x = paper.stored(r, np.zeros((instants, equations.ns))), np.tile(paper.rest, (instants, 1))
        energies = np.zeros((instants, len(equations.problem.descriptor.components)))
        arrays = q, r, stored, x, energies
        self._stacks = [np.tile(array, (most, 1, 1)) for array in arrays]
        stacks = [*zip(arrays, self._stacks, strict=True), *tables]
        self._walk = Repeated(paper.walked(q, r, stored, x), stacks)
        self._weigh = Repeated(equations.booking.weighed(x, energies, np.zeros(1, dtype=np.int64)), stacks)

    def of(self, q: Array, r: Array, s: Array) -> tuple[Array, Array, Truths]:
        """States, energies in J, and (members,) whether there are such.

        They are views, which the next call overwrites; the arguments are elements, rates and entropies (members,
        instants, …).
        """
        own_q, own_r, stored, x, energies = (stack[: len(q)] for stack in self._stacks)
        own_q[:], own_r[:] = q, r
        flat = (each.reshape(-1, each.shape[-1]) for each in (r, s))
        stored[:] = self._equations.booking.paper.stored(*flat).reshape(stored.shape)
        self._walk(len(q))
        return x, energies, self._weigh(len(q)) == 0
