"""Looped programs of the sweeps, specialised by what a class of mechanisms has in common."""

from dataclasses import dataclass
from functools import cache
from typing import final

from ephs.mechanics.tree.accelerations import accelerations
from ephs.mechanics.tree.needs import NO_INTEGERS, Compact, LaidOut, Layout, Survey, layout_of
from ephs.mechanics.tree.pack import Class
from ephs.mechanics.tree.records import Joint, Link, State, Tree
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
    table,
    vector,
)
from ephs.semantics.stage.memory import IntegerCells, RealCells

__all__ = ["Sweeps", "sweeps"]


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Links:
    """Constants of links, of which those that a kind of joints has in common are known."""

    constants: tuple[Layout, ...]
    integers: IntegerCells
    reals: RealCells

    def of(self, i: Integer, kind: int | None) -> Link:
        start = i * Link.real_width
        cells = self.reals if kind is None else LaidOut(self.constants[kind], self.reals, start)
        return Link(self.integers, i * Link.integer_width, cells, start if kind is None else 0)


@final
class Sweeps:
    """The sweeps of a class of mechanisms as a program.

    Attributes
    ----------
    width
        Numbers of memory that a link takes; the ground takes as many.
    program
        accelerations(links, memory, gravity, q, r, force, rate): ṙ into rate under the forces on the rates; 0, or 1 + a
        link whose joint moves no mass. evaluations(links, memory, gravity, q, r, rates, repeats): the same of many
        states by rows without forces; what a benchmark calls.
    """

    def __init__(self, kind: Class) -> None:
        self._class = kind
        width = Link.real_width
        self._constants = tuple(
            Layout(dict(known), {k: k for k in range(width) if k not in dict(known)}) for known in kind.constants
        )
        self._layout = layout_of(State.real_width, self._survey)
        self.width = self._layout.width
        arrays = {"links": table(Link), "memory": vector(), "gravity": vector(3)}
        self.program = Program(
            "sweeps",
            accelerations=Entry(self._accelerations, **arrays, q=vector(), r=vector(), force=vector(), rate=vector()),
            evaluations=Entry(self._evaluations, **arrays, q=matrix(), r=matrix(), rates=matrix(), repeats=integer()),
        )

    def _tree(self, links: _Links, size: Integer, memory: Vector, layout: Layout, gravity: Vector) -> Tree:
        known = [gravity[k] if value is None else value for k, value in enumerate(self._class.gravity)]
        return Tree(self._class.joints, size, links, Compact(State, layout, memory), known)

    def _survey(self, survey: Survey) -> None:
        outside = survey.outside()
        links = _Links(self._constants, survey.integers(), outside.cells)
        states = _Whole(survey.memory())
        known = [outside[0] if value is None else value for value in self._class.gravity]
        tree = Tree(self._class.joints, outside.size, links, states, known)
        survey.returned(self._run(survey, tree, outside, outside, outside, outside))

    def _run(self, on: Evaluator, tree: Tree, q: Vector, r: Vector, force: Vector | None, rate: Vector) -> Integer:
        def given(i: Integer, joint: Joint, link: Link) -> list[Real]:
            return [0.0 if force is None else force[link.r_at + j] for j in range(joint.dim)]

        return accelerations(on, tree, q, r, rate, given)

    def _accelerations(
        self, on: Evaluator, links: Table[Link], memory: Vector, gravity: Vector, q: Vector, r: Vector, force: Vector,
        rate: Vector,
    ) -> Integer:  # fmt: skip
        rows = _Links(self._constants, links.integers, links.reals)
        tree = self._tree(rows, links.size, memory, self._layout, gravity)
        return self._run(on, tree, q, r, force, rate)

    def _evaluations(
        self, on: Evaluator, links: Table[Link], memory: Vector, gravity: Vector, q: Matrix, r: Matrix, rates: Matrix,
        repeats: Integer,
    ) -> None:  # fmt: skip
        rows = _Links(self._constants, links.integers, links.reals)
        tree = self._tree(rows, links.size, memory, self._layout, gravity)
        on.loop(
            repeats,
            lambda _: on.loop(q.rows, lambda k: _ignore(self._run(on, tree, q.row(k), r.row(k), None, rates.row(k)))),
        )


def _ignore(value: object) -> None: ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Whole:
    """Memory of a survey: all rows are one."""

    cells: RealCells

    def __getitem__(self, i: Integer) -> State:
        return State(NO_INTEGERS, 0, self.cells, 0)


@cache
def sweeps(kind: Class) -> Sweeps:
    """The program of a class, made once."""
    return Sweeps(kind)
