"""The program of mechanisms' dense equations: residual and momenta with exact derivatives, masses, rows of loops.

The residual at elements q = q⁰·exp(v), rates r, accelerations a and multipliers λ is M a + C r + g − forces − Jᵀλ, the
accelerations J a + J̇ r that the loops' rows forbid, the cut joints' rates and accelerations, and ṡ. The action is the
momenta p = ∂L/∂r, and ∂L/∂q with the forces that no potential has. Run with dual numbers both are their own exact
derivatives.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, Final, NamedTuple, final

from ephs.mechanics.tree.sweeps import charts
from ephs.mechanics.tree.sweeps.acting import Acting, Body, Conduction
from ephs.mechanics.tree.sweeps.charts import Chart, Kind
from ephs.mechanics.tree.sweeps.closures import Closures
from ephs.mechanics.tree.sweeps.cuts import Cut, Relative
from ephs.mechanics.tree.sweeps.edges import Edges, Law
from ephs.mechanics.tree.sweeps.inverse import action, armatures, masses, needed_forces, row_of_covector, weigh
from ephs.mechanics.tree.sweeps.loops import NO_REALS
from ephs.mechanics.tree.sweeps.outward import outward
from ephs.mechanics.tree.sweeps.pack import Class
from ephs.mechanics.tree.sweeps.programs import MECHANISM, PLACE, Sweeps
from ephs.mechanics.tree.sweeps.records import Tree
from ephs.mechanics.tree.sweeps.spreading import spread
from ephs.semantics.linear.dense import cholesky
from ephs.semantics.spaces.se3 import wrench_outward
from ephs.semantics.spaces.vectors import sub
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Program,
    Real,
    Table,
    Vector,
    indices,
    integer,
    matrix,
    table,
    vector,
)

__all__ = ["ACTIVE", "Residuals", "residuals"]

LOOPS: Final[dict[str, Any]] = {
    "cut": indices(), "cut_numbers": vector(), "chart": indices(), "places": matrix(PLACE),
    "motions": matrix(Relative.real_width), "end": indices(), "value": matrix(4), "covector": matrix(6),
}  # fmt: skip
"""The cut joints of a mechanism, charts of all joints, and memory: see `Closures`."""
LAWS: Final[dict[str, Any]] = {"edge": table(Acting), "code": indices(), "law": vector()}
"""Springs, friction and given forces: see `Edges`."""
BESIDE: Final[dict[str, Any]] = {
    "body": table(Body), "warming": matrix(3), "passage": table(Conduction), "flow": matrix(8),
    "tie": indices(), "tied": matrix(),
}  # fmt: skip
POINT: Final[dict[str, Any]] = {
    "base": vector(), "v": vector(), "q": vector(), "r": vector(), "s": vector(), "drive": vector(),
    "wrench": matrix(6), "warmth": vector(), "beyond": vector(), "pulls": vector(),
}  # fmt: skip
ACTIVE: Final = (
    "memory", "places", "motions", "value", "covector", "v", "q", "r", "s", "drive", "wrench", "warmth", "beyond",
    "pulls",
)  # fmt: skip
"""Arguments that have derivatives, beside those that only one of the functions has."""


class _Beside(NamedTuple):
    """What acts beside laws of edges; ties are flows of what is attached."""

    body: Table[Body]  # on which wrenches are given
    warming: Matrix  # (entropies, 3): temperature over the environment's, its derivative, the entropy there
    passage: Table[Conduction]
    flow: Matrix  # (conductions, 8): what these lose, its derivatives by their temperatures, and the temperatures
    tie: Integers  # (ties, 2): a rate, a temperature, nothing that changes, a state, an increment; its place
    tied: Matrix  # (ties, 2 + ties): the flow about a point, what it depends on there, its derivatives


class _Point(NamedTuple):
    """Point of evaluation: q is written."""

    base: Vector
    v: Vector  # increments from the base
    q: Vector
    r: Vector
    s: Vector
    drive: Vector  # given forces on the degrees of freedom of all joints
    wrench: Matrix  # (bodies, 6): given
    warmth: Vector  # (entropies,): memory
    beyond: Vector  # (ties,): memory, by how much what they depend on is off the point
    pulls: Vector  # memory: forces on the degrees of freedom of all joints


@final
class Residuals:
    """The dense equations of a class of mechanisms as a program.

    Parameters
    ----------
    kind
        The class of their trees.
    kinds
        The kinds of joints and springs.

    Attributes
    ----------
    kinds
        As given.
    made_of
        The arguments.
    width
        Numbers of memory that a link takes; the ground takes as many.
    program
        ``place``: motions, and points of laws. ``assemble``: the mass matrix, its Cholesky factor, rows of loops; 0, or
        1 + a degree of freedom that moves no mass. ``rigid``: the forces that inertia and gravity need at ṙ = 0.
        ``twists``: (n, 6) of a link by the rates. ``residual`` and ``action``: see above.
    """

    def __init__(self, kind: Class, kinds: tuple[Kind, ...]) -> None:
        self.kinds, self.made_of = kinds, (kind, kinds)
        self._seen = [k for k in range(6) if not kind.planar or k not in (0, 1, 5)]
        self._sweeps = Sweeps(kind, others=self._entries)
        self._tangents: dict[tuple[str, int], Program] = {}
        self.width, self.program = self._sweeps.width, self._sweeps.program

    def tangent(self, name: str, directions: int) -> Program:
        """``residual`` or ``action`` with exact derivatives along so many directions: active arguments are pairs."""
        if (name, directions) not in self._tangents:
            entry = self.program.entries[name]
            active = [key for key in (*ACTIVE, "a", "out") if key in entry.kinds]
            made = Program("tangents", **{name: entry.tangent(*active, directions=directions)})
            self._tangents[name, directions] = made
        return self._tangents[name, directions]

    def _entries(self, sweeps: Sweeps) -> dict[str, Entry]:
        kinds = self.kinds

        def closures(
            cut: Integers, numbers: Vector, chart: Integers, places: Matrix, motions: Matrix, end: Integers,
            value: Matrix, covector: Matrix,
        ) -> Closures:  # fmt: skip
            joints = Table(Cut, cut.cells, numbers.cells, cut.size // Cut.integer_width)
            charts = Table(Chart, chart.cells, NO_REALS, chart.size // Chart.integer_width)
            return Closures(joints, charts, places, motions, end, value, covector)

        def edges(edge: Table[Acting], code: Integers, law: Vector) -> Callable[[Matrix], Edges]:
            laws = Table(Law, edge.integers, law.cells, edge.size)
            return lambda places: Edges(charts.of_joints(kinds), edge, code, laws, places)

        def place(
            on: Evaluator, tree: Tree, closing: Closures, edges: Callable[[Matrix], Edges], q: Vector, r: Vector
        ) -> None:
            outward(on, tree, q, r)
            _at_rest(on, tree)
            closing.place(on, tree)
            edges(closing.places).meet(on, q, r)

        def assemble(
            on: Evaluator, tree: Tree, closing: Closures, q: Vector, r: Vector, unit: Vector, mass: Matrix,
            factor: Matrix, row: Matrix, terms: Vector, driven: Integer,
        ) -> Integer:  # fmt: skip
            outward(on, tree, q, r)
            _at_rest(on, tree)
            closing.place(on, tree)
            masses(on, tree, q, unit, mass)
            found = cholesky(on, mass, factor)

            def empty(a: Integer) -> None:
                into = row.row(driven + a)
                on.loop(unit.size, lambda k: _put(into, k))
                terms[driven + a] = 0.0

            def one(joint: Cut, a: Integer, end: Integer) -> None:
                into, m = row.row(driven + a), driven + a

                def count(at: Integer, size: Real) -> None:
                    terms[m] = terms[m] + size / factor[at, at]

                for link, e in ((joint.first, end), (joint.second, end + 1)):
                    row_of_covector(on, tree, q, link, self._seen, closing.at_end(e), into, count)

            on.loop(terms.size - driven, empty)
            closing.each_row(on, one)
            return found

        def rigid(on: Evaluator, tree: Tree, q: Vector, r: Vector, out: Vector) -> None:
            outward(on, tree, q, r)
            _at_rest(on, tree)
            on.loop(out.size, lambda k: _put(out, k))
            needed_forces(on, tree, q, out)

        def twists(on: Evaluator, tree: Tree, q: Vector, r: Vector, unit: Vector, link: Integer, rows: Matrix) -> None:
            outward(on, tree, q, r)
            on.loop(unit.size, lambda k: _put(unit, k))

            def column(k: Integer) -> None:
                unit[k] = 1.0
                spread(on, tree, q, unit)
                unit[k] = 0.0
                for j, value in enumerate(tree.states[link].change):
                    rows[k, j] = value

            on.loop(unit.size, column)

        def residual(
            on: Evaluator, tree: Tree, closing: Closures, edges: Callable[[Matrix], Edges], beside: _Beside,
            at: _Point, a: Vector, multiplier: Vector, out: Vector,
        ) -> None:  # fmt: skip
            n, m, c = at.r.size, closing.value.rows, at.v.size - at.r.size
            force, heat = out.part(0, n), out.part(n + m + 2 * c, at.s.size)
            charts.advance(on, kinds, closing.charts, at.base, at.v, at.q)
            outward(on, tree, at.q, at.r)
            spread(on, tree, at.q, a)
            closing.place(on, tree)
            rates = out.part(n + m, c)
            closing.along(on, rates, out.part(n + m + c, c), n)
            _act(on, tree, edges(closing.places), beside, at, force, heat, rates)
            closing.push(on, tree, multiplier)
            needed_forces(on, tree, at.q, force)
            armatures(on, tree, a, force)

            def accelerated(k: Integer) -> None:
                out[n + k] = -closing.value[k, 0]

            on.loop(m, accelerated)

        def momenta(
            on: Evaluator, tree: Tree, closing: Closures, edges: Callable[[Matrix], Edges], beside: _Beside,
            at: _Point, out: Vector,
        ) -> None:  # fmt: skip
            n = at.r.size
            c = at.v.size - n
            momentum, force, heat = out.part(0, n), out.part(n, n), out.part(2 * n + 2 * c, at.s.size)
            charts.advance(on, kinds, closing.charts, at.base, at.v, at.q)
            outward(on, tree, at.q, at.r)
            _at_rest(on, tree)
            closing.place(on, tree)
            weigh(on, tree)
            rates = out.part(2 * n, c)
            closing.along(on, rates, out.part(2 * n + c, c), n)
            _act(on, tree, edges(closing.places), beside, at, force, heat, rates)
            action(on, tree, at.q, at.r, momentum, force)

        bundles = ((LOOPS, closures), (LAWS, edges), (BESIDE, _Beside), (POINT, _Point))

        def entry(function: Callable[..., Any], **arguments: Any) -> Entry:
            made = [(names, make) for names, make in bundles if arguments.keys() >= names.keys()]
            return sweeps.entry(function, {**MECHANISM, **arguments}, *made)

        at: dict[str, Any] = {"q": vector(), "r": vector()}
        whole: dict[str, Any] = {**LOOPS, **LAWS, **BESIDE, **POINT}
        return {
            "place": entry(place, **LOOPS, **LAWS, **at),
            "assemble": entry(
                assemble, **LOOPS, **at, unit=vector(), mass=matrix(), factor=matrix(), row=matrix(), terms=vector(),
                driven=integer(),
            ),
            "rigid": entry(rigid, **at, out=vector()),
            "twists": entry(twists, **at, unit=vector(), link=integer(), rows=matrix(6)),
            "residual": entry(residual, **whole, a=vector(), multiplier=vector(), out=vector()),
            "action": entry(momenta, **whole, out=vector()),
        }  # fmt: skip


def _act(
    on: Evaluator, tree: Tree, acting: Edges, beside: _Beside, at: _Point, force: Vector, heat: Vector, cut: Vector
) -> None:
    """Take what acts off the links' loads and the forces on the rates, which are set; heat: ṡ; cut: rates."""
    on.loop(force.size, lambda k: _put(force, k))
    on.loop(heat.size, lambda k: _put(heat, k))
    warming, warmth, flow = beside.warming, at.warmth, beside.flow

    def warm(k: Integer) -> None:
        warmth[k] = warming[k, 0] + warming[k, 1] * (at.s[k] - warming[k, 2])

    def push(b: Integer) -> None:
        body = beside.body[b]

        def put() -> None:
            state = tree.states[body.link]
            state.load = sub(state.load, wrench_outward(body.turn, body.at, [at.wrench[b, k] for k in range(6)]))

        on.when(body.link >= 0, put)

    def pass_on(k: Integer) -> None:
        ends = [beside.passage[k].one, beside.passage[k].two]
        warmer = [warmth[end] - flow[k, 6 + i] for i, end in enumerate(ends)]
        for i, end in enumerate(ends):
            lost = flow[k, i] + (flow[k, 2 + 2 * i] * warmer[0] + flow[k, 3 + 2 * i] * warmer[1])
            heat[end] = heat[end] - lost

    on.loop(warmth.size, warm)
    on.loop(beside.body.size, push)
    _attach(on, beside, at, cut, heat)
    acting.act(on, tree, at.q, at.r, warmth, at.pulls, force, heat)
    on.loop(flow.rows, pass_on)


