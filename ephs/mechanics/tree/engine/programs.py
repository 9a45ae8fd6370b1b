"""Programs of all mechanisms' equations of motion, with loops or without."""

from collections.abc import Callable
from functools import cache
from typing import Any

from ephs.mechanics.tree.engine.balance import measure, stored_energies
from ephs.mechanics.tree.engine.drags import Drags
from ephs.mechanics.tree.engine.motion import Mechanism
from ephs.mechanics.tree.engine.shutting import close
from ephs.mechanics.tree.sweeps.acting import TOTALS, Tables, Work
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Matrix,
    Program,
    Real,
    Table,
    Vector,
    kind_of,
)
from ephs.solve.march.account import RunAccount, worth
from ephs.solve.march.evaluating import MarchStep
from ephs.solve.march.lagged import begin, finish, stage
from ephs.solve.march.march import march
from ephs.solve.march.memory import Memory, Totals
from ephs.solve.march.records import MarchControl, TableauRecord
from ephs.solve.march.steps import attempt, book
from ephs.solve.march.stiff import Stiff

_MOVING: dict[str, Any] = {"tables": kind_of(Tables), "work": kind_of(Work)}
"""Kinds of a mechanism's arguments, which all entry functions have first."""


def of_motion(function: Callable[..., Any], *, looped: bool, **kinds: Any) -> Entry:
    """Return an entry function of a mechanism, which takes its tables and memory first."""

    def moving(tables: Tables, work: Work) -> Mechanism:
        return Mechanism(tables, work, looped)

    return Entry.bundled(function, {**_MOVING, **kinds}, (_MOVING, moving))


@cache
def motion_program(*, looped: bool) -> Program:
    """Return the program: what is the same for all mechanisms; what is not it calls by addresses in their tables."""

    def marched(
        on: Evaluator, motion: Mechanism, tableau: TableauRecord, memory: Memory, control: Table[MarchControl],
        account: Table[RunAccount], steps: Integer,
    ) -> Integer:  # fmt: skip
        return march(on, motion, tableau, memory, control[0], account[0], steps)

    def stages(
        on: Evaluator,
        motion: Mechanism,
        tableau: TableauRecord,
        control: Table[MarchControl],
        base: Vector,
        start: Vector,
        k: Matrix,
        last: Vector,
        y: Vector,
        q: Vector,
        h: Real,
    ) -> Integer:
        return attempt(on, MarchStep(motion, tableau, control[0], base, start, h, k, y, q), None, last)

    def rates(on: Evaluator, motion: Mechanism, base: Vector, y: Vector, q: Vector, out: Vector) -> Integer:
        return motion.rates(on, base, y, q, out)[0]

    def project(on: Evaluator, motion: Mechanism, q: Vector, change: Vector) -> None:
        motion.project(on, q, change)

    def velocities(on: Evaluator, motion: Mechanism, y: Vector, r: Vector, out: Vector) -> None:
        motion.velocities(on, y, r, out)

    def counted(on: Evaluator, motion: Mechanism, before: Vector, after: Vector) -> None:
        motion.count(on, before, after)

    def summed(
        on: Evaluator, motion: Mechanism, tableau: TableauRecord, k: Matrix, totals: Totals, q: Vector, h: Real,
        anchor: Real, part: Integer, damped: Integer,
    ) -> Integer:  # fmt: skip
        status = on.counter(0)

        def add(end: Vector | None) -> None:
            status.value = book(on, motion, tableau, k, h, totals, anchor, on.same(part, 1), end)

        on.when(on.same(damped, 1), lambda: add(q), lambda: add(None))
        return status.value

    def corrected(
        on: Evaluator, motion: Mechanism, account: Table[RunAccount], start: Vector, y: Vector, q: Vector,
        allowed: Vector, h: Real, share: Real,
    ) -> Integer:  # fmt: skip
        status = motion.correct(on, account[0], h, start, y, q, allowed)
        account[0].size = worth(on, account[0], share)
        return status

    def advance(on: Evaluator, motion: Mechanism, base: Vector, v: Vector, q: Vector) -> None:
        motion.advance(on, base, v, q)

    def evaluations(
        on: Evaluator, motion: Mechanism, q: Matrix, r: Matrix, out: Vector, rates: Matrix, repeats: Integer
    ) -> None:
        totals = out.part(0, TOTALS)

        def each_row(k: Integer) -> None:
            motion.accelerate(on, q.row(k), r.row(k), rates.row(k), out, out, totals)

        on.loop(repeats, lambda _: on.loop(q.rows, each_row))

    functions = {
        "march": marched, "stages": stages, "rates": rates, "advance": advance, "velocities": velocities,
        "counted": counted, "summed": summed, "corrected": corrected, "measured": measure, "energy": stored_energies,
        "evaluations": evaluations,
    }  # fmt: skip
    if looped:
        functions |= {"close": close, "project": project}
    entries = {name: of_motion(function, looped=looped) for name, function in functions.items()}
    return Program("motion_of_loops" if looped else "motion_of_trees", **entries)


@cache
def stiff_program() -> Program:
    """Return the program of implicit steps of trees, many in one call."""

    def marched(
        on: Evaluator, motion: Mechanism, tableau: TableauRecord, memory: Memory, control: Table[MarchControl],
        account: Table[RunAccount], stiff: Stiff, steps: Integer,
    ) -> Integer:  # fmt: skip
        return march(on, motion, tableau, memory, control[0], account[0], steps, stiff)

    return Program("stiff_steps_of_trees", march=of_motion(marched, looped=False))


@cache
def lagged_program(*, looped: bool) -> Program:
    """Return the program of semi-implicit steps, many in one call, or stage by stage."""

    def marched(
        on: Evaluator, motion: Mechanism, tableau: TableauRecord, memory: Memory, control: Table[MarchControl],
        account: Table[RunAccount], drags: Drags, steps: Integer,
    ) -> Integer:  # fmt: skip
        return march(on, motion, tableau, memory, control[0], account[0], steps, lagged=drags)

    def staged(
        on: Evaluator,
        motion: Mechanism,
        tableau: TableauRecord,
        control: Table[MarchControl],
        base: Vector,
        start: Vector,
        k: Matrix,
        drags: Drags,
        y: Vector,
        q: Vector,
        i: Integer,
        h: Real,
    ) -> Integer:
        status, step = on.counter(0), MarchStep(motion, tableau, control[0], base, start, h, k, y, q)

        def first() -> None:
            status.value = begin(on, step, drags)

        def following() -> None:
            status.value = stage(on, step, drags, i)

        def later() -> None:
            on.when(i < tableau.a.columns, following, lambda: finish(on, step, drags))

        on.when(i > 0, later, first)
        return status.value

    return Program(
        "lagged_steps_of_loops" if looped else "lagged_steps_of_trees",
        march=of_motion(marched, looped=looped), stage=of_motion(staged, looped=looped),
    )  # fmt: skip


def motion_of_trees() -> Program:
    """Return the program without loops."""
    return motion_program(looped=False)


def motion_of_loops() -> Program:
    """Return the program with loops."""
    return motion_program(looped=True)


def lagged_steps_of_trees() -> Program:
    """Return the program of semi-implicit steps without loops."""
    return lagged_program(looped=False)
