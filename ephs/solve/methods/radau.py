"""Radau IIA of order 5, 9 or 13 on the descriptor form: stiff, adaptive, constraints met at every step.

The collocation method of Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.8, written for implicit
equations g(x, ẋ, e, λ) = 0: the unknowns of a stage are its rates, efforts and multipliers, so neither a mass matrix
nor a choice of causality is needed, and what is algebraic in them is met at the end of the step, which is a stage.
"""

from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.rank import TINY
from ephs.semantics.stage import PLAIN
from ephs.solve.equations.model import model_of
from ephs.solve.march.iteration import FAST, iterate
from ephs.solve.methods.collocation import moments, radau_for, values
from ephs.solve.methods.continuous import AccumulatorRates, Matrices
from ephs.solve.methods.energies import EnergyEquations
from ephs.solve.methods.kept import KeptMatrices
from ephs.solve.methods.passages import Passages
from ephs.solve.methods.records import IRREVERSIBLE
from ephs.solve.methods.settling import LEFT, MISSED, PUT, TOTAL, Settling
from ephs.solve.methods.solvers import Solvers
from ephs.solve.methods.starts import unknowns_away
from ephs.solve.methods.stores import HeatStores
from ephs.solve.posing.errors import LARGEST, Outcome, SolveError, worst_entry
from ephs.solve.posing.problem import NO_STATE, Problem
from ephs.solve.result.record import RunRecord, record_of
from ephs.solve.running.control import Control
from ephs.solve.running.snapshot import Snapshot
from ephs.solve.running.stepping import Attempt, Instants, Row, Span

