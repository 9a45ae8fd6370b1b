"""The natural methods, one step per call: variable steps, error estimates, events and variable inputs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from ephs.semantics.bundle import Array
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.codes import VECTOR
from ephs.solve.auditing.retaken import PARTS, share_missed
from ephs.solve.control import Control
from ephs.solve.methods.driven import ComponentMethod, advance_driven, started
from ephs.solve.methods.natural import NaturalState
from ephs.solve.problem import Problem
from ephs.solve.snapshot import Snapshot
from ephs.solve.starting import check_start
from ephs.solve.stepping import Attempt, Row, Span

__all__ = ["Paced", "PacedState"]


@final
@dataclass(frozen=True, slots=True, eq=False)
class PacedState:
    """Present state of the method: its own state, the time, and the record there."""

    t: float
    inner: NaturalState
    kept: Row


@final
class Paced:
    """A natural method on one problem.

    Parameters
    ----------
    doubled
        Whether a step is two of half the length, whose difference to one of the whole length estimates the error.
    """

    def __init__(self, problem: Problem, method: ComponentMethod, control: Control, *, doubled: bool) -> None:
        self.problem, self.method, self.name = problem, method, method.name
        self._doubled = doubled
        self._iterations = 0
        d = problem.descriptor
        self._rtol, self._atol = control.rtol.rates(d), control.atol.rates(d)
        self._counted = _counted(problem)

    def start(self, t: float, h: float) -> PacedState:
        """The initial state.

        Raises
        ------
        SolveError
            The states contradict the constraints.
        """
        check_start(self.problem, self.method.model, h)
        x = self.problem.descriptor.pack(self.problem.initial)
        energies = self.method.energies(x)
        return PacedState(t, self.method.init(x), Row(x, energies, np.zeros(4)))

    def prepare(self, state: PacedState, h: float) -> None:
        """Compile programs that are not in the cache, before timing starts."""
        self.method.prepare(state.inner, h)

    def many(self, span: Span[PacedState]) -> None:
        """None: one step a call."""

    def step(self, state: PacedState, h: float) -> Attempt[PacedState]:
        """One step of h seconds."""
        if not self._doubled:
            end, least = self._single(state, h)
            return Attempt(state, end, h, 0.0, least)
        coarse, _ = self._single(state, h)
        middle, first = self._single(state, 0.5 * h)
        end, second = self._single(middle, 0.5 * h)
        off, worst = self._off(state, coarse, end)
        return Attempt(state, end, h, off / (2.0**self.method.order - 1.0), min(first, second), worst=worst)

    def inside(self, attempt: Attempt[PacedState], t: float) -> PacedState:
        """A shorter step from the same start."""
        return self._single(attempt.start, t - attempt.start.t)[0]

    def missed(self, attempt: Attempt[PacedState]) -> float:
        """Error of a step in tolerances, by steps of a third of its length."""
        end = attempt.start
        for _ in range(PARTS):
            end, _ = self._single(end, attempt.h / PARTS)
        return self._off(attempt.start, attempt.end, end)[0] / share_missed(self.method.order)

    def at(self, state: PacedState, t: float) -> PacedState:
        """The same state at a time that differs by rounding."""
        return replace(state, t=t)

    def anew(self, state: PacedState) -> PacedState:
        """The same state as one to start from: unknowns are guessed afresh."""
        return replace(state, inner=started(self.method, state.inner.x, state.inner.sums))

    def rows(self, states: Sequence[PacedState]) -> list[Row]:
        """Records of many states."""
        return [self.row(state) for state in states]

    def row(self, state: PacedState) -> Row:
        """Record of a state."""
        return state.kept

    def stats(self) -> dict[str, Any]:
        """Counts, for the solution's statistics."""
        return {
            **self.problem.remarks,
            "iterations": self._iterations,
            "orders": self.method.changes,
            "dependent_equations": len(self.method.redundant),
            "unknowns": self.method.model.unknowns,
        }

    def snapshot(self, state: PacedState) -> Snapshot:
        """Memory from step to step besides the state."""
        return {"method": self.method.snapshot(), "iterations": self._iterations}

    def restore(self, snapshot: Snapshot, state: PacedState) -> None:
        """Go on from a snapshot."""
        self.method.restore(snapshot["method"])
        self._iterations = snapshot["iterations"]

    def _single(self, state: PacedState, h: float) -> tuple[PacedState, float]:
        inner, chunk = advance_driven(self.problem, self.method, state.inner, state.t, h)
        self._iterations += chunk.iterations
        if chunk.failure is not None:
            raise chunk.failure
        sums = chunk.ledgers[-1]
        return PacedState(state.t + h, inner, Row(chunk.x[-1], chunk.energies[-1], sums[:4])), float(sums[4])

    def _off(self, state: PacedState, coarse: PacedState, fine: PacedState) -> tuple[float, str]:
        """Distance between two ends of a step in tolerances, and the state where it occurs."""
        worst, where = 0.0, ""
        for slot in self.problem.descriptor.states:
            space = manifold(slot.quantity.space)
            if not self._counted[slot.rates].all() or not space.dim:
                continue
            a, b = coarse.inner.x[slot.point], fine.inner.x[slot.point]
            size = 1.0
            if space.code == VECTOR:
                size = max(float(np.abs(b).max()), float(np.abs(state.inner.x[slot.point]).max()))
            allowed = self._atol[slot.rates] + self._rtol[slot.rates] * size
            error = float(np.max(np.abs(space.increment(a, b)) / allowed))
            if not error <= worst:
                worst, where = error, str(slot.path)
        return worst, where


def _counted(problem: Problem) -> Array:
    """(rate_size,) which states count in an error: not momenta whose junctions have constraints.

    Those satisfy the constraints to the method's order only, alternating; what they do shows in positions.
    """
    d = problem.descriptor
    bound = np.zeros(d.effort_size, dtype=bool)
    for slot in d.components:
        if slot.multipliers:
            bound[list(slot.efforts)] = True
    out = np.ones(d.rate_size, dtype=bool)
    for slot in d.components:
        if slot.primitive.kind == "storage":
            rates = [i for s in slot.reads for i in range(s.rates.start, s.rates.stop)]
            for rate, effort in zip(rates, slot.efforts, strict=True):
                out[rate] = not bound[effort]
    odd = {i for s in d.states if s.quantity.parity < 0 for i in range(s.rates.start, s.rates.stop)}
    out[[i for i in range(d.rate_size) if i not in odd]] = True
    return out
