"""The sweeps written out for one mechanism: its constants are numbers of the program, its memory is registers."""

from dataclasses import dataclass, field
from typing import final

from ephs.mechanics.tree.sweeps.accelerations import accelerations, no_force
from ephs.mechanics.tree.sweeps.needs import NO_INTEGERS
from ephs.mechanics.tree.sweeps.pack import Packed
from ephs.mechanics.tree.sweeps.programs import given_force
from ephs.mechanics.tree.sweeps.records import Link, State, Tree
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Matrix,
    Program,
    Real,
    Table,
    Vector,
    integer,
    matrix,
    vector,
)
from ephs.semantics.stage.memory import RealCells

__all__ = ["unrolled"]


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Registers(RealCells):
    """Numbers that a program keeps while it is written out."""

    held: dict[int, Real] = field(default_factory=dict[int, Real])

    def load(self, index: Integer) -> Real:
        assert isinstance(index, int)
        return self.held.get(index, 0.0)

    def store(self, index: Integer, value: Real) -> None:
        assert isinstance(index, int)
        self.held[index] = value


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Known(RealCells):
    """A table's numbers, known."""

    table: Table[Link]

    def load(self, index: Integer) -> Real:
        return float(self.table.reals.load(index))

    def store(self, index: Integer, value: Real) -> None:
        raise IndexError(index)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Links:
    table: Table[Link]

    def of(self, i: Integer, kind: int | None) -> Link:
        return Link(self.table.integers, i * Link.integer_width, _Known(self.table), i * Link.real_width)


def unrolled(packed: Packed) -> Program:
    """The program of one mechanism.

    accelerations(q, r, force, rate): ṙ into rate under the forces on the rates; 0, or 1 + a link whose joint moves no
    mass. evaluations(q, r, rates, repeats): the same of many states by rows without forces.
    """
    size = packed.size
    gravity: list[Real] = [float(x) for x in packed.gravity]

    def run(on: Evaluator, q: Vector, r: Vector, force: Vector | None, rate: Vector) -> Integer:
        states = [State(NO_INTEGERS, 0, _Registers(), 0) for _ in range(size + 1)]
        tree = Tree(packed.kind.joints, size, _Links(packed.links), states, gravity)

        return accelerations(on, tree, q, r, rate, no_force if force is None else given_force(force))

    def evaluations(on: Evaluator, q: Matrix, r: Matrix, rates: Matrix, repeats: Integer) -> None:
        def one(k: Integer) -> None:
            run(on, q.row(k), r.row(k), None, rates.row(k))

        on.loop(repeats, lambda _: on.loop(q.rows, one))

    return Program(
        "unrolled",
        accelerations=Entry(run, q=vector(), r=vector(), force=vector(), rate=vector()),
        evaluations=Entry(evaluations, q=matrix(), r=matrix(), rates=matrix(), repeats=integer()),
    )
