"""Members of one scene that differ in numbers only, run many in one call of compiled code."""

import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, final

import numpy as np

from ephs.mechanics.methods.auto import Auto
from ephs.mechanics.methods.explicit import Explicit
from ephs.mechanics.methods.registry import Setting, chosen
from ephs.mechanics.runs.pace import longest_step
from ephs.mechanics.runs.signals import times_of
from ephs.mechanics.runs.simulate import control_of
from ephs.mechanics.scene.build import component_path
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.sweep.axes import Axes
from ephs.mechanics.sweep.images import FAULTS, STARTS, Images, Truths, Unlike
from ephs.mechanics.sweep.members import Marches, MemberEnergies, Stack
from ephs.mechanics.sweep.outputs import Output
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.mechanics.tree.finding.tables import TREE
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import Pair
from ephs.solve.auditing.audit import MOTION, Bounds
from ephs.solve.auditing.growth import apart
from ephs.solve.equations.sparse import Index
from ephs.solve.march.records import Ending
from ephs.solve.posing.errors import LARGEST
from ephs.solve.posing.problem import Problem
from ephs.solve.running.control import ATOL, RTOL, Control, first_step
from ephs.solve.running.stepping import Span

# Members of an ensemble that may violate a law of their audit: they are run again individually, with the whole audit.
#
# What is looked at is cheap beside a member's run, and stricter than the audit: the balance of energy at a few of its
# instants, the entropy made in its steps, and at constant steps the distance from a run with longer ones.

LONGER = 4
"""Length of comparison steps in constant steps."""
INSTANTS = 5
"""Number of instants at which a member's energies are checked, besides the first and the last."""
ROUNDING = 1e-12
"""Rounding of an energy balance, relative to the energies."""


def suspicious(bounds: Bounds, held: Array, totals: Array, put: Array, least: Array) -> Truths:
    """(members,) whether a member has to be run on its own, with the audit's bounds.

    Parameters
    ----------
    held
        (members, instants, components) mechanical energies in J, the first ones at the start.
    totals
        (members, instants, 2) heat and work in J since then.
    put
        (members, …) energies in J that corrections put in.
    least
        (members,) the least entropy in J/K that a component made in a step.
    """
    changes, (heat, work) = held - held[:, :1], np.moveaxis(totals, 2, 0)
    gross = np.max(np.abs(changes).sum(axis=2) + np.abs(heat) + np.abs(work), axis=1)
    defect = np.max(np.abs(changes.sum(axis=2) + heat - work), axis=1)
    balanced = defect <= bounds.energy * gross + ROUNDING * np.abs(held).sum(axis=2).max(axis=1)
    return ~(balanced & (np.abs(put).max(axis=1) <= bounds.accuracy * gross)) | (least < 0.0)


def resolved(problem: Problem, x: Array, other: Array) -> Truths:
    """(members,) whether states (members, …) are near those of runs with steps that are `LONGER` times as long."""
    poses = [slot.point for slot in problem.descriptor.states if slot.quantity.kind == "pose"]
    return np.all([apart(x[:, at], other[:, at], problem.length) <= MOTION for at in poses], axis=0)