def _attach(on: Evaluator, beside: _Beside, at: _Point, cut: Vector, heat: Vector) -> None:
    """Write the forces of what drives and of what is attached to ``pulls``, and add to heat what it takes up; cut:
    rates.
    """
    tie, tied, beyond, pulls, r, drive = beside.tie, beside.tied, at.beyond, at.pulls, at.r, at.drive

    def start(j: Integer) -> None:
        pulls[j] = drive[j]

    def visit(k: Integer, *branches: Callable[[Integer], None]) -> None:
        def among(kind: int) -> None:
            if kind < len(branches):
                on.when(on.same(tie[2 * k], kind), lambda: branches[kind](tie[2 * k + 1]), lambda: among(kind + 1))

        among(0)

    def enter(k: Integer) -> None:
        def off(value: Real) -> None:
            beyond[k] = value - tied[k, 1]

        def rate(j: Integer) -> None:
            on.when(j < r.size, lambda: off(r[j]), lambda: off(cut[j - r.size]))

        def still(_: Integer) -> None:
            beyond[k] = 0.0

        visit(k, rate, lambda j: off(at.warmth[j]), still, lambda j: off(at.s[j]), lambda j: off(at.v[j]))

    def leave(k: Integer) -> None:
        flow = on.variable(tied[k, 0])

        def add(i: Integer) -> None:
            flow.value = flow.value + tied[k, 2 + i] * beyond[i]

        on.loop(beyond.size, add)

        def pull(j: Integer) -> None:
            pulls[j] = pulls[j] - flow.value

        def take(j: Integer) -> None:
            heat[j] = heat[j] - flow.value

        visit(k, pull, take, lambda _: None, take)

    on.loop(drive.size, start)
    on.loop(beyond.size, enter)
    on.loop(beyond.size, leave)


def _put(row: Vector, k: Integer) -> None:
    row[k] = 0.0


def _at_rest(on: Evaluator, tree: Tree) -> None:
    """No accelerations beyond the biases."""

    def still(i: Integer) -> None:
        tree.states[i].change = [0.0] * 6

    on.loop(tree.size, still)


@cache
def residuals(kind: Class, kinds: tuple[Kind, ...]) -> Residuals:
    """The program of a class, made once."""
    return Residuals(kind, kinds)
