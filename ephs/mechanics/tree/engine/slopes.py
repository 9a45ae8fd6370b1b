"""Derivatives of a mechanism's rates by its state: the rates over dual numbers, several directions a call.

Forces of components are evaluated once at the state, with derivatives, and then read to first order: components need
no dual numbers.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any, Final, final

import numpy as np
from scipy.sparse import csc_array

from ephs.mechanics.tree.engine.apart import Column
from ephs.mechanics.tree.engine.attachment import with_derivatives
from ephs.mechanics.tree.engine.engine import Engine
from ephs.mechanics.tree.engine.motion import Mechanism
from ephs.mechanics.tree.engine.programs import of_motion
from ephs.mechanics.tree.engine.tables import copied
from ephs.mechanics.tree.engine.tangents import DIRECTIONS, paired
from ephs.mechanics.tree.sweeps.expanding import ABOUT, About, memory_about
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.stage import Evaluator, Integer, Program, Vector, group
from ephs.solve.equations.sparse import Index

if TYPE_CHECKING:
    from ephs.mechanics.tree.finding.mechanism import Reduced

SWEPT: Final = ("accelerations", "move", "fold", "dependent", "unfold", "power", "rows", "advance", "velocities")
"""Functions of a mechanism's class that its rates call, beside what acts."""
Call = tuple[tuple[Index, Index], Index, Index, Index]
"""Places of the seeds of one call, and rows, columns and directions of its derivatives."""


@cache
def rate_slopes(*, looped: bool) -> Program:
    """Return the program of the rates that keep what acts about a state, and of those over dual numbers there."""

    def keep(
        on: Evaluator, motion: Mechanism, about: About, base: Vector, y: Vector, q: Vector, out: Vector
    ) -> Integer:
        return replace(motion, kept=about).rates(on, base, y, q, out)[0]

    def rates(
        on: Evaluator, motion: Mechanism, about: About, base: Vector, y: Vector, q: Vector, out: Vector
    ) -> Integer:
        moved = replace(about, increment=y.part(0, motion.increments))
        return replace(motion, read=moved).rates(on, base, y, q, out)[0]

    about = group(About, **ABOUT)
    return Program(
        f"rates_of_{'loops' if looped else 'trees'}_along_{DIRECTIONS}",
        keep=of_motion(keep, looped=looped, about=about),
        rates=of_motion(rates, looped=looped, about=about).tangent(directions=DIRECTIONS),
    )


def rate_slopes_of_loops() -> Program:
    """Return the program with loops."""
    return rate_slopes(looped=True)


def rate_slopes_of_trees() -> Program:
    """Return the program without loops."""
    return rate_slopes(looped=False)


@final
class RateSlopes:
    """Derivatives of the rates of one mechanism; it keeps memory.

    Parameters
    ----------
    engine
        Its equations, whose tables are read where they are.
    calls
        What is asked for, by `calls_of`; all other derivatives are 0.
    size
        How many numbers of y have rates of interest: the first ones.
    sparse
        Whether matrices have the entries that are asked for alone.

    Attributes
    ----------
    engine
        As given.
    """

    def __init__(
        self, engine: Engine, reduced: "Reduced", calls: Sequence[Call], size: int, *, sparse: bool = False
    ) -> None:
        coordinates, whole = engine.sizes
        self.engine, self._size, self._calls = engine, size, calls
        self._base, self._y, self._out = (np.zeros(count) for count in (coordinates, whole, whole))
        self._seed, self._slope = np.zeros((2, whole, DIRECTIONS))
        tables = with_derivatives(engine.tables, reduced.tables.address)
        work = {name: array.copy() for name, array in engine.work.items()}
        work |= {"e": np.zeros(64), "jac": np.zeros(1024), "scratch": np.zeros(4096)}
        self._fault, self._sparse = work["fault"], _SlopeEntries(calls, size) if sparse else None
        net, q = reduced.attaching.network, np.zeros(coordinates)
        about = memory_about(reduced.tables.evaluated, net.known, len(reduced.attaching.bent))
        about["increment"] = np.zeros(engine.work["still"].size)
        found = rate_slopes(looped=engine.looped).compiled()
        self._keep = found["keep"].bind(tables, work, about, self._base, self._y, q, self._out)
        tables["own"] = _tangents(engine)
        still, moved = np.zeros((coordinates, DIRECTIONS)), np.zeros((coordinates, DIRECTIONS))
        self._run = found["rates"].bind(
            paired(tables), paired(work), paired(about), (self._base, still), (self._y, self._seed), (q, moved),
            (self._out, self._slope),
        )  # fmt: skip

    @property
    def calls(self) -> int:
        """Number of calls for one matrix."""
        return len(self._calls)

    @property
    def failed(self) -> int:
        """Number of the component or degree of freedom at which the evaluation failed last."""
        return int(self._fault[0])

    def at(self, q: Array, y: Array) -> "tuple[int, Array | csc_array]":
        """A status, and ∂ẏ/∂y (size, size) where joints' elements are q·exp(v), at v = 0."""
        self._base[:], self._y[:] = q, y
        status, values = int(self._keep()), list[Array]()
        for seeds, rows, _, along in self._calls:
            if not status:
                self._seed[seeds] = 1.0
                status = int(self._run())
                self._seed[seeds] = 0.0
            values.append(self._slope[rows, along])
        if self._sparse is not None:
            return status, self._sparse.matrix(np.concatenate(values))
        found = np.zeros((self._size, self._size))
        for (_, rows, columns, _), entries in zip(self._calls, values, strict=True):
            found[rows, columns] = entries
        return status, found


@final
class _SlopeEntries:
    """Places of the derivatives of all calls in a sparse matrix, column by column."""

    def __init__(self, calls: Sequence[Call], size: int) -> None:
        rows, columns = (np.concatenate([call[k] for call in calls]) for k in (1, 2))
        self._order, self._size = np.lexsort((rows, columns)), size
        starts = np.append(0, np.cumsum(np.bincount(columns, minlength=size)))
        self._indices, self._starts = rows[self._order].astype(np.int32), starts.astype(np.int32)

    def matrix(self, values: Array) -> csc_array:
        """The matrix of values in the order of the calls."""
        return csc_array((values[self._order], self._indices, self._starts), shape=(self._size, self._size))


def _tangents(engine: Engine) -> Any:
    """The addresses of the tangents of all that the rates call but what acts."""
    own = copied(engine.tables["own"])
    for name, (program, entry) in engine.reached.items():
        if entry in SWEPT:
            setattr(own[0], name, _swept(program).compiled()[entry].address)
    return own


@cache
def _swept(program: Program) -> Program:
    """The tangents of a program's functions that the rates call."""
    chosen = {name: entry for name, entry in program.entries.items() if name in SWEPT}
    return Program(
        f"{program.name}_along_{DIRECTIONS}",
        **{name: entry.tangent(directions=DIRECTIONS) for name, entry in chosen.items()},
    )


def calls_of(wanted: Sequence[Sequence[Column]]) -> list[Call]:
    """Return the calls for the columns of each direction; no two columns of a direction share a row."""
    return [_call(wanted[k : k + DIRECTIONS]) for k in range(0, len(wanted), DIRECTIONS)]


def _call(directions: Sequence[Sequence[Column]]) -> Call:
    every = [(column, k, rows) for k, columns in enumerate(directions) for column, rows in columns]
    columns, along = (np.array([one[i] for one in every], dtype=np.int64) for i in (0, 1))
    counts = [len(rows) for _, _, rows in every]
    whole = np.concatenate([rows for _, _, rows in every])
    return (columns, along), whole, np.repeat(columns, counts), np.repeat(along, counts)