BURST = 100_000
"""Largest number of compiled steps of a member; longer ones are run individually, with progress."""
TOGETHER, MEMORY = 256, 2**22
"""Members in one call at most, and numbers that they may keep."""
_STEERING = {"method", "rtol", "atol", "step", "min_step", "max_step"}
_CHOSEN: Any = True
"""Stands for the policy of steps that are chosen, which compiled code follows on its own."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Ran:
    """Members that were run.

    Parameters
    ----------
    done
        (members,) whether a member was run; others have to be run on their own: they are not like the rest, have no
        solution, or may break a law of their audit.
    values
        Of each output (members, instants, columns).
    steps, rejected
        (members,).
    """

    done: Truths
    values: tuple[Array, ...]
    steps: Index
    rejected: Index


@final
class Ensemble:
    """The members of a sweep over one scene by explicit steps in compiled code.

    Parameters
    ----------
    options
        Those of `ephs.simulate` that say how steps are taken.

    Raises
    ------
    Unlike
        The scene, the options or the outputs need more than that.
    """

    def __init__(
        self, scene: Scene, axes: Axes, t0: float, until: float, save_at: Array, options: Mapping[str, Any],
        outputs: tuple[Output, ...],
    ) -> None:  # fmt: skip
        self.t0, self.until, self._options = t0, until, dict(options)
        if self._options.pop("form", "reduced") != "reduced" or set(self._options) - _STEERING:
            raise Unlike
        times = times_of(save_at, t0, until)
        assert times is not None  # outputs of a sweep are explicit
        self.times, self.first = times, int(times.size > 0 and times[0] == t0)
        self.images = Images(scene, axes, t0)
        equations = self.images.made.equations
        self.stepper(equations)
        self._reads = [_reading(equations, output) for output in outputs]
        arrays = self.images.made.arrays()
        kept = sum(arrays[number].size for number, *_ in self.images.parts())
        kept += (self.times.size + 2) * (equations.reduced.coordinates + equations.size)
        self.together = max(1, min(TOGETHER, MEMORY // kept, len(axes.members)))
        self._threads = threading.local()

    def run(self, members: Array) -> Ran:
        """Members (members, paths) of some values; several threads may do so at once."""
        if not getattr(self._threads, "own", None):
            self._threads.own = _Runs(self)
        size = self.together
        ran = [self._threads.own.run(members[at : at + size]) for at in range(0, len(members), size)]
        return Ran(
            np.concatenate([one.done for one in ran]),
            tuple(np.concatenate(each) for each in zip(*(one.values for one in ran), strict=True)),
            np.concatenate([one.steps for one in ran]),
            np.concatenate([one.rejected for one in ran]),
        )

    def read(self, q: Array, y: Array) -> tuple[Array, ...]:
        """Outputs (members, instants, columns) of elements, and of rates, entropies and ledgers at the instants."""
        flat = [each.reshape(-1, each.shape[-1]) for each in (q, y)]
        return tuple(read(*flat).reshape(*q.shape[:2], -1) for read in self._reads)

    def span(self, start: ReducedState, control: Control, times: Array, saved: int) -> Span[ReducedState]:
        """The run of a member."""
        policy = None if control.step is not None else _CHOSEN
        h = first_step(control, abs(self.until - self.t0))
        return Span(start, self.t0, self.until, h, control, policy, times, saved)

    def stepper(self, equations: ReducedEquations) -> Any:
        """The method on these equations.

        Raises
        ------
        Unlike
            It does not take many steps in one call.
        """
        given = self._options
        method, _ = chosen(given.get("method", "auto"), equations.problem, step=given.get("step"))
        if given.get("step") is None and longest_step(equations.problem, 1, 0.0, (self.t0, self.until)) < np.inf:
            raise Unlike("each member has its own limit")
        if equations.led.holds:
            raise Unlike("its work is no sum of rows")
        control = control_of(
            equations.problem, method.order, given.get("rtol", RTOL), given.get("atol", ATOL), given.get("step"),
            given.get("min_step"), given.get("max_step"), given.get("max_steps"),
        )  # fmt: skip
        stepper, _ = method.make(Setting(equations.problem, self.t0, control, {}, equations))
        if not (isinstance(stepper, Explicit | Auto) and equations.constant):
            raise Unlike(f"{method.name} takes one step a call")
        return stepper


@final
class _Runs:
    """Calls and memory of one thread."""

    def __init__(self, ensemble: Ensemble) -> None:
        self._ensemble, self._made, most = ensemble, ensemble.images.anew(), ensemble.together
        eq, arrays = self._made.equations, self._made.arrays()
        self._parts: list[tuple[Array, Array, Index, Index]] = []
        stacks = {number: np.tile(arrays[number], (most, 1)) for number in range(len(arrays) - STARTS, len(arrays))}
        self._starts = list(stacks.values())
        tables: list[Stack] = []
        for number, within, among in ensemble.images.parts():
            array = arrays[number]
            if number not in stacks:
                stacks[number] = np.tile(array, (most, *[1] * array.ndim))
                tables.append((array, stacks[number]))
            self._parts.append((array, stacks[number].reshape(most, -1), within, among))
        stepper = ensemble.stepper(eq)
        control, times, step = stepper.control, ensemble.times, stepper.control.step
        self._bounds = Bounds(control.tolerance, step)
        self._legs = [partial(self._leg, control, times, ensemble.first)]
        if step is not None:
            self._legs.append(partial(self._leg, replace(control, step=LONGER * step), np.zeros(0), 0))
        self._marches = [Marches(leg(self._made.start), tables, most) for leg in self._legs]
        kept = np.count_nonzero(times != ensemble.until) - ensemble.first  # the end is looked at in any case
        self._chosen = np.unique(np.linspace(0, kept - 1, INSTANTS).astype(int)) if kept else np.zeros(0, dtype=int)
        self._energies = MemberEnergies(eq, tables, most, self._chosen.size + 2)

    def run(self, members: Array) -> Ran:
        """Some members, `Ensemble.together` of them at most."""
        ensemble, count, eq = self._ensemble, len(members), self._made.equations
        rows, done = ensemble.images.of(members)
        for _, stack, within, among in self._parts:
            stack[:count, within] = rows[:, among]
        q, *start = (each[:count] for each in self._starts)
        y = np.hstack([*start, np.zeros((count, eq.summed))])
        for marches, leg in zip(self._marches, self._legs, strict=True):
            ending = marches.run(q, y, BURST)
            for k in np.flatnonzero(done & (ending == Ending.CAREFUL)):
                ending[k] = self._carefully(int(k), rows[k], leg, marches)
            done &= ending == Ending.DONE
        with np.errstate(all="ignore"):  # of members that are not done
            done &= self._lawful(q, y)
        marches = self._marches[0]
        q, y = (
            np.concatenate([start[:, None][:, : ensemble.first], kept[:count]], axis=1)
            for start, kept in ((q, marches.rows_q), (y, marches.rows_y))
        )
        return Ran(done, ensemble.read(q, y), marches.steps[:count].copy(), marches.rejected[:count].copy())

    def _lawful(self, q: Array, y: Array) -> Truths:
        """(members,) whether a member obeys the laws of its audit, by what it kept; q and y are those at its start."""
        eq, marches, count, at = self._made.equations, self._marches[0], len(q), self._chosen
        n, ns, end = eq.n, eq.ns, (marches.q[:count], marches.y[:count, eq.nv :])
        q = np.concatenate([q[:, None], marches.rows_q[:count, at], end[0][:, None]], axis=1)
        y = np.concatenate([y[:, None], marches.rows_y[:count, at], end[1][:, None]], axis=1)
        r, heats, totals = np.split(y, [n, n + ns], axis=2)
        # The heats' own laws are the base's: entropies of heat are no part of the mechanical energies.
        x, energies, known = self._energies.of(q, r, eq.heats.entropies(heats))
        held, put, least = energies * eq.led.mechanical, marches.put[:count], marches.least[:count]
        within = np.abs(np.hstack([end[0], end[1][:, : n + ns]])).max(axis=1, initial=0.0) < LARGEST
        lawful = known & within & np.isfinite(end[1]).all(axis=1)
        lawful &= ~suspicious(self._bounds, held, totals[..., :2], put, least)
        if len(self._marches) > 1:
            found, longer = x[:, -1].copy(), self._marches[1]
            q[:], y[:] = longer.q[:count, None], longer.y[:count, None, eq.nv :]
            r, heats, _ = np.split(y, [n, n + ns], axis=2)
            other, _, known = self._energies.of(q, r, eq.heats.entropies(heats))
            lawful &= known & resolved(eq.problem, found, other[:, -1])
        return lawful

    def _leg(self, control: Control, times: Array, saved: int, start: ReducedState) -> Any:
        """A march from a start, by a method that knows of no other."""
        stepper = self._ensemble.stepper(self._made.equations)
        return stepper.many(self._ensemble.span(start, control, times, saved))

    def _fill(self, row: Array) -> None:
        """Put a member's numbers into the tables."""
        for array, _, within, among in self._parts:
            array.flat[within] = row[among]
        self._made.equations.refilled()

    def _carefully(self, k: int, row: Array, leg: Callable[[ReducedState], Any], marches: Marches) -> Ending:
        """The march of a member with steps that need Python, which reads its numbers in the tables."""
        self._fill(row)
        eq = self._made.equations
        q, r, heats = (start[k].copy() for start in self._starts)
        start = ReducedState(self._ensemble.t0, q, r, heats, np.zeros(eq.summed))
        with suppress(*FAULTS):
            taken = leg(start)
            while not taken.left and taken.counts.steps + taken.counts.rejected < BURST:
                if taken.advance(BURST):
                    marches.take(k, taken)
                    return Ending.DONE
        return Ending.PAUSED


