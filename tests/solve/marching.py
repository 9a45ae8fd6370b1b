"""A march of a plain right-hand side, run with floats and as machine code; what tests and benchmarks share."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.mechanics.methods.explicit import tableau
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Matrix,
    Program,
    Real,
    Vector,
    integer,
    kind_of,
    table,
    vector,
)
from ephs.solve.march.account import RunAccount
from ephs.solve.march.control import DAMPING, STRICT
from ephs.solve.march.march import march
from ephs.solve.march.memory import Memory, Totals
from ephs.solve.march.records import Ending, MarchControl, Motion, TableauRecord


class Plain(Motion):
    """What a motion without heat, sums and constraints has nothing to do for."""

    def rounding(self, on: Evaluator, anchor: Real, y: Vector) -> Real:
        return 0.0

    def book(self, on: Evaluator, tableau: TableauRecord, k: Matrix, h: Real, totals: Totals) -> Integer:
        return 0

    def absorb(self, on: Evaluator, anchor: Real, y0: Vector, q: Vector, y1: Vector, change: Vector) -> None:
        """There is no heat."""

    def warm(self, on: Evaluator, y0: Vector, y: Vector) -> None:
        """There is no heat."""

    def hold(self, on: Evaluator, change: Vector, low: Vector, high: Vector, *, made: bool) -> None:
        """There are no sums."""

    def open(self, on: Evaluator, account: RunAccount, q: Vector, y: Vector) -> Integer:
        return 0

    def least(self, on: Evaluator, change: Vector) -> Real:
        return 0.0


@final
@dataclass(frozen=True, slots=True)
class Field(Plain):
    """A plain right-hand side ẏ = f(y) on ℝⁿ.

    Parameters
    ----------
    function
        Called with the evaluator, y, the vector for ẏ and the parameters; returns a status.
    parameters
        Memory that it reads.
    size
        n.
    """

    function: Callable[[Evaluator, Vector, Vector, Any], Integer]
    parameters: Any
    size: Integer

    @property
    def increments(self) -> Integer:
        return 0

    @property
    def freedoms(self) -> Integer:
        return 0

    @property
    def summed(self) -> Integer:
        return self.size

    @property
    def counted(self) -> Integer:
        return self.size

    @property
    def closes(self) -> bool:
        return False

    def rates(self, on: Evaluator, base: Vector, y: Vector, q: Vector, out: Vector) -> tuple[Integer, Integer]:
        return self.function(on, y, out, self.parameters), 0

    def settle(self, on: Evaluator, base: Vector, y: Vector, q: Vector) -> Integer:
        return 0

    def correct(
        self, on: Evaluator, account: RunAccount, h: Real, start: Vector, y: Vector, q: Vector, allowed: Vector
    ) -> Integer:
        account.moved, account.rest, account.size = 0.0, 0.0, 0.0
        return 0

    def sizes(self, on: Evaluator, y0: Vector, y1: Vector, out: Vector) -> None:
        def one(j: Integer) -> None:
            out[j] = on.maximum(on.absolute(y0[j]), on.absolute(y1[j]))

        on.loop(self.size, one)

    def project(self, on: Evaluator, q: Vector, change: Vector) -> None:
        """There are no constraints."""


def program(motion):
    """The program of a motion, made of parameters and the size of y."""

    def run(on, parameters, control, tableau, memory, account, steps):
        return march(on, motion(parameters, memory.y.size), tableau, memory, control[0], account[0], steps)

    kinds = {"tableau": kind_of(TableauRecord), "memory": kind_of(Memory)}
    kinds |= {"account": table(RunAccount), "steps": integer()}
    return Program("march", run=Entry(run, parameters=vector(), control=table(MarchControl), **kinds))


def field(function):
    """The program of a right-hand side f(on, y, out, parameters)."""
    return program(lambda parameters, size: Field(function, parameters, size))


@dataclass
class March:
    """The march of one run: its arrays, as a driver keeps them."""

    control: object
    arrays: dict
    call: object

    @property
    def c(self):
        return self.control[0]

    def advance(self, steps):
        ending = self.call(steps)
        return Ending(ending) if ending in iter(Ending) else ending

    def snapshot(self):
        kept = {name: self.arrays[name].copy() for name in ("q", "y", "k")}
        return kept | {"reals": self.control.reals.array.copy(), "integers": self.control.integers.array.copy()}

    def restore(self, snapshot):
        for name in ("q", "y", "k"):
            self.arrays[name][:] = snapshot[name]
        self.control.reals.array[:], self.control.integers.array[:] = snapshot["reals"], snapshot["integers"]
        self.c.rows = 0

    def rows(self):
        count = int(self.c.rows)
        return self.arrays["rows_t"][:count, 0], self.arrays["rows_y"][:count]


def start(call, method, y, until, *, parameters=(0.0,), rtol=1e-9, atol=1e-12, step=1e-3, times=None, rows=4096,
          limit=0.0, grid=0.0, least_step=0.0, origin=0.0, q=(), increments=0):  # fmt: skip
    """A march from y over ``until`` seconds, backward where it is negative."""
    found = tableau(method)
    size = len(y)
    control = MarchControl.table(1)
    c = control[0]
    c.end, c.span, c.step, c.origin, c.grid = float(until), abs(float(until)), step, origin, grid
    c.least_step, c.most_step, c.before, c.limit = least_step, np.inf, 1e-4, limit
    c.shortest, c.least = np.inf, np.inf
    c.exponent, c.share, c.damping, c.strict = found.exponent, 0.5, DAMPING, STRICT
    c.saved = -1 if times is None else 0
    stages, elements = (len(found.arrays["a"]), size), np.array(q, dtype=float)
    kept = np.zeros(0) if times is None else np.abs(np.asarray(times, dtype=float))
    arrays = {
        "q": elements.copy(), "y": np.array(y, dtype=float), "k": np.zeros(stages), "q1": elements.copy(),
        "y1": np.zeros(size), "q2": elements.copy(), "y2": np.zeros(size), "k2": np.zeros(stages),
        "last": np.zeros(size),
        "atol": np.full(size, atol), "rtol": np.full(size, rtol), "allowed": np.zeros(size), "open": np.zeros(0),
        "fine": np.zeros(size),
        "coarse": np.zeros(size), "times": kept, "rows_t": np.zeros((rows, 4)),
        "rows_q": np.zeros((rows, elements.size)),
        "rows_y": np.zeros((rows, size - increments)),
        **{name: np.zeros(0) for name in ("carry", "carry1", "carry2", "change", "size", "whole", "low")},
    }  # fmt: skip
    passed = np.array(parameters, dtype=float), control, found.arrays, arrays, RunAccount.table(1)
    return March(control, arrays, lambda steps: call(*passed, steps))
