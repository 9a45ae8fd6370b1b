"""The program that reads a mechanism's state: coordinates, rates, poses of bodies, energy."""

from functools import cache
from typing import Annotated

from ephs.mechanics.tree.engine.heats import entropies
from ephs.mechanics.tree.engine.states import Ends, Source, StorageRow, Walked, energies, rows
from ephs.mechanics.tree.sweeps.acting import Tables, Work
from ephs.semantics.linear.dense import copy
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Program,
    Table,
    Vector,
)


def _row(x: Vector) -> Matrix:
    return Matrix(x.cells, x.start, 1, x.size)


def _read(
    on: Evaluator, tables: Tables, work: Work, bodies: Table[Walked], springs: Table[Ends], plan: Table[Source],
    poses: Annotated[Matrix, 7], twists: Annotated[Matrix, 6], storages: Table[StorageRow], reads: Integers,
    parameters: Vector, turning: Integers, momentum: Vector, s: Matrix, x: Matrix, stored: Matrix, q: Vector, y: Vector,
    out: Vector,
) -> Integer:  # fmt: skip
    """Write (q, r, poses of bodies, energy in J) at a state to ``out``; return a status."""
    increments, freedoms, nodes = tables.drive.size, work.force.size, tables.node.size
    r = y.part(increments, freedoms)
    status = on.counter(0)
    status.value = entropies(on, tables, work, y.part(increments + freedoms, nodes))
    copy(on, work.entropy.part(0, nodes), s.row(0))

    def turn(k: Integer) -> None:
        s[0, nodes + k] = r[turning[k]] * momentum[k]

    on.loop(turning.size, turn)
    rows(on, bodies, springs, plan, _row(q), _row(r), s, poses, twists, x)

    def store() -> None:
        status.value = energies(
            on, storages, reads, parameters, tables.scal, x, work.x, work.v, work.e, work.lam, work.f, work.c, work.jac,
            work.scratch, stored, work.fault,
        )  # fmt: skip

    on.when(on.same(status.value, 0), store)
    copy(on, q, out.part(0, q.size))
    copy(on, r, out.part(q.size, freedoms))
    first = q.size + freedoms

    def pose(i: Integer) -> None:
        copy(on, poses.row(i), out.part(first + 7 * i, 7))

    on.loop(bodies.size, pose)
    total = on.variable(0.0)

    def add(k: Integer) -> None:
        total.value = total.value + stored[0, k]

    on.loop(stored.columns, add)
    out[first + 7 * bodies.size] = total.value
    return status.value


@cache
def outputs_program() -> Program:
    """Return the program."""
    return Program("outputs", read=Entry(_read))
