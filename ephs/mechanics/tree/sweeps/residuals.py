"""The program of mechanisms' dense equations: residual and momenta with exact derivatives, masses, rows of loops.

The residual at elements q = q⁰·exp(v), rates r, accelerations a and multipliers λ is M a + C r + g − forces − Jᵀλ, the
accelerations J a + J̇ r that the loops' rows forbid, the cut joints' rates and accelerations, and ṡ. The action is the
momenta p = ∂L/∂r, and ∂L/∂q with the forces that no potential has. Run with dual numbers both are their own exact
derivatives.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, Final, final

from ephs.mechanics.tree.sweeps import charts
from ephs.mechanics.tree.sweeps.charts import Chart, Kind
from ephs.mechanics.tree.sweeps.closures import Closures
from ephs.mechanics.tree.sweeps.cuts import Cut, Relative
from ephs.mechanics.tree.sweeps.edges import Edge, Edges, Law
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
    vector,
)

__all__ = ["ACTIVE", "Residuals", "residuals"]

LOOPS: Final[dict[str, Any]] = {
    "cut": indices(), "cut_numbers": vector(), "chart": indices(), "places": matrix(PLACE),
    "motions": matrix(Relative.real_width), "end": indices(), "value": matrix(4), "covector": matrix(6),
}  # fmt: skip
"""The cut joints of a mechanism, charts of all joints, and memory: see `Closures`."""
ACTING: Final[dict[str, Any]] = {
    "edge": indices(), "edge_numbers": vector(), "law": vector(), "body": indices(), "body_frame": matrix(12),
    "warming": matrix(3), "passage": indices(), "flow": matrix(8), "tie": indices(), "tied": matrix(),
}  # fmt: skip
"""Forces: see `Edges`; links and frames of bodies, on which wrenches are given; of each entropy the temperature over
the environment's, its derivative, and the entropy there; of conductions two entropies each, what these lose, its
derivatives by their temperatures, and the temperatures; of what is attached see `_attach`."""
POINT: Final[dict[str, Any]] = {
    "base": vector(), "v": vector(), "q": vector(), "r": vector(), "s": vector(), "drive": vector(),
    "wrench": matrix(6), "warmth": vector(), "beyond": vector(), "pulls": vector(),
}  # fmt: skip
"""Point of evaluation: q is written; forces on all joints, wrenches on bodies; memory (entropies,), (ties,),
(joints' degrees of freedom,)."""
ACTIVE: Final = (
    "memory", "places", "motions", "value", "covector", "v", "q", "r", "s", "drive", "wrench", "warmth", "beyond",
    "pulls",
)  # fmt: skip
"""Arguments that have derivatives, beside those that only one of the functions has."""


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
            return Closures(kinds, joints, charts, places, motions, end, value, covector)

        def edges(edge: Integers, numbers: Vector, law: Vector, places: Matrix) -> Edges:
            count = edge.size // Edge.integer_width
            laws = Table(Law, edge.cells, law.cells, count)
            return Edges(charts.of_joints(kinds), Table(Edge, edge.cells, numbers.cells, count), laws, places)

        def place(
            on: Evaluator, size: Integer, integers: Integers, reals: Vector, memory: Vector, gravity: Vector,
            cut: Integers, cut_numbers: Vector, chart: Integers, places: Matrix, motions: Matrix, end: Integers,
            value: Matrix, covector: Matrix, edge: Integers, edge_numbers: Vector, law: Vector, q: Vector, r: Vector,
        ) -> None:  # fmt: skip
            tree = sweeps.tree(size, integers, reals, memory, gravity)
            outward(on, tree, q, r)
            _at_rest(on, tree)
            closures(cut, cut_numbers, chart, places, motions, end, value, covector).place(on, tree)
            edges(edge, edge_numbers, law, places).meet(on, q, r)

        def assemble(
            on: Evaluator, size: Integer, integers: Integers, reals: Vector, memory: Vector, gravity: Vector,
            cut: Integers, cut_numbers: Vector, chart: Integers, places: Matrix, motions: Matrix, end: Integers,
            value: Matrix, covector: Matrix, q: Vector, r: Vector, unit: Vector, mass: Matrix, factor: Matrix,
            row: Matrix, terms: Vector, driven: Integer,
        ) -> Integer:  # fmt: skip
            tree = sweeps.tree(size, integers, reals, memory, gravity)
            outward(on, tree, q, r)
            _at_rest(on, tree)
            closing = closures(cut, cut_numbers, chart, places, motions, end, value, covector)
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

        def rigid(
            on: Evaluator, size: Integer, integers: Integers, reals: Vector, memory: Vector, gravity: Vector, q: Vector,
            r: Vector, out: Vector,
        ) -> None:  # fmt: skip
            tree = sweeps.tree(size, integers, reals, memory, gravity)
            outward(on, tree, q, r)
            _at_rest(on, tree)
            on.loop(out.size, lambda k: _put(out, k))
            needed_forces(on, tree, q, out)

        def twists(
            on: Evaluator, size: Integer, integers: Integers, reals: Vector, memory: Vector, gravity: Vector, q: Vector,
            r: Vector, unit: Vector, link: Integer, rows: Matrix,
        ) -> None:  # fmt: skip
            tree = sweeps.tree(size, integers, reals, memory, gravity)
            outward(on, tree, q, r)
            on.loop(unit.size, lambda k: _put(unit, k))

            def column(k: Integer) -> None:
                unit[k] = 1.0
                spread(on, tree, q, unit)
                unit[k] = 0.0
                for j, value in enumerate(tree.states[link].change):
                    rows[k, j] = value

            on.loop(unit.size, column)

        def acted(
            on: Evaluator, tree: Tree, closing: Closures, acting: Edges, body: Integers, body_frame: Matrix,
            warming: Matrix, passage: Integers, flow: Matrix, tie: Integers, tied: Matrix, q: Vector, r: Vector,
            v: Vector, s: Vector, drive: Vector, wrench: Matrix, warmth: Vector, beyond: Vector, pulls: Vector,
            force: Vector, heat: Vector, cut: Vector,
        ) -> None:  # fmt: skip
            """Take what acts off the links' loads and the forces on the rates, which are set; heat: ṡ; cut: rates."""
            on.loop(force.size, lambda k: _put(force, k))
            on.loop(heat.size, lambda k: _put(heat, k))

            def warm(k: Integer) -> None:
                warmth[k] = warming[k, 0] + warming[k, 1] * (s[k] - warming[k, 2])

            def push(b: Integer) -> None:
                link = body[b]
                turn = [[body_frame[b, 3 * i + j] for j in range(3)] for i in range(3)]
                at = [body_frame[b, 9 + k] for k in range(3)]

                def put() -> None:
                    state = tree.states[link]
                    state.load = sub(state.load, wrench_outward(turn, at, [wrench[b, k] for k in range(6)]))

                on.when(link >= 0, put)

            def pass_on(k: Integer) -> None:
                ends = [passage[2 * k], passage[2 * k + 1]]
                warmer = [warmth[end] - flow[k, 6 + i] for i, end in enumerate(ends)]
                for i, end in enumerate(ends):
                    lost = flow[k, i] + (flow[k, 2 + 2 * i] * warmer[0] + flow[k, 3 + 2 * i] * warmer[1])
                    heat[end] = heat[end] - lost

            on.loop(warmth.size, warm)
            on.loop(body.size, push)
            _attach(on, tie, tied, (v, r, cut, s, warmth, drive), beyond, pulls, heat)
            acting.act(on, tree, q, r, warmth, pulls, force, heat)
            on.loop(flow.rows, pass_on)

        def residual(
            on: Evaluator, size: Integer, integers: Integers, reals: Vector, memory: Vector, gravity: Vector,
            cut: Integers, cut_numbers: Vector, chart: Integers, places: Matrix, motions: Matrix, end: Integers,
            value: Matrix, covector: Matrix, edge: Integers, edge_numbers: Vector, law: Vector, body: Integers,
            body_frame: Matrix, warming: Matrix, passage: Integers, flow: Matrix, tie: Integers, tied: Matrix,
            base: Vector, v: Vector, q: Vector, r: Vector, s: Vector, drive: Vector, wrench: Matrix, warmth: Vector,
            beyond: Vector, pulls: Vector, a: Vector, multiplier: Vector, out: Vector,
        ) -> None:  # fmt: skip
            tree = sweeps.tree(size, integers, reals, memory, gravity)
            closing = closures(cut, cut_numbers, chart, places, motions, end, value, covector)
            n, m, c = r.size, value.rows, v.size - r.size
            force, heat = out.part(0, n), out.part(n + m + 2 * c, s.size)
            charts.advance(on, kinds, closing.charts, base, v, q)
            outward(on, tree, q, r)
            spread(on, tree, q, a)
            closing.place(on, tree)
            rates = out.part(n + m, c)
            closing.along(on, rates, out.part(n + m + c, c), n)
            acted(
                on, tree, closing, edges(edge, edge_numbers, law, places), body, body_frame, warming, passage, flow,
                tie, tied, q, r, v, s, drive, wrench, warmth, beyond, pulls, force, heat, rates,
            )  # fmt: skip
            closing.push(on, tree, multiplier)
            needed_forces(on, tree, q, force)
            armatures(on, tree, a, force)

            def accelerated(k: Integer) -> None:
                out[n + k] = -value[k, 0]

            on.loop(m, accelerated)

        def momenta(
            on: Evaluator, size: Integer, integers: Integers, reals: Vector, memory: Vector, gravity: Vector,
            cut: Integers, cut_numbers: Vector, chart: Integers, places: Matrix, motions: Matrix, end: Integers,
            value: Matrix, covector: Matrix, edge: Integers, edge_numbers: Vector, law: Vector, body: Integers,
            body_frame: Matrix, warming: Matrix, passage: Integers, flow: Matrix, tie: Integers, tied: Matrix,
            base: Vector, v: Vector, q: Vector, r: Vector, s: Vector, drive: Vector, wrench: Matrix, warmth: Vector,
            beyond: Vector, pulls: Vector, out: Vector,
        ) -> None:  # fmt: skip
            tree = sweeps.tree(size, integers, reals, memory, gravity)
            closing = closures(cut, cut_numbers, chart, places, motions, end, value, covector)
            n = r.size
            c = v.size - n
            momentum, force, heat = out.part(0, n), out.part(n, n), out.part(2 * n + 2 * c, s.size)
            charts.advance(on, kinds, closing.charts, base, v, q)
            outward(on, tree, q, r)
            _at_rest(on, tree)
            closing.place(on, tree)
            weigh(on, tree)
            rates = out.part(2 * n, c)
            closing.along(on, rates, out.part(2 * n + c, c), n)
            acted(
                on, tree, closing, edges(edge, edge_numbers, law, places), body, body_frame, warming, passage, flow,
                tie, tied, q, r, v, s, drive, wrench, warmth, beyond, pulls, force, heat, rates,
            )  # fmt: skip
            action(on, tree, q, r, momentum, force)

        at: dict[str, Any] = {"q": vector(), "r": vector()}
        whole: dict[str, Any] = {**MECHANISM, **LOOPS, **ACTING, **POINT}
        return {
            "place": Entry(place, **MECHANISM, **LOOPS, **dict(list(ACTING.items())[:3]), **at),
            "assemble": Entry(
                assemble, **MECHANISM, **LOOPS, **at, unit=vector(), mass=matrix(), factor=matrix(), row=matrix(),
                terms=vector(), driven=integer(),
            ),
            "rigid": Entry(rigid, **MECHANISM, **at, out=vector()),
            "twists": Entry(twists, **MECHANISM, **at, unit=vector(), link=integer(), rows=matrix(6)),
            "residual": Entry(residual, **whole, a=vector(), multiplier=vector(), out=vector()),
            "action": Entry(momenta, **whole, out=vector()),
        }  # fmt: skip


def _attach(
    on: Evaluator, tie: Integers, tied: Matrix, point: tuple[Vector, ...], beyond: Vector, pulls: Vector, heat: Vector
) -> None:
    """Write the forces of what drives and of what is attached to ``pulls``, and add to heat what it takes up.

    Parameters
    ----------
    tie
        (ties, 2): what each depends on, a rate, a temperature, nothing that changes, a state, an increment; its place.
    tied
        (ties, 2 + ties): the flow about a point, what it depended on there, its derivatives.
    point
        Increments from the point, rates of the tree and of cut joints, states, temperatures, forces that are given.
    beyond
        Memory: by how much what they depend on is off the point.
    """
    v, r, cut, s, warmth, drive = point

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

        visit(k, rate, lambda j: off(warmth[j]), still, lambda j: off(s[j]), lambda j: off(v[j]))

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
