"""Integrating the reduced form: step control, what is kept, and the ledgers of every component."""

import time
from typing import Any

import numpy as np

from ephs.mechanics.reduced.explicit import Explicit, ReducedState, tableau
from ephs.mechanics.reduced.mechanism import reduce_scene
from ephs.mechanics.solve.adaptive import Control
from ephs.mechanics.solve.continuous import Continuous
from ephs.mechanics.solve.errors import OptionError, Outcome, SolveError
from ephs.mechanics.solve.integrate import Progress, failures_of, solution_of
from ephs.mechanics.solve.model import compile_model
from ephs.mechanics.solve.problem import Problem
from ephs.mechanics.solve.record import Record
from ephs.mechanics.solve.solution import Solution
from ephs.semantics.bundle import Array
from ephs.semantics.primitives import Irreversible

__all__ = ["integrate_reduced"]

RESPONSE = 0.1


def integrate_reduced(
    problem: Problem,
    t0: float,
    until: float,
    *,
    method: str,
    control: Control,
    save_at: Array | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Solve the initial value problem of a scene by an explicit method on its reduced form.

    Raises
    ------
    SimulationError
        The run failed part-way; ``.partial`` holds the solution up to there. `Interrupted` where the user stopped it.
    """
    begin = time.perf_counter()
    if not (np.isfinite(until) and until > t0):
        raise OptionError("until", until, f"a time after t0 = {t0!r} s")
    run = _Run(problem, method, t0, until, control, save_at, progress, begin)
    with failures_of(run):
        run.start()
        run.setup = time.perf_counter() - begin
        run.advance()
    return run.solution()


class _Run:
    """One run in progress."""

    state: ReducedState

    def __init__(
        self,
        problem: Problem,
        method: str,
        t0: float,
        until: float,
        control: Control,
        save_at: Array | None,
        progress: Progress | None,
        begin: float,
    ) -> None:
        self.problem, self.until, self.control = problem, until, control
        self.model = compile_model(problem.descriptor, problem.reference, problem.inputs(t0, problem.initial))
        self.reduced = reduce_scene(problem.scene, problem, self.model)
        self.stepper = Explicit(self.reduced, problem.scene, problem, self.model, tableau(method))
        self.continuous = Continuous(self.model)
        self.t = self.t0 = t0
        self.save_at, self.progress, self.begin = save_at, progress, begin
        self.setup = 0.0
        self.steps = self.rejected = self.saved = 0
        self.looked = begin
        self.rows: list[tuple[float, Array, Array, Array]] = []
        self.least = np.inf

    def start(self) -> None:
        """The closed initial state, and the first row."""
        self.state = self.stepper.start(self.t0)
        span = self.until - self.t0
        self.h = self.control.step or min(max(1e-4 * span, self.control.least), self.control.most, span)
        if self.save_at is None or (self.save_at.size and self.save_at[0] == self.t0):
            self._keep(self.state, 0.0)
            self.saved = 1

    def advance(self) -> None:
        """Step after step to the end, with PI control."""
        control, fixed = self.control, self.control.step is not None
        power, before = self.stepper.method.exponent, 1e-4
        first: Array | None = None
        while self.t < self.until:
            if control.max_steps is not None and self.steps >= control.max_steps:
                raise SolveError(Outcome.MANY, "", f"{control.max_steps}")
            rest = self.until - self.t
            if fixed:
                self.h = min(self.t0 + (self.steps + 1) * float(control.step or 0.0) - self.t, rest)
            h = rest if rest <= 1.0000001 * self.h else self.h
            try:
                y0 = self.stepper.vector(self.state)
                if first is None:
                    first = self.stepper.rates(self.state.t, self.state.q, y0)
                end, k, y1 = self.stepper.step(self.state, h, first)
                error = self.stepper.error(k, h, y0, y1, control.rtol, control.atol)
            except SolveError as failure:
                if fixed or failure.outcome is Outcome.PYTHON:
                    raise
                self._shrink(0.25 * h, failure)
                continue
            if not fixed and not error <= 1.0:
                self._shrink(h * max(0.2, 0.9 * error ** (-1.0 / power)) if np.isfinite(error) else 0.1 * h, None)
                continue
            self._accept(end, h, self.until if h == rest else None)
            first = None
            factor = 0.9 * max(error, 1e-10) ** (-0.7 / power) * before ** (0.4 / power)
            before = max(error, 1e-4)
            self.h = min(h * min(6.0, max(0.3, factor)), control.most)

    def _shrink(self, h: float, cause: SolveError | None) -> None:
        self.rejected += 1
        self.h = self.control.allowed(h, max(abs(self.t), abs(self.until)), cause)

    def _accept(self, end: ReducedState, h: float, at: float | None) -> None:
        made = end.books[2:] - self.state.books[2:]
        least = float(made.min(initial=np.inf))
        least = least if np.isfinite(least) else 0.0
        self.least = min(self.least, least)
        t = end.t if at is None else at
        if self.save_at is None:
            self._keep(ReducedState(t, end.q, end.r, end.s, end.books), least)
        else:  # a shorter step from the same start is dense output of full order
            last = int(np.searchsorted(self.save_at, t, side="right"))
            for when in self.save_at[self.saved : last]:
                inside = end if when == t else self.stepper.step(self.state, float(when) - self.state.t)[0]
                self._keep(ReducedState(float(when), inside.q, inside.r, inside.s, inside.books), least)
            self.saved = last
        self.state = ReducedState(t, end.q, end.r, end.s, end.books)
        self.t = t
        self.steps += 1
        now = time.perf_counter()
        if self.progress is not None and now - self.looked > RESPONSE:
            self.looked = now
            self.progress(self.t, self.until, self.stats())

    def _keep(self, state: ReducedState, least: float) -> None:
        d = self.problem.descriptor
        x = d.pack(self.stepper.states(state))
        still = np.zeros(self.model.unknowns)
        energies = self.continuous.energies(x, still, self.model.input_values())
        made = {path: state.books[2 + i] for i, path in enumerate(self.reduced.made)}
        for number, slot in enumerate(d.components):
            if isinstance(slot.primitive, Irreversible):
                energies[number] = made[slot.path]
        heat, work = state.books[0], state.books[1]
        self.rows.append((state.t, x, energies, np.array([heat, work, work, state.books[2:].sum(), least])))

    def stats(self) -> dict[str, Any]:
        """What the run did so far."""
        return {
            "method": self.stepper.method.name,
            "form": "reduced",
            "steps": self.steps,
            "rejected": self.rejected,
            "evaluations": self.stepper.evaluations,
            "cut_joints": [edge.name for edge in self.reduced.cut],
            "dependent_equations": 0,
            "unknowns": self.reduced.unknowns,
            "paper_unknowns": self.model.unknowns,
            "setup_s": self.setup,
            "integrate_s": time.perf_counter() - self.begin - self.setup,
            "least_production": self.least if np.isfinite(self.least) else 0.0,
        }

    def solution(self) -> Solution:
        """The solution so far."""
        n, size = len(self.problem.descriptor.components), self.problem.descriptor.point_size
        columns = zip(*self.rows, strict=True) if self.rows else ([], [], [], [])
        t, x, energies, ledgers = (np.array(list(column), dtype=float) for column in columns)
        shape = (x.reshape(-1, size), energies.reshape(-1, n), ledgers.reshape(-1, 5))
        return solution_of(self.problem, Record(t, *shape), self.stats())
