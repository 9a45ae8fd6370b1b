"""Looped programs of the sweeps, specialised for a class of mechanisms."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from hashlib import sha256
from typing import Any, Final, final

from ephs.mechanics.road import rows as closing
from ephs.mechanics.road.linear import (
    Force,
    accelerate_outward,
    accelerations,
    driven_power,
    inward,
    load_inward,
    no_force,
)
from ephs.mechanics.road.needs import NO_INTEGERS, Compact, FieldLayout, LaidOut, Survey, layout_of
from ephs.mechanics.road.pack import SLIDE, TURN, Class
from ephs.mechanics.road.records import LinkConstants, LinkPlace, LinkState, LinkStates, Tree
from ephs.mechanics.road.rigid import SUMS, rigid
from ephs.mechanics.road.rows import LoopRows
from ephs.mechanics.road.tree import axes, energy, outward, spread
from ephs.semantics.spaces.rank import SPARSE
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Program,
    Vector,
    indices,
    integer,
    matrix,
    vector,
)
from ephs.semantics.stage.known import known
from ephs.semantics.stage.memory import IntegerCells, RealCells


@final
@dataclass(frozen=True, slots=True, eq=False)
class _KnownLinks:
    """Constants of links, of which those that a kind of joints has in common are known."""

    constants: tuple[FieldLayout, ...]
    integers: IntegerCells
    reals: RealCells

    def of(self, i: Integer, kind: int | None) -> LinkConstants:
        start = i * LinkConstants.real_width
        cells = self.reals if kind is None else LaidOut(self.constants[kind], self.reals, start)
        return LinkConstants(self.integers, i * LinkConstants.integer_width, cells, start if kind is None else 0)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _SurveyedMemory:
    """Memory of a survey: all rows are one."""

    cells: RealCells

    def __getitem__(self, i: Integer) -> LinkState:
        return LinkState(NO_INTEGERS, 0, self.cells, 0)


MECHANISM: Final[dict[str, Any]] = {
    "size": integer(), "integers": indices(), "reals": vector(), "memory": vector(), "gravity": vector(3),
}  # fmt: skip
"""A mechanism, as all entry functions take it: how many links, their integers and numbers, memory, gravity."""
ROWS: Final[dict[str, Any]] = {
    "at": indices(), "slot": indices(), "row": indices(), "flat": indices(), "value": matrix(4), "entry": vector(),
    "covector": matrix(6), "along": matrix(12),
}  # fmt: skip
"""The rows of its loops: see `ephs.mechanics.road.rows.LoopRows`."""
ARGUMENTS: Final[dict[str, dict[str, Any]]] = {
    "accelerations": {**MECHANISM, "q": vector(), "r": vector(), "force": vector(), "rate": vector()},
    "move": {**MECHANISM, "q": vector(), "r": vector(), "lead": vector()},
    "fold": {**MECHANISM, **ROWS, "force": vector(), "wrench": matrix(6)},
    "unfold": {**MECHANISM, **ROWS, "rate": vector()},
    "resolve": {**MECHANISM, **ROWS, "rate": vector()},
    "spread": {**MECHANISM, "x": vector()},
    "axes": {**MECHANISM, "columns": matrix(6)},
    "power": {**MECHANISM, **ROWS, "r": vector(), "force": vector(), "out": vector()},
    "dependent": {**ROWS, "largest": vector()},
    "energy": {**MECHANISM, "q": vector(), "r": vector(), "momenta": matrix(6), "spin": vector(), "out": vector(3)},
    "rigid": {
        **MECHANISM,
        "q": vector(),
        "r": vector(),
        "island": indices(),
        "bases": vector(),
        "target": vector(),
        "sums": matrix(SUMS),
        "found": vector(),
        "torque": vector(),
    },
}
"""Arguments of the entry functions; `accelerations`, `fold` and `dependent` return an integer."""


@final
class Sweeps:
    """The sweeps of a class of mechanisms as a program.

    Parameters
    ----------
    kind
        The class.
    general
        Loops, wrenches on links and prescribed motions are there; else a tree under forces on its rates.
    others
        Entry functions in place of those, made with these sweeps' `tree`.

    Attributes
    ----------
    made_of
        The arguments.
    width
        Numbers of memory that a link takes; the ground takes as many. If ``general``, each row begins with `LinkPlace`.
    program
        Entry functions for mechanisms with loops, wrenches on links or prescribed motions, or for trees on which
        nothing but gravity and forces on the rates act.
    """

    def __init__(
        self, kind: Class, *, general: bool = True, others: "Callable[[Sweeps], dict[str, Entry]] | None" = None
    ) -> None:
        self._class, self.made_of = kind, (kind, general, others)
        self._zeros = (0, 1, 5) if kind.planar else ()
        self._constants = tuple(
            FieldLayout(known, {k: k for k in range(LinkConstants.real_width) if k not in known})
            for known in (kind.constants(number) for number in range(len(kind.joints)))
        )
        self._states: LinkStates | None = None
        entries = others(self) if others is not None else self._general() if general else self._free()
        self._layout: FieldLayout | None = None
        shared = LinkPlace.real_width if general else 0
        constants, columns = known(
            ("layout", self), lambda: layout_of(LinkState.real_width, partial(self._survey, entries), shared).pairs
        )
        self._layout = FieldLayout(dict(constants), dict(columns))
        self.width = self._layout.width
        self.program = Program(_name(kind, general=general), **entries)

    def _survey(self, entries: dict[str, Entry], survey: Survey) -> None:
        self._states = _SurveyedMemory(survey.memory())
        for entry in entries.values():
            survey.returned(entry.function(survey, *(survey.argument(kind) for kind in entry.kinds.values())))
        self._states = None

    def tree(self, size: Integer, integers: Integers, reals: Vector, memory: Vector, gravity: Vector) -> Tree:
        """The tree of links that tables describe, with ``width`` numbers of memory for each link and the ground."""
        states, pull = self._states, [gravity[k] for k in range(3)]
        if states is None:
            assert self._layout is not None
            states = Compact(LinkState, self._layout, memory)
        return Tree(
            self._class.joints, size, _KnownLinks(self._constants, integers.cells, reals.cells), states, pull,
            self._class.planar,
        )  # fmt: skip

    def _rows(
        self, at: Integers, slot: Integers, row: Integers, flat: Integers, value: Matrix, entry: Vector,
        covector: Matrix, along: Matrix,
    ) -> LoopRows:  # fmt: skip
        whole = Vector(covector.cells, covector.start, covector.rows * 6)
        return LoopRows(at, slot, row, flat, value, entry, whole, along, self._zeros)

    def entry(
        self, function: Callable[..., Any], kinds: Mapping[str, Any], *made: tuple[Iterable[str], Callable[..., Any]]
    ) -> Entry:
        """An entry function that takes the tree, the rows of its loops, and what else is made, of their arguments."""
        known = ((MECHANISM, self.tree), (ROWS, self._rows))
        return Entry.bundled(function, kinds, *(one for one in known if kinds.keys() >= one[0].keys()), *made)

    # ---- trees on which nothing but gravity and forces on the rates act ------------------------------------------

    def _free(self) -> dict[str, Entry]:
        def accelerate(on: Evaluator, tree: Tree, q: Vector, r: Vector, force: Vector, rate: Vector) -> Integer:
            return accelerations(on, tree, q, r, rate, _given_force(force))

        def evaluations(on: Evaluator, tree: Tree, q: Matrix, r: Matrix, rates: Matrix, repeats: Integer) -> None:
            def each_row(k: Integer) -> None:
                accelerations(on, tree, q.row(k), r.row(k), rates.row(k))

            on.loop(repeats, lambda _: on.loop(q.rows, each_row))

        repeated = {"q": matrix(), "r": matrix(), "rates": matrix(), "repeats": integer()}
        return {
            "accelerations": self.entry(accelerate, ARGUMENTS["accelerations"]),
            "evaluations": self.entry(evaluations, {**MECHANISM, **repeated}),
            **self._kept(),
        }

    def _kept(self) -> dict[str, Entry]:
        """Quantities that corrections of a step read and move."""
        along = [k for k in range(6) if k not in self._zeros]

        def moved(
            on: Evaluator, tree: Tree, q: Vector, r: Vector, island: Integers, bases: Vector, target: Vector,
            sums: Matrix, found: Vector, torque: Vector,
        ) -> None:  # fmt: skip
            rigid(on, tree, q, r, island, bases, target, sums, found, torque, along)

        return {"energy": self.entry(energy, ARGUMENTS["energy"]), "rigid": self.entry(moved, ARGUMENTS["rigid"])}

    # ---- mechanisms with loops, wrenches on links, prescribed motions --------------------------------------------

    def _general(self) -> dict[str, Entry]:
        def fold(on: Evaluator, tree: Tree, rows: LoopRows, force: Vector, wrench: Matrix) -> Integer:
            fault = on.counter(0)

            def each_link(i: Integer) -> None:
                state = tree.states[i]
                state.load = [x - wrench[i, k] for k, x in enumerate(state.load)]
                closing.eliminate(on, rows, i, state)
                closing.eliminate_load(on, rows, i, state)
                inward(on, tree, i, fault)
                load_inward(on, tree, _given_force(force), i)
                closing.carry(on, tree, rows, i)
                closing.carry_load(on, tree, rows, i)

            tree.each(on, each_link, down=True)
            closing.eliminate(on, rows, tree.size, None)
            closing.eliminate_load(on, rows, tree.size, None)
            return fault.value

        def outwards(on: Evaluator, tree: Tree, rows: LoopRows, rate: Vector) -> None:
            closing.multipliers(on, rows, tree.size, None)

            def each_link(i: Integer) -> None:
                closing.push(on, tree, rows, i)
                accelerate_outward(on, tree, rate, i)
                closing.multipliers(on, rows, i, tree.states[i])

            tree.each(on, each_link)

        def resolve(on: Evaluator, tree: Tree, rows: LoopRows, rate: Vector) -> None:
            def unloaded(i: Integer) -> None:
                tree.states[i].load = [0.0] * 6

            def each_link(i: Integer) -> None:
                closing.eliminate_load(on, rows, i, tree.states[i])
                load_inward(on, tree, no_force, i)
                closing.carry_load(on, tree, rows, i)

            on.loop(tree.size, unloaded)
            tree.each(on, each_link, down=True)
            closing.eliminate_load(on, rows, tree.size, None)
            outwards(on, tree, rows, rate)

        def power(on: Evaluator, tree: Tree, rows: LoopRows, r: Vector, force: Vector, out: Vector) -> None:
            out[0] = driven_power(on, tree, rows, r, force)

        def dependent(on: Evaluator, rows: LoopRows, largest: Vector) -> Integer:
            return on.select(closing.dependent(on, rows, largest, SPARSE), 1, 0)

        functions: dict[str, Callable[..., Any]] = {
            "move": outward, "fold": fold, "unfold": outwards, "resolve": resolve, "spread": spread, "axes": axes,
            "power": power, "dependent": dependent,
        }  # fmt: skip
        entries = {name: self.entry(function, ARGUMENTS[name]) for name, function in functions.items()}
        return entries | self._kept()


def _given_force(force: Vector) -> Force:
    """The forces on the rates that a vector holds."""
    return lambda i, joint, link: [force[link.r_at + j] for j in range(joint.dim)]


@cache
def sweeps(kind: Class, *, general: bool = False) -> Sweeps:
    """The program of a class, made once; it lives as long as the process, since tables keep its addresses."""
    return Sweeps(kind, general=general)


def _name(kind: Class, *, general: bool) -> str:
    """Name of a class: object code of several may be linked together."""
    known = {TURN: "turn", SLIDE: "slide"}
    joints = [known.get(joint) or sha256(repr(joint).encode()).hexdigest()[:8] for joint in kind.joints]
    return "_".join(["sweeps", "planar" if kind.planar else "spatial", *joints, "loops" if general else "trees"])


def common_sweeps() -> tuple[Program, ...]:
    """Return the programs of the most common classes: mechanisms in a plane, whose joints turn or slide."""
    turning, sliding = Class((TURN,), True), Class((SLIDE, TURN), True)
    wanted = [(turning, False), (turning, True), (sliding, True)]
    return tuple(sweeps(kind, general=general).program for kind, general in wanted)