PROBE = 1e-7
"""Fraction of the first step for the trial of the start, which detects states that violate constraints."""
ENOUGH, ROUGH = 1e-5, 1e-1
"""Parts of what is allowed to which stages are solved, and that are good enough where the iteration gets no further."""
ROUNDING = 10.0 * np.finfo(float).eps
"""Part of the terms of an equation by which rounding changes their sum."""
FARTHEST = 2.0
"""Extrapolation, in lengths of the former step, beyond which the last value is the better guess."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class RadauState:
    """Present state of the method.

    Parameters
    ----------
    y, z
        The numbers of `HeatStores`, and the unknowns there: rates, efforts, multipliers, outer flows.
    stages, h
        The unknowns at the stages of the step before, and its length in s: 0 where there is none.
    sums
        (4 + components,): heat, energy supplied, exergy supplied, entropy made; entropy made by each component.
    account
        That of the energy, see `Settling`; empty where nothing may be moved.
    """

    t: float
    y: Array
    z: Array
    sums: Array
    stages: Array
    h: float
    account: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class StepTotals:
    """Powers of a step.

    Parameters
    ----------
    numbers
        (stages, states) at the stages.
    powers
        (stages, 4 + components) rates of the ledgers at the stages.
    passed
        (1 + stages, 2, passages) heat in W and entropy in W/K that is passed at the start, which counts for friction
        alone, and at the stages; none where all heat is conducted.
    mixed
        (stages, states) power in W into storages with entropies.
    """

    numbers: Array
    powers: Array
    passed: Array | None
    mixed: Array


@final
class Radau:
    """The method for one problem whose states are on vector spaces."""

    name = "radau"
    share, hold = 0.0, 1.2

    def __init__(self, problem: Problem, t0: float, control: Control) -> None:
        self.problem = problem
        self.model = model_of(problem, t0)
        self.stores = HeatStores(self.model)
        self.equations = EnergyEquations(self.model, self.stores)
        self._given = self.model.input_values()
        self._led = any(one.effort and not one.constant for one in problem.signals.values())
        self._passages = Passages(self.model, self.stores, self.equations.conduction)
        self._settling = Settling(self.model, self.stores.components)
        self._chosen = control.step is None
        self.scheme = radau_for(control.rtol.value if self._chosen else None)
        self.exponent = self.scheme.nodes.size + 1.0
        self._tolerance = control.rtol.value
        self.rtol, self.atol = control.rtol.rates(problem.descriptor), control.atol.rates(problem.descriptor)
        self.counts: dict[str, Any] = dict.fromkeys(("iterations", "evaluations", "factorisations"), 0)
        self._rates = int(self.model.tables.counts[0])
        self._makers = self.model.tables.kind == IRREVERSIBLE
        family = Solvers(self.model.unknown_name, self.equations.pivots)
        self._kept: KeptMatrices[RadauState, Matrices] = KeptMatrices(
            self.scheme, lambda state: self.equations.matrices(state.y, state.z, self.inputs(state.t, state.y)),
            lambda m, length: family.of_sum(m.unknowns, length, m.states), self.counts,
        )  # fmt: skip
        self._last: tuple[RadauState, AccumulatorRates] | None = None

    def inputs(self, t: float, y: Array) -> Array:
        """Values at the outer ports, one after the other."""
        p = self.problem
        if p.constant:
            return self._given
        state = NO_STATE if p.timed else p.descriptor.unpack(self.stores.entropies(y))
        return self.model.input_values(p.inputs(t, state))

    def start(self, t: float, h: float) -> RadauState:
        """The initial state; rates and multipliers there come from a step too short to move anything.

        Raises
        ------
        SolveError
            The states contradict the constraints: however short the step, they jump.
        """
        d = self.model.descriptor
        y = self.stores.numbers(self.problem.point)
        z = self.equations.guess(y)
        account = self._settling.opened(y) if self._settling.active else np.zeros(0)
        sums, stages = np.zeros(4 + len(d.components)), np.zeros((self.scheme.nodes.size, z.size))
        start = RadauState(t, y.copy(), z, sums, stages, 0.0, account)
        try:
            first, second = self._probed(start, h)
        except SolveError:
            away = unknowns_away(self.model, self.equations, y, self.inputs(t, y))
            if away is None:
                raise
            start, self._kept.stale = replace(start, z=away), True
            first, second = self._probed(start, h)
        allowed = self._allowed(y)
        jumps = [_size(end - y, allowed) for end in (first, second)]
        if jumps[1] > 0.75 * jumps[0] and jumps[1] > 1.0:
            entry = int(np.argmax(np.abs(second - y) / allowed))
            raise SolveError(
                Outcome.INCONSISTENT, self.model.state_path(entry), "the constraints do not hold at the start"
            )
        stages = self._solved(start, 0.5 * PROBE * h)[0]
        self._kept.stale = True
        return replace(start, z=values(self.scheme.nodes, 0.0) @ stages)

    def _probed(self, start: RadauState, h: float) -> list[Array]:
        """The states at the ends of two steps too short to move anything."""
        return [self._solved(start, PROBE * h * part)[1] for part in (1.0, 0.5)]

    def prepare(self, state: RadauState, h: float) -> None:
        """Nothing is left to do: the start has evaluated everything."""

    def many(self, span: Span[RadauState]) -> None:
        """None: one step a call."""

    def step(self, state: RadauState, h: float) -> Attempt[RadauState]:
        """One step of h seconds, solved to a fraction of the tolerances.

        Raises
        ------
        SolveError
            The stages have no solution near by, or lie outside the domain of a component.
        """
        stages, y, iterations = self._solved(state, h)
        if not np.abs(y).max(initial=0.0) < LARGEST:
            raise SolveError(Outcome.RANGE, self.model.state_path(int(np.argmin(np.abs(y) < LARGEST))), "")
        totals = self._totals(state, h, stages)
        error = self._error(state, h, stages, y)
        end, missed = self._end(state, h, 1.0, y, stages[-1].copy(), totals)
        if self._led and state.h != 0.0:  # rates at a start are known to few digits
            error = max(error, self._supplied_error(state, end, h, totals.powers[:, :4]))
        end = replace(end, stages=stages, h=h)
        made = (end.sums - state.sums)[4:][self._makers]
        self.counts["iterations"] += iterations
        least = float(made.min(initial=np.inf)) if made.size else 0.0
        return Attempt(state, end, h, max(error, missed), least, (stages, totals))

    def inside(self, attempt: Attempt[RadauState], t: float) -> RadauState:
        """The state at a time within the step, by its collocation polynomial; by a step where efforts are led."""
        if self._led:
            return self.step(attempt.start, t - attempt.start.t).end
        stages, totals = attempt.detail
        start, h = attempt.start, attempt.h
        theta = (t - start.t) / h
        y = start.y + h * moments(self.scheme.nodes, theta) @ stages[:, : self._rates]
        return self._end(start, h, theta, y, values(self.scheme.nodes, theta) @ stages, totals)[0]

    def missed(self, attempt: Attempt[RadauState]) -> None:
        """None: the balance of energy shows it."""

    def anew(self, state: RadauState) -> RadauState:
        """The same state as one to start from, whose rates may be others than before."""
        return replace(state, h=0.0)

    def record(self, taken: Instants[RadauState]) -> RunRecord:
        """Records of many instants."""
        accounts = [(state.t, state.account) for _, state, _ in taken if state.account.size]
        noted = [(t, *account[[PUT, TOTAL]], account[LEFT] + account[MISSED]) for t, account in accounts]
        times, *put = np.array(noted).reshape(-1, 4).T
        self._settling.noted.note(times, np.stack(put, axis=1))
        return record_of(taken, [self.row(state) for _, state, _ in taken])

    def row(self, state: RadauState) -> Row:
        """Record of a state."""
        energies, stores = np.where(self._makers, state.sums[4:], self._known(state).energies), self.stores
        energies[stores.components[stores.hot]] = state.y[stores.warm]
        return Row(stores.entropies(state.y), energies, state.sums[:4])

    def stats(self) -> dict[str, Any]:
        """Counts, for the solution's statistics."""
        return {
            "form": "paper",
            **self.counts,
            "unknowns": self.equations.unknowns,
            **(self._settling.noted.stats() if self._settling.active else {}),
        }

    def snapshot(self, state: RadauState) -> Snapshot:
        """Origin of the matrices, and counts."""
        return {
            "kept": self._kept.snapshot(state),
            "counts": self.counts,
            "noted": self._settling.noted.snapshot(),
        }

    def restore(self, snapshot: Snapshot, state: RadauState) -> None:
        """Make the matrices where they were made."""
        self._kept.restore(snapshot["kept"], state)
        self.counts.update(snapshot["counts"])
        self._settling.noted.restore(snapshot["noted"])

    def _solved(self, state: RadauState, h: float) -> tuple[Array, Array, int]:
        """Stages, the states at the end, and how many iterations that took."""
        stages, iterations = self._kept.solved(state, lambda: self._stages(state, h))
        return stages, state.y + h * self.scheme.coefficients[-1] @ stages[:, : self._rates], iterations

    def _totals(self, state: RadauState, h: float, stages: Array) -> StepTotals:
        """Entries of the ledgers at the stages, and the heat that is passed there and at the start."""
        ys = state.y + h * self.scheme.coefficients @ stages[:, : self._rates]
        found = self.equations.instants(ys, stages, self._inputs(state.t + h * self.scheme.nodes, ys))
        passed = None
        if self._passages.called:
            start = [self._known(state)] if self._passages.frictions else found[:1]
            passed = np.array([self._passages.powers(each) for each in (*start, *found)])
        mixed = np.array([self._settling.powers(each) for each in found])
        return StepTotals(ys, np.array([each.sums for each in found]), passed, mixed)

    def _known(self, state: RadauState) -> AccumulatorRates:
        """Powers and stored energies at a state."""
        if self._last is None or self._last[0] is not state:
            self._last = state, self._instant(state.t, state.y, state.z)
        return self._last[1]

    def _instant(self, t: float, y: Array, z: Array) -> AccumulatorRates:
        return self.equations.instants(y[None], z[None], self.inputs(t, y)[None])[0]

    def _inputs(self, times: Array, ys: Array) -> Array:
        """(stages, values) at the outer ports."""
        return np.array([self.inputs(t, y) for t, y in zip(times.tolist(), ys, strict=True)])

    def _end(
        self, state: RadauState, h: float, theta: float, y: Array, z: Array, totals: StepTotals
    ) -> tuple[RadauState, float]:
        """The state at a part of a step of h seconds, and what its error is by the energy that it missed.

        Its heat is booked by energy, see `Heats`, and it is moved to what energy is left, see `Settling`.
        """
        t, weights, passages = state.t + theta * h, h * moments(self.scheme.nodes, theta), self._passages
        sums, heat, error, account = state.sums + weights @ totals.powers, 0.0, 0.0, state.account
        changed, stored = y - state.y, self.stores.states
        if stored.size:
            y[stored] = state.y[stored]
            passed, missed, energies = None, None, None
            if totals.passed is not None:
                passed = np.tensordot(weights, totals.passed[1:], 1)
            if totals.passed is not None and passages.frictions:
                energies = np.array([self._known(state).energies, self._instant(t, y, z).energies])
                missed = self.scheme.gamma * totals.passed[0, 0] + self.scheme.defect @ totals.passed[1:, 0]
                missed = theta * h * missed
            y[stored], made, friction, heat = passages.booked(
                state.y, passed, (weights, totals.numbers), missed, energies, sums[1] - state.sums[1]
            )
            sums[0] += friction
            sums[3] += made.sum()
            sums[4:] += made
        if account.size:
            rest, missed, mixed = theta * h * z[: self._rates] - changed, 0.0, self._settling.mixed
            if mixed.size:
                stored = self._instant(t, y, z).energies[mixed] - self._known(state).energies[mixed]
                missed = self._settling.missed(weights, totals.mixed, stored)
            y, account, error = self._settling.settled(
                account, state.y, y, lambda: self._filtered(h, np.array([changed, rest])),
                self._allowed(state.y, y), float(sums[1]), heat, missed, chosen=self._chosen,
            )  # fmt: skip
        return RadauState(t, y, z, sums, state.stages, 0.0, account), error

    def _guess(self, state: RadauState, h: float) -> Array:
        """Unknowns at the stages of a step of h seconds, by the polynomial of the step before."""
        if state.h == 0.0 or abs(h) > FARTHEST * abs(state.h):
            return np.tile(state.z, (self.scheme.nodes.size, 1))
        return self.scheme.ahead(h / state.h) @ state.stages

    def _stages(self, state: RadauState, h: float) -> tuple[Array, int]:
        solvers, scheme, stages, rates = self._kept.solvers(h), self.scheme, self._guess(state, h), self._rates
        allowed = self._allowed(state.y)
        parts, before = np.zeros((scheme.nodes.size, rates)), np.inf

        def correct(tries: Any) -> float:
            nonlocal before
            ys = state.y + h * scheme.coefficients @ stages[:, :rates]
            inputs = self._inputs(state.t + h * scheme.nodes, ys)
            change = scheme.solved(self.equations.residuals(ys, stages, inputs), solvers)
            self.counts["evaluations"] += len(stages)
            stages[:] -= change
            parts[:] = np.abs(h * scheme.coefficients @ change[:, :rates]) / allowed
            moved = float(np.max(parts, initial=0.0))
            stalls, before = tries > 2 and moved > 0.3 * before, moved
            rounded = stalls and not np.any(self._unrounded(state, h, stages, change) & (parts > ENOUGH))
            if np.isfinite(moved) and (self.equations.linear or rounded):
                return 0.0  # one iteration solves what is linear, and rounding is no change
            return moved

        found = iterate(PLAIN, correct, ENOUGH, ROUGH, FAST)
        if found.solved:
            self._kept.stale = not found.fast
            return stages, int(found.tries)
        path = self.model.state_path(worst_entry(parts.max(axis=0)))
        raise SolveError(Outcome.DIVERGED, path, "its rate at the stages")

    def _unrounded(self, state: RadauState, h: float, stages: Array, change: Array) -> Any:
        """(states,) where more than rounding, of the equations' terms and of the numbers' sums, changes rates so much.

        A factor of 10 covers what the signs of the terms may cancel here.
        """
        m, real = self._kept.matrices, self._kept.solvers(h)[0]
        rates, largest = self._rates, np.abs(stages).max(axis=0)
        summed = self.stores.terms(state.y)
        summed += abs(h) * np.abs(self.scheme.coefficients[-1]).sum() * largest[:rates]
        terms = abs(m.unknowns) @ largest + abs(m.states)[:, :rates] @ summed
        allowed = ROUNDING * np.abs(real(terms)[:rates])
        return np.any(np.abs(change[:, :rates]) > allowed, axis=0)

    def _error(self, state: RadauState, h: float, stages: Array, y: Array) -> float:
        """The difference to the embedded method, filtered by the equations as the stiff part of it must be."""
        raw = h * (self.scheme.gamma * state.z[: self._rates] + self.scheme.defect @ stages[:, : self._rates])
        return _size(self._filtered(h, raw), self._allowed(state.y, y))

    def _supplied_error(self, state: RadauState, end: RadauState, h: float, powers: Array) -> float:
        """The same of heat, supply and entropy, relative to them or to what a step passes.

        Of states that are led nothing else is an error: they are as they must be, however long the step. Their flows
        are differences of amounts over this step, or the one before: rounding of the energies is none, either.
        """
        known = self._known(state)
        raw = h * (self.scheme.gamma * known.sums[:4] + self.scheme.defect @ powers)
        rounding = ROUNDING * (1.0 + abs(h / state.h)) * np.abs(np.delete(known.energies, self.stores.components)).sum()
        passed = np.maximum(np.abs(end.sums[:4]), abs(h) * np.abs(powers).max(axis=0))
        units = np.array([1.0, 1.0, 1.0, 1.0 / self.model.reference.temperature])
        return _size(raw, self._tolerance * passed + rounding * units + TINY)

    def _filtered(self, h: float, changes: Array) -> Array:
        """Changes (…, states) with their stiff parts damped, so that what is algebraic allows them."""
        real, m = self._kept.solvers(h)[0], self._kept.matrices
        raw = np.zeros((*changes.shape[:-1], self.equations.unknowns))
        raw[..., : self._rates] = changes
        return changes + h * self.scheme.gamma * real(-(m.states @ raw.T)).T[..., : self._rates]

    def _allowed(self, *ys: Array) -> Array:
        """(states,) what errors of numbers may be, by the largest of these; entropies count at stores of heat."""
        stores, sizes = self.stores, np.abs(self.stores.entropies(ys[0]))
        for y in ys[1:]:
            sizes = np.maximum(sizes, np.abs(stores.entropies(y)))
        allowed = self.atol + self.rtol * sizes
        return stores.slopes(ys[0]) * allowed if stores.warm.size else allowed


def _size(difference: Array, allowed: Array) -> float:
    """Largest entry relative to what is allowed."""
    return float(np.max(np.abs(difference) / allowed, initial=0.0))
