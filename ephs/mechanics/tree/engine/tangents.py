"""Explicit steps of a mechanism with exact derivatives along several directions: the steps over dual numbers.

A program over dual numbers calls the tangents of the sweeps and components that the program itself calls. What the
step does (stages, totals, loops closed at its end) is stated where marches take it from.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property, partial
from typing import Any, Final, cast, final

import numpy as np

from ephs.mechanics.tree.engine.attachment import laws_in
from ephs.mechanics.tree.engine.engine import Engine
from ephs.mechanics.tree.engine.heats import StageRates
from ephs.mechanics.tree.engine.motion import Mechanism
from ephs.mechanics.tree.engine.programs import of_motion
from ephs.mechanics.tree.engine.shutting import close
from ephs.mechanics.tree.engine.tables import copied
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.stage import (
    Evaluator,
    Integer,
    Matrix,
    Program,
    Real,
    Record,
    Table,
    Vector,
)
from ephs.solve.equations.heats import PLAIN
from ephs.solve.march.account import RunAccount
from ephs.solve.march.evaluating import MarchStep
from ephs.solve.march.records import MarchControl, TableauRecord
from ephs.solve.march.steps import attempt

BEYOND: Final = 1e100
"""Errors that are allowed of a step where its length is given."""
DIRECTIONS: Final = 4
"""Directions of one call: vector units take four."""


@cache
def step_program(*, looped: bool) -> Program:
    """Return the program of one step of a given length, and of its parts."""

    def step(
        on: Evaluator,
        motion: Mechanism,
        tableau: TableauRecord,
        control: Table[MarchControl],
        base: Vector,
        start: Vector,
        k: Matrix,
        last: Vector,
        account: Table[RunAccount],
        allowed: Vector,
        y: Vector,
        q: Vector,
        h: Real,
    ) -> Integer:
        status = on.counter(motion.rates(on, base, start, q, k.row(0))[0])

        def stages() -> None:
            taken = MarchStep(motion, tableau, control[0], base, start, h, k, y, q)
            status.value = attempt(on, taken, None, last)

        def end() -> None:
            status.value = settle_step(on, motion, tableau, account, allowed, base, start, k, y, q, h)

        on.when(on.same(status.value, 0), stages)
        on.when(on.same(status.value, 0), end)
        return status.value

    def rates(on: Evaluator, motion: Mechanism, base: Vector, start: Vector, q: Vector, k: Vector) -> Integer:
        return motion.rates(on, base, start, q, k)[0]

    def settle_step(
        on: Evaluator, motion: Mechanism, tableau: TableauRecord, account: Table[RunAccount], allowed: Vector,
        base: Vector, start: Vector, k: Matrix, y: Vector, q: Vector, h: Real,
    ) -> Integer:  # fmt: skip
        motion.count(on, start, y, StageRates(tableau, k, h, motion.summed))
        return _settled(on, motion, account[0], allowed, base, start, y, q, h)

    functions = {"step": step, "rates": rates, "settle": settle_step, "close": _closed}
    entries = {name: of_motion(function, looped=looped) for name, function in functions.items()}
    return Program("steps_of_loops" if looped else "steps_of_trees", **entries)


def _settled(
    on: Evaluator, motion: Mechanism, account: RunAccount, allowed: Vector, base: Vector, start: Vector, y: Vector,
    q: Vector, h: Real,
) -> Integer:  # fmt: skip
    """Take the end y of a step to a state whose derivatives are on the constraints, and keep the balance, too.

    The account's anchor is made anew, of the start, unless it is not a number.
    """
    status = on.counter(motion.settle(on, base, y, q))

    def close() -> None:
        status.value = _closed(on, motion, y, q)

    def anchored() -> None:
        motion.open(on, account, base, start)

    def correct() -> None:
        status.value = motion.correct(on, account, h, start, y, q, allowed, always=True)

    on.when(on.absolute(account.anchor) < 1e300, anchored)
    on.when(on.same(status.value, 0), close)
    on.when(on.same(status.value, 0), correct)
    return status.value


def _closed(on: Evaluator, motion: Mechanism, y: Vector, q: Vector) -> Integer:
    """Close loops that are closed to rounding once more: what closing does to the derivatives, whatever the gap."""
    if not motion.closes:
        return 0
    r = y.part(motion.increments, motion.freedoms)
    status = on.counter(motion.newton(on, q, r, 1e300, always=True)[0])

    def again() -> None:
        status.value = close(on, motion, q, r)

    on.when(on.same(status.value, 0), again)
    return status.value


@final
class StepTangent:
    """Steps of one mechanism, and their derivatives along `DIRECTIONS` directions.

    Parameters
    ----------
    engine
        Its equations, whose tables are read where they are.
    relation
        Called with the number of a component, and with ``derivatives=True`` where the program is to write these;
        returns the program and the entry that it is in machine code.
    tableau
        Coefficients, by the names of `TableauRecord`.
    corrected
        Whether steps keep the balance of energy: not so where nothing is free to move.

    Attributes
    ----------
    slopes
        Of the real numbers of each table, (…, directions), by its name: set before steps.
    given, arguments
        What the programs take, by name: pairs of numbers and slopes; with tables that call the engine's programs, and
        their tangents, which the first step compiles.
    pairs, stage
        States, rates and memory among them; rates at (base, start).
    """

    def __init__(
        self, engine: Engine, relation: Callable[..., tuple[Program, str]], tableau: Mapping[str, Any], *,
        corrected: bool,
    ) -> None:  # fmt: skip
        coordinates, size = engine.sizes
        stages = tableau["a"].shape[0]
        self.slopes: dict[str, Array] = {}
        self._tangents = partial(reaching, engine, relation, lambda program: program.tangent(DIRECTIONS))
        self._looped = engine.looped
        self.given: dict[str, Any] = {
            "tables": paired(engine.tables, self.slopes),
            "work": paired(engine.work),
            "tableau": paired(tableau),
        }
        arguments = self.given
        shapes: dict[str, tuple[int, ...]] = {
            "base": (coordinates,), "start": (size,), "k": (stages, size), "last": (size,), "y": (size,),
            "q": (coordinates,),
        }  # fmt: skip
        self.pairs = {name: _pair(np.zeros(shape)) for name, shape in shapes.items()}
        self.stage = _pair(np.zeros(size))
        account = RunAccount.table(1)
        account[0].anchor = 0.0 if corrected else np.nan
        arguments.update({"control": _paired(MarchControl.table(1), {}, ""), "account": _paired(account, {}, "")})
        counted = 2 * engine.work["force"].size + engine.work["entropy"].size
        arguments.update({"allowed": _pair(np.full(counted, BEYOND)), "h": 0.0, **self.pairs})
        self._bound: dict[str, Any] = {}

    @cached_property
    def arguments(self) -> dict[str, Any]:
        slopes = {name: self.slopes[name] for name in ("own", "component", "net") if name in self.slopes}
        reached = {name: (value, slopes[name]) if name in slopes else value for name, value in self._tangents().items()}
        return {**self.given, "tables": {**self.given["tables"], **reached}}

    def _run(self, name: str, *numbers: float) -> int:
        """Call an entry function of the tangents, bound when it is first asked for; return its status."""
        if name not in self._bound:
            given = {**self.arguments, **({"k": self.stage} if name == "rates" else {})}
            kinds = step_program(looped=self._looped).entries[name].kinds
            self._bound[name] = step_tangents(self._looped).compiled()[name].bind(*(given[key] for key in kinds))
        return int(self._bound[name](*numbers))

    def step(self, h: float) -> int:
        """Take a step of h seconds from (base, start) to (q, y); return a status. Inputs are constant in it."""
        return self._run("step", h)

    def close(self) -> int:
        """Put the derivatives of the state (q, y), whose loops are closed, on the constraints; return a status."""
        return self._run("close")

    def rates(self) -> int:
        """Write the rates at (base, start) to ``stage``; return a status."""
        return self._run("rates")

    def settle(self, h: float) -> int:
        """Take the end y of a step of h seconds from (base, start) to a state; return a status."""
        return self._run("settle", h)


@cache
def step_tangents(looped: bool) -> Program:
    """Return the same over dual numbers."""
    program = step_program(looped=looped)
    return Program(
        f"{program.name}_along_{DIRECTIONS}",
        **{
            name: entry.tangent(*(key for key in entry.kinds if key != "h"), directions=DIRECTIONS)
            for name, entry in program.entries.items()
        },
    )


def paired(values: Mapping[str, Any], kept: dict[str, Array] | None = None) -> dict[str, Any]:
    """Return arguments with memory for their slopes, which may be kept by their names."""
    slopes = {} if kept is None else kept
    return {name: _paired(value, slopes, name) for name, value in values.items()}


def _pair(array: Array) -> tuple[Array, Array]:
    return array, np.zeros((*array.shape, DIRECTIONS))


def _paired(value: Any, kept: dict[str, Array], name: str) -> Any:
    """Return an argument with memory for its slopes, which is kept by its name; integers as they are."""
    if isinstance(value, Table):
        rows = cast("Table[Record]", value)
        kept[name] = np.zeros((rows.arrays[1].size, DIRECTIONS))
        return rows, kept[name]
    if value.dtype != np.float64:
        return value
    kept[name] = np.zeros((*value.shape, DIRECTIONS))
    return value, kept[name]


def reaching(
    engine: Engine, relation: Callable[..., tuple[Program, str]], variant: Callable[[Program], Program]
) -> dict[str, Any]:
    """Return the tables that hold addresses, with those of a variant of each program: of its tangents, or taped."""

    def address(program: Program, entry: str) -> int:
        return variant(program).compiled()[entry].address

    own, component = copied(engine.tables["own"]), copied(engine.tables["component"])
    for name, (program, entry) in engine.reached.items():
        setattr(own[0], name, address(program, entry))
    for number in evaluated(engine.tables):
        component[number].law = address(*relation(number))
    net = engine.tables["net"].copy()
    for place, number in laws_in(net):  # a network's balances are solved by derivatives
        net[place] = address(*relation(number, derivatives=True))
    return {"own": own, "component": component, "net": net}


def evaluated(tables: Mapping[str, Any]) -> Sequence[int]:
    """Return the numbers of the components that equations with these tables evaluate."""
    acting, node, conduction = tables["acting"], tables["node"], tables["conduction"]
    found = {int(row.component) for rows in (node, conduction) for row in _rows(rows)}
    found |= {int(number) for row in _rows(acting) for number in (row.spring, row.several, row.friction)}
    return sorted(found - {-1, PLAIN})


def _rows(rows: Table[Any]) -> list[Any]:
    return [rows[i] for i in range(int(rows.size))]  # pyright: ignore[reportArgumentType]