def _reading(equations: ReducedEquations, output: Output) -> Any:
    """Reader of an output from rows of elements and of rates, entropies and ledgers.

    Raises
    ------
    Unlike
        It needs the whole solution.
    """
    n, ns, reduced = equations.n, equations.ns, equations.reduced
    if output.name in ("heat", "work"):
        at = [[n + ns, n + ns + 2], [n + ns + 1]][output.name == "work"]
        return lambda q, y: y[:, at].sum(axis=1)
    kind, _, rest = output.name.partition(".")
    name, _, what = rest.rpartition(".")
    found = [
        i for i, edge in enumerate(reduced.edges) if edge.name == name and edge.path == component_path("joints", name)
    ]
    if kind != "joints" or len(found) != 1 or reduced.tables.kind[found[0]] != TREE:
        raise Unlike
    edge, t = reduced.edges[found[0]], reduced.tables
    if what == "rate":
        at, dim = int(t.r_at[found[0]]), int(t.dim[found[0]])
        return lambda q, y: y[:, at : at + dim]
    if what == "coordinate":
        at, size = int(t.q_at[found[0]]), int(t.q_size[found[0]])
        pair: Pair = edge.pair
        if size == edge.pair.dim:
            return lambda q, y: q[:, at : at + size]
        return lambda q, y: pair.coordinates(q[:, at : at + size])
    raise Unlike
