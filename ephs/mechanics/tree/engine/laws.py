"""The laws of a mechanism's components about a point: pulls, heat and their derivatives, by the components' kernels.

Kernels are called by their addresses with the arguments of `ephs.semantics.kernel_table`. They give derivatives by a
step, at a step of length zero: half of those by the place.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Final, final

from ephs.mechanics.tree.sweeps.acting import Acting, Component, Conduction, Node
from ephs.mechanics.tree.sweeps.edges import Law
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Program,
    Real,
    Table,
    Variable,
    Vector,
    matrix,
    table,
    vector,
)
from ephs.semantics.stage.calling import Call

__all__ = ["BUFFERS", "laws_call"]

BUFFERS: Final = {"x": 16, "v": 64, "e": 64, "lam": 64, "f": 256, "c": 16, "jac": 1024, "work": 4096}
"""Memory of a call: states, increments, efforts, multipliers, flows, constraints, derivatives, scratch."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Components:
    """The components of a mechanism by number, and the memory of a call; ``fault`` is status + 64 · component."""

    table: Table[Component]
    parameters: Vector
    scal: Vector
    x: Vector
    v: Vector
    e: Vector
    lam: Vector
    f: Vector
    c: Vector
    jac: Vector
    work: Vector
    fault: Variable[Integer]

    def call(self, on: Evaluator, number: Integer) -> None:
        """Evaluate a component at the states x and efforts e."""
        row = self.table[number]
        dims = Integers(row.integers, row.integer_start + Component.dims.offset, 4)
        parameters = self.parameters.part(row.at, self.parameters.size - row.at)
        status = on.reach(
            row.law, dims, self.scal, parameters, self.x, self.v, self.e, self.lam, self.f, self.c, self.jac, self.work
        )
        first = on.both(on.same(self.fault.value, 0), on.negate(on.same(status, 0)))
        self.fault.value = on.select(first, status + 64 * number, self.fault.value)


def _put(vector: Vector, k: Integer, value: Real) -> None:
    vector[k] = value


def _spring(on: Evaluator, parts: _Components, edge: Acting, row: Vector) -> None:
    dim = edge.dim
    parts.call(on, edge.spring)

    def one(j: Integer) -> None:
        row[Law.pull.offset + j] = -parts.e[j]
        on.loop(dim, lambda k: _put(row, Law.stiffness.offset + (6 * j + k), 2.0 * parts.f[dim * j + k]))

    on.loop(dim, one)


def _friction(
    on: Evaluator, parts: _Components, edge: Acting, row: Vector, warmth: Real, made: Vector, heat: Vector
) -> None:
    dim, number = edge.dim, edge.friction
    component = parts.table[number]
    reads = Integers(component.integers, component.integer_start + Component.dims.offset, 4)[2]
    width, jac = dim + 1 + reads, parts.jac
    on.loop(dim, lambda j: _put(parts.e, j, row[Law.rate.offset + j]))
    parts.e[dim] = warmth
    parts.call(on, number)
    by_place = on.same(reads, dim)

    def one(j: Integer) -> None:
        pull = Law.pull.offset + j
        row[pull] = row[pull] - parts.f[j]
        heat[0] = heat[0] + parts.f[j] * row[Law.rate.offset + j]
        row[Law.softness.offset + j] = jac[width * j + dim]
        row[Law.made_by_rate.offset + j] = -jac[width * dim + j]
        last = width * dim + (dim + 1 + j)
        on.when(by_place, lambda: _put(row, Law.made_by_place.offset + j, -2.0 * jac[last]))

        def among(k: Integer) -> None:
            row[Law.damping.offset + (6 * j + k)] = jac[width * j + k]
            at = Law.stiffness.offset + (6 * j + k)
            on.when(by_place, lambda: _put(row, at, row[at] + 2.0 * jac[width * j + (dim + 1 + k)]))

        on.loop(dim, among)

    on.loop(dim, one)
    row[Law.warmth.offset], row[Law.made.offset] = warmth, -parts.f[dim]
    row[Law.made_by_warmth.offset] = -jac[width * dim + dim]
    made[component.made] = -parts.f[dim]


def _laws(
    on: Evaluator, edge: Table[Acting], law: Vector, node: Table[Node], passage: Table[Conduction],
    component: Table[Component], parameters: Vector, scal: Vector, s: Vector, warming: Matrix, flow: Matrix,
    made: Vector, heat: Vector, x: Vector, v: Vector, e: Vector, lam: Vector, f: Vector, c: Vector, jac: Vector,
    work: Vector,
) -> Integer:  # fmt: skip
    fault = on.counter(0)
    parts = _Components(component, parameters, scal, x, v, e, lam, f, c, jac, work, fault)

    def warm(k: Integer) -> None:
        warming[k, 0], warming[k, 1], warming[k, 2] = 0.0, 0.0, s[k]

        def stored() -> None:
            x[0] = s[k]
            parts.call(on, node[k].component)
            warming[k, 0], warming[k, 1] = e[0], 2.0 * f[0]

        on.when(node[k].component >= 0, stored)

    def act(i: Integer) -> None:
        one, row = edge[i], law.part(i * Law.real_width, Law.real_width)
        on.loop(one.size, lambda k: _put(x, k, row[Law.place.offset + k]))

        def clear(j: Integer) -> None:
            row[Law.pull.offset + j] = 0.0
            on.loop(6, lambda k: _put(row, Law.stiffness.offset + (6 * j + k), 0.0))

        on.loop(6, clear)
        on.when(one.spring >= 0, lambda: _spring(on, parts, one, row))
        on.when(one.friction >= 0, lambda: _friction(on, parts, one, row, warming[one.heat, 0], made, heat))

    def pass_on(k: Integer) -> None:
        here = passage[k]
        number, one, other = here.component, here.one, here.two
        e[0], e[1] = warming[one, 0], warming[other, 0]
        parts.call(on, number)
        for j in range(2):
            flow[k, j] = f[j]
        for j in range(4):
            flow[k, 2 + j] = jac[j]
        flow[k, 6], flow[k, 7] = warming[one, 0], warming[other, 0]
        made[component[number].made] = f[0]

    heat[0] = 0.0
    on.loop(made.size, lambda k: _put(made, k, 0.0))
    on.loop(node.size, warm)
    on.loop(edge.size, act)
    on.loop(flow.rows, pass_on)
    return fault.value


@cache
def laws_call() -> Call:
    """The function in machine code; it returns 0, or a component's status and 64 times its number.

    Edges stand where `ephs.mechanics.tree.sweeps.edges.Edges.meet` put them.
    """
    kinds: dict[str, Any] = {
        "edge": table(Acting), "law": vector(), "node": table(Node), "passage": table(Conduction),
        "component": table(Component), "parameters": vector(), "scal": vector(3), "s": vector(), "warming": matrix(3),
        "flow": matrix(8), "made": vector(), "heat": vector(1),
    }  # fmt: skip
    entry = Entry(_laws, **kinds, **{name: vector(size) for name, size in BUFFERS.items()})
    return Program("laws", laws=entry).compiled()["laws"]
