"""A step's end moved to the energy that work and heat leave to it, of any system on vector spaces.

The move is that of `ephs.solve.march.storing`; stores of heat are advanced by energy before, see `Passages`. Entropies
are not moved. What they miss, as those of gases, is left: else a large store would move all that is small beside it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.numbering import Index
from ephs.semantics.linear.sums import grown
from ephs.semantics.primitives.primitives import Storage
from ephs.semantics.spaces.rank import TINY
from ephs.semantics.stage import Entry, Evaluator, Integer, Program, Real, Table, Vector
from ephs.solve.equations.model import Model
from ephs.solve.march.account import ROUNDING, RunAccount, rounding, worth
from ephs.solve.march.noted import Noted
from ephs.solve.march.storing import Missing, Moved, store
from ephs.solve.methods.continuous import AccumulatorRates
from ephs.solve.methods.places import Part
from ephs.solve.methods.records import STORING, Columns, Scratch, efforts_of, rates_of
from ephs.solve.methods.residuals import FAULTS, called
from ephs.solve.posing.errors import SolveError
from ephs.solve.running.snapshot import parts

ANCHOR, LEFT, PUT, TOTAL, HEAT, CARRY, MISSED = range(7)
"""Numbers of a state's account: those of `RunAccount`; the heat in J that went to stores of heat, less what entropies
missed, and its rounding; what entropies missed."""
STILL = 1e-12
"""Part of the power into a storage below which that into its other states than entropies is rounding."""


def _stored_energies(
    on: Evaluator, t: Columns, weights: Vector, z: Vector, scal: Vector, m: Scratch, states: Vector, out: Vector
) -> Integer:
    """Write the energy in J of all storages, zero, and the sum of its terms' sizes to out (3,).

    Returns
    -------
    Integer
        0, or a status + FAULTS · the storage.
    """
    total, carry, size, fault = (*(on.variable(0.0) for _ in range(3)), on.counter(0))

    def add(energy: Real) -> None:
        total.value, carry.value = grown(total.value, carry.value, energy)
        size.value = size.value + on.absolute(energy)

    def storage(i: Integer) -> None:
        found = called(on, Part.of(t, i), states, z, scal, m)

        def fail() -> None:
            fault.value = found + FAULTS * i

        on.when(on.same(found, 0), lambda: add(m.c[0]), fail)

    on.loop(states.size, lambda k: add(weights[k] * states[k]))
    on.loop(t.kind.size, lambda i: on.when(on.same(fault.value, 0), lambda: storage(i)))
    out[0], out[1], out[2] = total.value, 0.0, size.value
    return fault.value


@final
@dataclass(frozen=True, slots=True)
class _StorageNetwork(Missing):
    """The energy of storages."""

    given: tuple[Columns, Vector, Vector, Vector, Scratch]

    def look(self, states: Vector) -> None:
        self.status.value = _stored_energies(self.on, *self.given, states, self.energies)


def settled(
    on: Evaluator, t: Columns, weights: Vector, z: Vector, scal: Vector, m: Scratch, account: Table[RunAccount],
    states: Vector, start: Vector, along: Vector, beside: Vector, trial: Vector, allowed: Vector, free: Vector,
    work: Real, heat: Real, moves: Integer,
) -> Integer:  # fmt: skip
    """Write to the account what states miss of the energy that work and heat in J leave to them, with its rounding.

    Where ``moves`` is 1, move the states by that, and let the account's ``size`` be the step's error by it, in
    tolerances.

    Returns
    -------
    Integer
        0, or a status + FAULTS · storage.
    """
    a, given = account[0], (t, weights, z, scal, m)
    run = _StorageNetwork(on, a, a.anchor + (work - heat), on.scratch(3), on.counter(0), False, given)
    run.look(states)
    a.noise, a.rest = rounding(on, a.anchor, work, heat) + ROUNDING * run.energies[2], run.short

    def move() -> None:
        a.moved, a.size = 0.0, 0.0
        store(run, Moved(states, start, along, beside, trial, allowed, lambda k: free[k]))
        a.rest = run.short
        a.size = worth(on, a)

    on.when(on.same(moves, 1), move)
    return run.status.value


@cache
def settling_program() -> Program:
    """Return the program of the correction."""
    return Program("settling", settled=Entry(settled))


@final
class Settling:
    """The energy of a model's storages but those of heat, which steps are moved to. It keeps memory.

    Parameters
    ----------
    booked
        Numbers of the storages that are advanced by energy, as `Passages` has them.

    Attributes
    ----------
    active
        Whether there are such storages; where none of their states may be moved, what they miss is left.
    mixed
        (storages,) those of them with entropies; of environments, whose energy is linear, entropies miss nothing.
    noted
        What was moved in states that are kept.
    """

    def __init__(self, model: Model, booked: Index) -> None:
        t, d = model.tables, model.descriptor
        counted = np.setdiff1d(np.flatnonzero(t.kind == STORING), booked)
        self._model, self._counted, self.noted = model, counted, Noted()
        self._free, weights = np.zeros(d.point_size), np.zeros(d.point_size)
        mixed: list[int] = []
        for number in counted.tolist():
            slot = d.components[number]
            environment = isinstance(slot.primitive, Storage) and slot.primitive.environment
            for state in slot.reads:
                self._free[state.point] = float(state.quantity.kind != "entropy")
                weights[state.point] = model.reference.intensive(state.quantity) if environment else 0.0
            if not environment and t.entropy[efforts_of(t, np.array([number]))].any():
                mixed.append(number)
        self.active, self.mixed = bool(counted.size), np.array(mixed, dtype=np.int64)
        self._rates, efforts = rates_of(t, self.mixed), efforts_of(t, self.mixed)
        self._efforts, self._intensive = int(t.counts[0]) + efforts, t.intensive[efforts]
        self._thermal, self._owners = t.entropy[efforts], np.repeat(np.arange(self.mixed.size), t.dims[self.mixed, 0])
        tables = replace(model.only(counted).tables, address=model.resting(counted)[counted])
        self._account = RunAccount.table(1)
        self._states, self._start, self._along, self._beside, trial, self._allowed = np.zeros((6, d.point_size))
        self._settled = settling_program().compiled()["settled"].bind(
            parts(tables), weights, np.zeros(model.unknowns), model.scal(0.0), parts(model.memory()),
            self._account, self._states, self._start, self._along, self._beside, trial, self._allowed, self._free,
            0.0, 0.0, 0,
        )  # fmt: skip

    def opened(self, x: Array) -> Array:
        """An account that begins at the states x.

        Raises
        ------
        SolveError
            A storage cannot be evaluated there.
        """
        a: Any = self._account[0]
        self._states[:], a.anchor = x, 0.0
        self._refuse(self._settled(0.0, 0.0, 0))
        account = np.zeros(MISSED + 1)
        account[ANCHOR] = -a.rest
        return account

    def powers(self, found: AccumulatorRates) -> Array:
        """Power in W into each state of the storages with entropies, at an instant."""
        return (found.unknowns[self._efforts] + self._intensive) * found.unknowns[self._rates]

    def missed(self, weights: Array, powers: Array, change: Array) -> float:
        """Energy in J by which entropies miss what passed in a step, of storages that nothing else changes.

        Others are moved along what else changes in them.

        Parameters
        ----------
        weights
            (stages,) in s.
        powers
            (stages, states of storages with entropies) in W.
        change
            (storages with entropies,) of their energies in J.
        """
        passed = np.bincount(self._owners, weights @ powers, self.mixed.size)
        sizes = abs(powers).sum(axis=0)
        whole = np.bincount(self._owners, sizes, self.mixed.size)
        other = np.bincount(self._owners, sizes * (1.0 - self._thermal), self.mixed.size)
        return float((change - passed) @ (other <= STILL * whole))

    def settled(
        self, account: Array, start: Array, x: Array, directions: Callable[[], Array], allowed: Array, work: float,
        heat: float, missed: float, *, chosen: bool,
    ) -> tuple[Array, Array, float]:  # fmt: skip
        """The end x of a step moved to its energy, the account after it, and the step's error by that in tolerances.

        Parameters
        ----------
        account, start
            At the start of the step.
        directions
            Makes (2, states): what the step changed, and h ẋ at its end less that.
        allowed
            (states,) what errors may be.
        work, heat
            Work in J since the start of the run; heat in J that went to stores of heat in the step.
        missed
            Energy in J that entropies missed in the step, which nothing else makes up for.
        chosen
            Whether steps are chosen: then states are moved by no more than `MOST` of what is allowed.

        Raises
        ------
        SolveError
            A storage cannot be evaluated there.
        """
        a: Any = self._account[0]
        taken, carry = grown(float(account[HEAT]), float(account[CARRY]), heat - missed)
        (a.anchor, a.left), a.chosen, a.moved, a.size = account[: LEFT + 1].tolist(), int(chosen), 0.0, 0.0
        self._states[:] = x
        self._refuse(self._settled(work, taken, 0))
        if abs(a.rest) > a.noise:
            self._start[:], self._allowed[:] = start, np.maximum(allowed, TINY)
            self._along[:], self._beside[:] = directions() * self._free
            self._refuse(self._settled(work, taken, 1))
        put, total = account[PUT] + a.moved, account[TOTAL] + abs(a.moved)
        kept = np.array([a.anchor, a.rest, put, total, taken, carry, account[MISSED] - missed])
        return self._states.copy(), kept, float(a.size)

    def _refuse(self, fault: int) -> None:
        if fault:
            raise SolveError.of_component(fault % FAULTS, self._model, int(self._counted[fault // FAULTS]))
