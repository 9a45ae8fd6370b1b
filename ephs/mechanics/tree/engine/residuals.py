"""The program of mechanisms' dense equations: residual and momenta with exact derivatives, masses, rows of loops.

The residual at elements q = q⁰·exp(v), rates r, accelerations a and multipliers λ is M a + C r + g − forces − Jᵀλ, the
accelerations J a + J̇ r that the loops' rows forbid, the cut joints' rates and accelerations, and ṡ. The action is the
momenta p = ∂L/∂r, and ∂L/∂q with the forces that no potential has. Run with dual numbers both are their own exact
derivatives.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, Final, final

from ephs.mechanics.road import charts
from ephs.mechanics.road.charts import GroupKind
from ephs.mechanics.road.closures import Closures
from ephs.mechanics.road.cuts import Cut
from ephs.mechanics.road.inverse import action, armatures, masses, needed_forces, row_of_covector, weigh
from ephs.mechanics.road.pack import Class
from ephs.mechanics.road.programs import Sweeps
from ephs.mechanics.road.records import Tree
from ephs.mechanics.road.tree import outward, spread
from ephs.mechanics.tree.engine.forces import act
from ephs.mechanics.tree.sweeps.acting import TOTALS, Tables, Work
from ephs.mechanics.tree.sweeps.expanding import ABOUT, About
from ephs.semantics.linear.dense import cholesky, clear
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
    members,
    vector,
)

ACTIVE: Final = (
    "work", "relative", "value", "covector", "force", "pushed", "attached", "pulled", "temperature", "entropy",
    "located", "e", "f", "idle", "increment", "local", "off", "changed", "q", "r",
)  # fmt: skip
"""Arguments that have derivatives, beside those that only one of the functions has."""
MOVING: Final[dict[str, Any]] = {**members(Tables), **members(Work)}
"""Arguments that all functions have first."""
_BUNDLES: Final[tuple[tuple[dict[str, Any], Callable[..., Any]], ...]] = (
    (members(Tables), Tables), (members(Work), Work), (ABOUT, About)
)  # fmt: skip


@final
class Residuals:
    """The dense equations of a class of mechanisms as a program.

    Parameters
    ----------
    kind
        The class of their trees.
    kinds
        The kinds of joints.

    Attributes
    ----------
    kinds
        As given.
    made_of
        The arguments.
    width
        Numbers of memory that a link takes; the ground takes as many.
    program
        ``place``: motions. ``assemble``: the mass matrix, its Cholesky factor, rows of loops and the
        sizes of what is summed in them; 0, or 1 + a degree of freedom that moves no mass.
        ``rigid``: the forces that inertia and gravity need at ṙ = 0.
        ``twists``: (n, 6) of a link by the rates. ``residual`` and ``action``: see above.
    """

    def __init__(self, kind: Class, kinds: tuple[GroupKind, ...]) -> None:
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
        def outwards(on: Evaluator, tables: Tables, work: Work, q: Vector, r: Vector) -> tuple[Tree, Closures]:
            tree = sweeps.tree(tables.own[0].links, tables.integers, tables.reals, work.work, tables.gravity)
            outward(on, tree, q, r)
            joints = Table(Cut, tables.cut.cells, tables.cut_numbers.cells, tables.cut.size // Cut.integer_width)
            return tree, Closures(joints, work.places(tables), work.relative, tables.end, work.value, work.covector)

        def place(on: Evaluator, tables: Tables, work: Work, q: Vector, r: Vector) -> None:
            _, closing = outwards(on, tables, work, q, r)
            closing.place(on)

        def assemble(
            on: Evaluator, tables: Tables, work: Work, q: Vector, r: Vector, unit: Vector, mass: Matrix,
            factor: Matrix, jacobian: Matrix, sizes: Matrix, driven: Integer,
        ) -> Integer:  # fmt: skip
            tree, closing = outwards(on, tables, work, q, r)
            closing.place(on)
            masses(on, tree, unit, mass)

            def empty(a: Integer) -> None:
                clear(on, jacobian.row(driven + a))
                clear(on, sizes.row(driven + a))

            def each_row(joint: Cut, a: Integer, end: Integer) -> None:
                m = driven + a

                def count(at: Integer, size: Real) -> None:
                    sizes[m, at] = sizes[m, at] + size

                for link, e in ((joint.first, end), (joint.second, end + 1)):
                    row_of_covector(on, tree, link, self._seen, closing.at_end(e), jacobian.row(m), count)

            on.loop(jacobian.rows - driven, empty)
            closing.each_row(on, each_row)
            return cholesky(on, mass, factor)

        def rigid(on: Evaluator, tables: Tables, work: Work, q: Vector, r: Vector, out: Vector) -> None:
            tree, _ = outwards(on, tables, work, q, r)
            clear(on, out)
            needed_forces(on, tree, out)

        def twists(
            on: Evaluator, tables: Tables, work: Work, q: Vector, r: Vector, unit: Vector, link: Integer, rows: Matrix
        ) -> None:
            tree, _ = outwards(on, tables, work, q, r)
            clear(on, unit)

            def column(k: Integer) -> None:
                unit[k] = 1.0
                spread(on, tree, unit)
                unit[k] = 0.0
                for j, value in enumerate(tree.states[link].change):
                    rows[k, j] = value

            on.loop(unit.size, column)

        def residual(
            on: Evaluator, tables: Tables, work: Work, about: About, base: Vector, q: Vector, r: Vector, a: Vector,
            multiplier: Vector, out: Vector,
        ) -> None:  # fmt: skip
            n, m, c = r.size, work.value.rows, about.increment.size - r.size
            force, heat = out.part(0, n), out.part(n + m + 2 * c, work.entropy.size)
            charts.advance(on, self.kinds, tables.chart, base, about.increment, q)
            tree, closing = outwards(on, tables, work, q, r)
            spread(on, tree, a)
            closing.place(on)
            closing.along(on, out.part(n + m, c), out.part(n + m + c, c), n)
            _act(on, tree, tables, work, about, q, r, force, heat)
            closing.push(on, tree, multiplier)
            needed_forces(on, tree, force)
            armatures(on, tree, a, force)

            def accelerated(k: Integer) -> None:
                out[n + k] = -work.value[k, 0]

            on.loop(m, accelerated)

        def momenta(
            on: Evaluator, tables: Tables, work: Work, about: About, base: Vector, q: Vector, r: Vector, out: Vector
        ) -> None:
            n, c = r.size, about.increment.size - r.size
            force, heat = out.part(n, n), out.part(2 * n + 2 * c, work.entropy.size)
            charts.advance(on, self.kinds, tables.chart, base, about.increment, q)
            tree, closing = outwards(on, tables, work, q, r)
            closing.place(on)
            weigh(on, tree)
            closing.along(on, out.part(2 * n, c), out.part(2 * n + c, c), n)
            _act(on, tree, tables, work, about, q, r, force, heat)
            action(on, tree, r, out.part(0, n), force)

        def entry(function: Callable[..., Any], **arguments: Any) -> Entry:
            kinds = {**MOVING, **arguments}
            return Entry.bundled(function, kinds, *(one for one in _BUNDLES if kinds.keys() >= one[0].keys()))

        at: dict[str, Any] = {"q": vector(), "r": vector()}
        return {
            "place": entry(place, **at),
            "assemble": entry(
                assemble, **at, unit=vector(), mass=matrix(), factor=matrix(), jacobian=matrix(), sizes=matrix(),
                driven=integer(),
            ),
            "rigid": entry(rigid, **at, out=vector()),
            "twists": entry(twists, **at, unit=vector(), link=integer(), rows=matrix(6)),
            "residual": entry(residual, **ABOUT, base=vector(), **at, a=vector(), multiplier=vector(), out=vector()),
            "action": entry(momenta, **ABOUT, base=vector(), **at, out=vector()),
        }  # fmt: skip


def _act(
    on: Evaluator, tree: Tree, tables: Tables, work: Work, about: About, q: Vector, r: Vector, force: Vector,
    heat: Vector,
) -> None:  # fmt: skip
    """Take what acts off the links' loads and the forces on the rates, which are set; heat: ṡ."""
    _clear(on, work)
    totals, made = work.idle.part(0, TOTALS), work.idle.part(TOTALS, work.idle.size - TOTALS)
    act(on, tables, work, q, r, heat, made, totals, None, about)

    def take(j: Integer) -> None:
        force[j] = -work.force[j]

    def load(i: Integer) -> None:
        state = tree.states[i]
        state.load = [x - work.pushed[i, k] for k, x in enumerate(state.load)]

    on.loop(force.size, take)
    on.loop(tree.size, load)


def _clear(on: Evaluator, work: Work) -> None:
    clear(on, work.force)
    clear(on, Vector(work.pushed.cells, work.pushed.start, work.pushed.rows * 6))


@cache
def residuals(kind: Class, kinds: tuple[GroupKind, ...]) -> Residuals:
    """The program of a class, made once."""
    return Residuals(kind, kinds)


@cache
def point_program() -> Program:
    """The program that evaluates what acts at a point, where links are placed, and keeps it there: all mechanisms'."""

    def evaluate(
        on: Evaluator, tables: Tables, work: Work, about: About, q: Vector, r: Vector, made: Vector, totals: Vector
    ) -> Integer:
        _clear(on, work)
        clear(on, made)
        return act(on, tables, work, q, r, work.idle.part(0, work.entropy.size), made, totals, about, None)

    totals = vector(TOTALS)
    kinds: dict[str, Any] = {**MOVING, **ABOUT, "q": vector(), "r": vector(), "made": vector(), "totals": totals}
    return Program("point", about=Entry.bundled(evaluate, kinds, *_BUNDLES))
