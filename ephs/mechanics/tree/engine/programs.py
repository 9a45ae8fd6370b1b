"""Programs of all mechanisms' equations of motion, with loops or without."""

from functools import cache

from ephs.mechanics.tree.engine.balance import held, measure
from ephs.mechanics.tree.engine.motion import Mechanism
from ephs.mechanics.tree.engine.shutting import close
from ephs.mechanics.tree.sweeps.acting import TABLES, WORK, Tables, Work
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Matrix,
    Program,
    Real,
    Table,
    Vector,
    group,
    integer,
    matrix,
    real,
    table,
    vector,
)
from ephs.semantics.stage.kinds import Kind
from ephs.solve.march import (
    ERRORS,
    MEMORY,
    STIFF,
    TABLEAU,
    TOTALS,
    Account,
    Control,
    Errors,
    Memory,
    Stiff,
    Tableau,
    Totals,
    march,
)
from ephs.solve.march.account import worth
from ephs.solve.march.steps import attempt, book

__all__ = ["motion_of_loops", "motion_of_trees", "motion_program", "stiff_program"]


@cache
def _of() -> dict[str, Kind]:
    """Return the kinds of a mechanism's arguments, which all entry functions have first."""
    return {"tables": group(Tables, **TABLES), "work": group(Work, **WORK)}


@cache
def motion_program(*, looped: bool) -> Program:
    """Return the program: what is the same for all mechanisms; what is not it calls by addresses in their tables."""

    def moving(tables: Tables, work: Work) -> Mechanism:
        return Mechanism(tables, work, looped)

    def marched(
        on: Evaluator, tables: Tables, work: Work, tableau: Tableau, memory: Memory, control: Table[Control],
        account: Table[Account], steps: Integer,
    ) -> Integer:  # fmt: skip
        return march(on, moving(tables, work), tableau, memory, control[0], account[0], steps)

    def stages(
        on: Evaluator, tables: Tables, work: Work, tableau: Tableau, control: Table[Control], base: Vector,
        start: Vector, k: Matrix, errors: Errors, last: Vector, y: Vector, q: Vector, h: Real,
    ) -> Integer:  # fmt: skip
        return attempt(on, moving(tables, work), tableau, control[0], base, start, h, k, errors, last, y, q)

    def rates(on: Evaluator, tables: Tables, work: Work, base: Vector, y: Vector, q: Vector, out: Vector) -> Integer:
        return moving(tables, work).rates(on, base, y, q, out)[0]

    def closed(on: Evaluator, tables: Tables, work: Work, q: Vector, r: Vector) -> Integer:
        return close(on, moving(tables, work), q, r)

    def project(on: Evaluator, tables: Tables, work: Work, q: Vector, change: Vector) -> None:
        moving(tables, work).project(on, q, change)

    def velocities(on: Evaluator, tables: Tables, work: Work, y: Vector, r: Vector, out: Vector) -> None:
        moving(tables, work).velocities(on, y, r, out)

    def counted(on: Evaluator, tables: Tables, work: Work, before: Vector, after: Vector) -> None:
        moving(tables, work).count(on, before, after)

    def summed(
        on: Evaluator, tables: Tables, work: Work, tableau: Tableau, k: Matrix, totals: Totals, h: Real, anchor: Real,
        part: Integer,
    ) -> Integer:  # fmt: skip
        return book(on, moving(tables, work), tableau, k, h, totals, anchor, on.same(part, 1))

    def corrected(
        on: Evaluator, tables: Tables, work: Work, account: Table[Account], start: Vector, y: Vector, q: Vector,
        allowed: Vector, h: Real,
    ) -> Integer:  # fmt: skip
        status = moving(tables, work).correct(on, account[0], h, start, y, q, allowed)
        account[0].size = worth(on, account[0])
        return status

    def measured(on: Evaluator, tables: Tables, work: Work, q: Vector, r: Vector) -> None:
        measure(on, moving(tables, work), q, r)

    def energy(on: Evaluator, tables: Tables, work: Work, q: Vector, r: Vector, heats: Vector, out: Vector) -> Integer:
        return held(on, moving(tables, work), q, r, heats, out)

    def advance(on: Evaluator, tables: Tables, work: Work, base: Vector, v: Vector, q: Vector) -> None:
        moving(tables, work).advance(on, base, v, q)

    def evaluations(
        on: Evaluator, tables: Tables, work: Work, q: Matrix, r: Matrix, out: Vector, rates: Matrix, repeats: Integer
    ) -> None:
        motion, totals = moving(tables, work), out.part(0, 2)

        def one(k: Integer) -> None:
            motion.accelerate(on, q.row(k), r.row(k), rates.row(k), out, out, totals)

        on.loop(repeats, lambda _: on.loop(q.rows, one))

    of, tried = _of(), {"tableau": group(Tableau, **TABLEAU)}
    entries = {
        "march": Entry(
            marched, **of, **tried, memory=group(Memory, **MEMORY), control=table(Control), account=table(Account),
            steps=integer(),
        ),
        "stages": Entry(
            stages, **of, **tried, control=table(Control), base=vector(), start=vector(), k=matrix(),
            errors=group(Errors, **ERRORS), last=vector(),
            y=vector(), q=vector(), h=real(),
        ),
        "rates": Entry(rates, **of, base=vector(), y=vector(), q=vector(), out=vector()),
        "advance": Entry(advance, **of, base=vector(), v=vector(), q=vector()),
        "velocities": Entry(velocities, **of, y=vector(), r=vector(), out=vector()),
        "counted": Entry(counted, **of, before=vector(), after=vector()),
        "summed": Entry(
            summed, **of, tableau=tried["tableau"], k=matrix(), totals=group(Totals, **TOTALS), h=real(), anchor=real(),
            part=integer(),
        ),
        "corrected": Entry(
            corrected, **of, account=table(Account), start=vector(), y=vector(), q=vector(), allowed=vector(), h=real()
        ),
        "measured": Entry(measured, **of, q=vector(), r=vector()),
        "energy": Entry(energy, **of, q=vector(), r=vector(), heats=vector(), out=vector(3)),
        "evaluations": Entry(
            evaluations, **of, q=matrix(), r=matrix(), out=vector(), rates=matrix(), repeats=integer()
        ),
    }  # fmt: skip
    if looped:
        entries["close"] = Entry(closed, **of, q=vector(), r=vector())
        entries["project"] = Entry(project, **of, q=vector(), change=vector())
    return Program("motion_of_loops" if looped else "motion_of_trees", **entries)


@cache
def stiff_program() -> Program:
    """Return the program of implicit steps of trees, many in one call."""

    def marched(
        on: Evaluator, tables: Tables, work: Work, tableau: Tableau, memory: Memory, control: Table[Control],
        account: Table[Account], stiff: Stiff, steps: Integer,
    ) -> Integer:  # fmt: skip
        return march(on, Mechanism(tables, work, False), tableau, memory, control[0], account[0], steps, stiff)

    return Program(
        "stiff_steps_of_trees",
        march=Entry(
            marched, **_of(), tableau=group(Tableau, **TABLEAU), memory=group(Memory, **MEMORY), control=table(Control),
            account=table(Account), stiff=group(Stiff, **STIFF), steps=integer(),
        ),
    )  # fmt: skip


def motion_of_trees() -> Program:
    """Return the program without loops."""
    return motion_program(looped=False)


def motion_of_loops() -> Program:
    """Return the program with loops."""
    return motion_program(looped=True)
