"""Equations of motion of one mechanism in machine code."""

from collections.abc import Mapping
from typing import Any, cast, final

import numpy as np

from ephs.mechanics.road.elimination import ClosingProgram
from ephs.mechanics.tree.engine.drags import resisting
from ephs.mechanics.tree.engine.programs import lagged_program, motion_program, stiff_program
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.stage import Program, Record, Table, members
from ephs.semantics.stage.calling import Bound
from ephs.solve.march.account import WORTH, RunAccount
from ephs.solve.march.memory import Totals
from ephs.solve.march.records import MarchControl


@final
class Engine:
    """One mechanism's equations of motion in machine code. It keeps memory: use one for each thread.

    Parameters
    ----------
    tables, work
        Arrays by the names of `Tables` and `Work`.
    closing
        The elimination of its loops.
    sizes
        Numbers of elements, and of y.
    reached
        Function of `Own` -> the program and the entry that it is.

    Attributes
    ----------
    looped
        Whether loops are closed.
    """

    def __init__(
        self, tables: Mapping[str, Any], work: Mapping[str, Any], closing: ClosingProgram, sizes: tuple[int, int],
        reached: Mapping[str, tuple[Program, str]], *, looped: bool,
    ) -> None:  # fmt: skip
        self.tables, self.work, self.closing, self.looped = tables, work, closing, looped
        self.sizes, self.reached = sizes, reached
        coordinates, size = sizes
        self._calls = motion_program(looped=looped).compiled()
        self._first = self._calls["rates"].first(tables, work)
        self._base, self._q = np.zeros(coordinates), np.zeros(coordinates)
        self._start, self._y, self._out = np.zeros(size), np.zeros(size), np.zeros(size)
        self._r, self._change = np.zeros(work["force"].size), np.zeros(work["force"].size)
        summed = size - self._r.size - work["still"].size
        self._held, self._heats = np.zeros(3), np.zeros(work["entropy"].size)
        self.totals = {name: np.zeros(summed) for name in members(Totals)} | {"start": self._start, "end": self._y}
        self.totals |= {name: np.zeros(2 * summed) for name in ("whole", "low")}
        self._counted = 2 * self._r.size + work["entropy"].size
        self._account, self._allowed = RunAccount.table(1), np.zeros(self._counted)
        self._stages: dict[int, tuple[dict[str, Array], Table[MarchControl], Array, Array, Bound]] = {}
        self._sums: dict[int, tuple[Mapping[str, Any], Array, Bound]] = {}
        self._arguments: dict[str, tuple[Any, ...]] = {
            "rates": (self._base, self._y, self._q, self._out),
            "advance": (self._base, self._y, self._q),
            "velocities": (self._y, self._r, self._out),
            "counted": (self._start, self._y),
            "energy": (self._q, self._r, self._heats, self._held),
            "measured": (self._q, self._r),
            "corrected": (self._account, self._start, self._y, self._q, self._allowed, 0.0, 0.0),
            "close": (self._q, self._r),
            "project": (self._q, self._change),
        }
        self._bound: dict[str, Bound] = {}

    def _run(self, name: str, *numbers: float) -> int:
        """Call an entry function on the engine's own arrays, bound when it is first asked for; return its status."""
        bound = self._bound.get(name)
        if bound is None:
            bound = self._bound[name] = self.bind(name, *self._arguments[name])
        return bound(*numbers)

    def bind(self, name: str, *arguments: Any) -> Bound:
        """Return an entry function of the program, bound to this mechanism and to further arguments."""
        return self._calls[name].bind(*arguments, first=self._first)

    def implicit(self, *arguments: Any) -> Bound:
        """Return implicit steps, bound to this tree and to further arguments."""
        return stiff_program().compiled()["march"].bind(*arguments, first=self._first)

    def lagged(self, name: str, onsager: Mapping[int, int], *arguments: Any) -> Bound:
        """Return semi-implicit steps, ``march``, or one stage of them, ``stage``, bound to this mechanism and more.

        ``onsager``: addresses of the programs of M/θ₀ of the components of friction, by their numbers.
        """
        call = lagged_program(looped=self.looped).compiled()[name]
        return call.bind(*arguments, first=call.first(resisting(self.tables, onsager), self.work))

    def array(self, name: str) -> Array:
        """Return an array of the memory."""
        return self.work[name]

    @property
    def failed(self) -> int:
        """Number of the component or degree of freedom at which an evaluation failed last."""
        return int(self.work["fault"][0])

    def arrays(self) -> list[Array]:
        """Return all arrays of the tables."""
        out: list[Any] = []
        for value in self.tables.values():
            out += cast("Table[Record]", value).arrays if isinstance(value, Table) else [value]
        return [*out, *(np.asarray(value) for value in self.closing)]

    def advance(self, base: Array, v: Array) -> Array:
        """Return base·exp(v), joint by joint; v may stand at the head of y."""
        self._base[:], self._y[: v.size] = base, v
        self._run("advance")
        return self._q.copy()

    def rates(self, base: Array, y: Array) -> tuple[int, Array, Array]:
        """Return a status, the elements base·exp(v), and ẏ of y = (v, r, heats, totals, flows)."""
        self._base[:], self._y[:] = base, y
        status = self._run("rates")
        return status, self._q.copy(), self._out.copy()

    def stages(
        self, tableau: Mapping[str, Any], base: Array, start: Array, h: float, k: Array, y: Array
    ) -> tuple[int, int, Array]:
        """Evaluate the stages of a step of length h from (base, start) into k, whose first row is known, and y.

        Returns
        -------
        tuple[int, int, Array]
            A status, how many evaluations there were, and y at the last stage.
        """
        if len(k) not in self._stages:
            own = {name: np.array(value) for name, value in tableau.items()}
            control, rows, last = MarchControl.table(1), np.zeros(k.shape), np.zeros(y.size)
            bound = self.bind("stages", own, control, self._base, self._start, rows, last, self._y, self._q, 0.0)
            self._stages[len(k)] = own, control, rows, last, bound
        own, control, rows, last, bound = self._stages[len(k)]
        for name, value in own.items():  # methods may have as many stages as each other
            value[...] = tableau[name]
        self._base[:], self._start[:], rows[0] = base, start, k[0]
        counts: Any = control[0]
        before = cast("int", counts.evaluations)
        status = int(bound(h))
        k[:], y[:] = rows, self._y
        return status, cast("int", counts.evaluations) - before, last.copy()

    def velocities(self, y: Array, r: Array, out: Array) -> None:
        """Write v̇ of all joints to ``out``, where an outward sweep has been."""
        self._y[:], self._r[:], self._out[:] = y, r, out
        self._run("velocities")
        out[:] = self._out

    def book(self, y0: Array, y1: Array) -> Array:
        """Return the end y1 of a step from y0 with what components made in place of what they passed on."""
        self._start[:], self._y[:] = y0, y1
        self._run("counted")
        return self._y.copy()

    def sum(
        self, tableau: Mapping[str, Any], k: Array, h: float, y0: Array, y1: Array, carry: Array, *, anchor: float,
        part: bool, damped: Array | None,
    ) -> tuple[int, Array, Array]:  # fmt: skip
        """Sum what a step with rates k adds to heats and totals; a part of one is held by ``totals``.

        ``anchor`` is that of the account; ``damped``: elements at the end, where energy that is missing becomes heat.

        Returns
        -------
        tuple[int, Array, Array]
            A status, the end, and what rounding left.
        """
        known = self._sums.get(id(tableau))
        if known is None or known[0] is not tableau:
            rows = np.zeros(k.shape)
            known = tableau, rows, self.bind("summed", tableau, rows, self.totals, self._q, h, anchor, 0, 0)
            self._sums[id(tableau)] = known
        _, rows, summed = known
        self._start[:], self._y[:], self.totals["before"][:], rows[:] = y0, y1, carry, k
        if damped is not None:
            self._q[:] = damped
        status = int(summed(h, anchor, int(part), int(damped is not None)))
        return status, self._y.copy(), self.totals["after"].copy()

    def correct(
        self, account: Array, y0: Array, y: Array, q: Array, allowed: Array, h: float, *, chosen: bool,
        alone: bool = False, share: float = WORTH,
    ) -> tuple[int, Array, Array, Array, float]:  # fmt: skip
        """Move the end (q, y) of a step from y0 to the energy that is left to it.

        Returns
        -------
        tuple[int, Array, Array, Array, float]
            A status, elements, y, the account (anchor, left, put, total, momenta) after it, and the step's error by
            that.
        """
        self._start[:], self._y[:], self._q[:], self._allowed[:] = y0, y, q, allowed
        a: Any = self._account[0]
        (a.anchor, a.left, a.put, a.total), self.work["kept"][: self.momenta] = account[:4].tolist(), account[4:]
        a.chosen, a.alone = int(chosen), int(alone)
        status = self._run("corrected", h, share)
        after = np.concatenate([[a.anchor, a.rest, a.put + a.moved, a.total + abs(a.moved)], account[4:]])
        return status, self._q.copy(), self._y.copy(), after, float(a.size)

    def energy(self, q: Array, r: Array, heats: Array) -> Array:
        """Return (3,) kinetic energy, all other energy that is not heat, and the sum of its terms' sizes in J."""
        self._q[:], self._r[:], self._heats[:] = q, r, heats
        self._run("energy")
        return self._held.copy()

    @property
    def momenta(self) -> int:
        """Number of momenta that steps keep: six of each island, zeros among them."""
        own: Any = self.tables["own"][0]
        return 6 * int(own.islands)

    def measure(self, q: Array, r: Array) -> Array:
        """Return the momenta of islands that steps keep."""
        if not self.momenta:
            return np.zeros(0)
        self._q[:], self._r[:] = q, r
        self._run("measured")
        return self.work["kept"].copy()

    def close(self, q: Array, r: Array) -> tuple[int, Array, Array]:
        """Return a status, elements with loops closed, and rates on them."""
        self._q[:], self._r[:] = q, r
        status = self._run("close")
        return status, self._q.copy(), self._r.copy()

    def along(self, q: Array, change: Array) -> Array:
        """Return a change of the rates without its part across the constraints, where loops were closed last, at q."""
        self._q[:], self._change[:] = q, change
        self._run("project")
        return self._change.copy()
