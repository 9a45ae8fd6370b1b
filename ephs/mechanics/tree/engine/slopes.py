"""Derivatives of a mechanism's rates by its state: the rates over dual numbers, several directions a call."""

from collections.abc import Callable, Sequence
from functools import cache
from typing import final

import numpy as np

from ephs.mechanics.tree.engine.apart import Column
from ephs.mechanics.tree.engine.engine import Engine
from ephs.mechanics.tree.engine.motion import Mechanism
from ephs.mechanics.tree.engine.programs import of_motion
from ephs.mechanics.tree.engine.tangents import DIRECTIONS, paired_tables
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.stage import Evaluator, Integer, Program, Vector
from ephs.solve.sparse import Index

Call = tuple[tuple[Index, Index], Index, Index, Index]
"""Places of the seeds of one call, and rows, columns and directions of its derivatives."""


@cache
def rate_slopes() -> Program:
    """Return the program of the rates of trees over dual numbers."""

    def rates(on: Evaluator, motion: Mechanism, base: Vector, y: Vector, q: Vector, out: Vector) -> Integer:
        return motion.rates(on, base, y, q, out)[0]

    entry = of_motion(rates, looped=False)
    return Program(f"rates_of_trees_along_{DIRECTIONS}", rates=entry.tangent(directions=DIRECTIONS))


@final
class RateSlopes:
    """Derivatives of the rates of one tree.

    Parameters
    ----------
    engine
        Its equations, whose tables are read where they are.
    relation
        Called with the number of a component; returns the program and the entry that it is in machine code.
    calls
        What is asked for, by `calls_of`; all other derivatives are 0.
    size
        How many numbers of y have rates of interest: the first ones.
    """

    def __init__(
        self,
        engine: Engine,
        relation: Callable[[int], tuple[Program, str]],
        calls: Sequence[Call],
        size: int,
    ) -> None:
        coordinates, whole = engine.sizes
        self._q, self._y, self._out = (np.zeros(count) for count in (coordinates, whole, whole))
        self._seed, self._slope = np.zeros((2, whole, DIRECTIONS))
        self._size = size
        self._calls = calls
        still, moved = np.zeros((coordinates, DIRECTIONS)), np.zeros((coordinates, DIRECTIONS))
        tables, work = paired_tables(engine, relation)
        self._run = rate_slopes().compiled()["rates"].bind(
            tables, work, (self._q, still), (self._y, self._seed), (np.zeros(coordinates), moved),
            (self._out, self._slope),
        )  # fmt: skip

    @property
    def calls(self) -> int:
        """Number of calls for one matrix."""
        return len(self._calls)

    def at(self, q: Array, y: Array) -> tuple[int, Array]:
        """A status, and ∂ẏ/∂y (size, size) where joints' elements are q·exp(v)."""
        self._q[:], self._y[:] = q, y
        found = np.zeros((self._size, self._size))
        for seeds, rows, columns, along in self._calls:
            self._seed[seeds] = 1.0
            status = int(self._run())
            self._seed[seeds] = 0.0
            if status:
                return status, found
            found[rows, columns] = self._slope[rows, along]
        return 0, found


def calls_of(wanted: Sequence[Sequence[Column]]) -> list[Call]:
    """Return the calls for the columns of each direction; no two columns of a direction share a row."""
    return [_call(wanted[k : k + DIRECTIONS]) for k in range(0, len(wanted), DIRECTIONS)]


def _call(directions: Sequence[Sequence[Column]]) -> Call:
    every = [(column, k, rows) for k, columns in enumerate(directions) for column, rows in columns]
    columns, along = (np.array([one[i] for one in every], dtype=np.int64) for i in (0, 1))
    counts = [len(rows) for _, _, rows in every]
    whole = np.concatenate([rows for _, _, rows in every])
    return (columns, along), whole, np.repeat(columns, counts), np.repeat(along, counts)
