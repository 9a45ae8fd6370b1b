"""The time loop of methods that choose their steps: control, dense output, and what is kept."""

import time
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.mechanics.solve.errors import OptionError, Outcome, SolveError
from ephs.mechanics.solve.integrate import Grid, Progress, failures_of, solution_of
from ephs.mechanics.solve.model import compile_model
from ephs.mechanics.solve.natural import Chunk
from ephs.mechanics.solve.natural_kernels import IRREVERSIBLE
from ephs.mechanics.solve.problem import Problem
from ephs.mechanics.solve.radau import Radau, RadauState, Step
from ephs.mechanics.solve.record import Recorder
from ephs.mechanics.solve.solution import Solution
from ephs.semantics.bundle import Array

__all__ = ["ADAPTIVE", "Control", "integrate_adaptive"]

ADAPTIVE = {"radau": Radau}
"""Method name -> what makes it."""
RESPONSE = 0.1


@final
@dataclass(frozen=True, slots=True)
class Control:
    """How steps are chosen.

    Parameters
    ----------
    rtol, atol
        A state x is wanted to atol + rtol·|x| a step.
    step
        Constant steps of so many seconds, where given.
    least, most
        Limits for a step in s.
    max_steps
        Limit for their number, None: no limit.
    """

    rtol: float
    atol: float
    step: float | None
    least: float
    most: float
    max_steps: int | None

    def __post_init__(self) -> None:
        for name, value in (("rtol", self.rtol), ("atol", self.atol)):
            if not (np.isfinite(value) and value >= 0.0):
                raise OptionError(name, value, "a number ≥ 0")
        if self.rtol == 0.0 and self.atol == 0.0:
            raise OptionError("rtol", self.rtol, "rtol or atol > 0")
        for name, value in (("step", self.step), ("max_step", self.most)):
            if value is not None and not value > 0.0:
                raise OptionError(name, value, "a number of seconds > 0")
        if not self.least >= 0.0:
            raise OptionError("min_step", self.least, "a number of seconds ≥ 0")

    def allowed(self, h: float, latest: float, cause: SolveError | None) -> float:
        """A shorter step h, at times up to ``latest``.

        Raises
        ------
        SolveError
            It is below the least that is allowed, or that rounding leaves: the cause, if there is one.
        """
        if h < max(self.least, 16.0 * np.spacing(latest)):
            raise cause or SolveError(Outcome.TINY, "", f"{h:.3g} s")
        return h


def integrate_adaptive(
    problem: Problem,
    t0: float,
    until: float,
    *,
    method: str,
    control: Control,
    form: str = "paper",
    save_at: Array | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Solve an initial value problem.

    Raises
    ------
    SimulationError
        The run failed part-way; ``.partial`` holds the solution up to there. `Interrupted` where the user stopped it.
    """
    begin = time.perf_counter()
    if not (np.isfinite(until) and until > t0):
        raise OptionError("until", until, f"a time after t0 = {t0!r} s")
    run = _Run(problem, method, t0, until, control, form, save_at, progress, begin)
    with failures_of(run):
        run.start(problem.descriptor.pack(problem.initial))
        run.setup = time.perf_counter() - begin
        run.advance()
    return run.solution()


class _Run:
    """One run in progress."""

    state: RadauState

    def __init__(
        self,
        problem: Problem,
        method: str,
        t0: float,
        until: float,
        control: Control,
        form: str,
        save_at: Array | None,
        progress: Progress | None,
        begin: float,
    ) -> None:
        self.problem, self.until, self.control, self.form = problem, until, control, form
        model = compile_model(problem.descriptor, problem.reference, problem.inputs(t0, problem.initial))
        self.stepper = ADAPTIVE[method](model, self.inputs, control.rtol, control.atol)
        self.t, self.t0, self.save_at, self.progress, self.begin = t0, t0, save_at, progress, begin
        self.recorder = Recorder(problem.descriptor, t0, problem.descriptor.pack(problem.initial), None)
        self.setup = 0.0
        self.steps = self.rejected = self.iterations = self.saved = 0
        self.looked = begin
        self.sums = np.zeros(4 + len(problem.descriptor.components))

    def inputs(self, t: float, x: Array) -> Array:
        """Values at the outer ports, one after the other."""
        given = self.problem.inputs(t, self.problem.descriptor.unpack(x))
        return np.concatenate([*(given[slot.path].value for slot in self.problem.descriptor.outer), np.zeros(1)])

    def start(self, x0: Array) -> None:
        """Consistent unknowns at the start, and the first row."""
        span = self.until - self.t
        # A first guess that is too long is rejected, one that is too short grows by 8 a step.
        self.h = self.control.step or min(max(1e-4 * span, self.control.least), self.control.most, span)
        self.state = self.stepper.init(self.t, x0, self.h)
        first = self.stepper.energies(self.state)
        row = (x0, first, np.zeros(5))
        self.rows: list[tuple[float, Array, Array, Array]] = []
        if self.save_at is None or (self.save_at.size and self.save_at[0] == self.t0):
            self._keep([(self.t0, *row)])
            self.saved = 1

    def advance(self) -> None:
        """Step after step to the end."""
        control, grid = self.control, None
        if control.step is not None:
            grid = Grid(self.t0, self.until, control.step)
        before: tuple[float, float] | None = None
        while self.t < self.until:
            if control.max_steps is not None and self.steps >= control.max_steps:
                raise SolveError(Outcome.MANY, "", f"{control.max_steps}")
            rest = self.until - self.t
            # No sliver is left for a last step.
            h = self.h if rest > 1.01 * self.h else rest if rest <= self.h or grid else 0.5 * rest
            try:
                step = self.stepper.step(self.state, h)
            except SolveError as error:
                if grid is not None or error.outcome in (Outcome.PYTHON, Outcome.UNSUITED):
                    raise
                self._shrink(0.25 * h, error)
                continue
            if grid is None and step.error > 1.0:
                self._shrink(h * max(0.1, 0.9 * step.error**-0.25), None)
                continue
            self._accept(step, self.until if h == rest else None)
            if grid is None:
                factor = 0.9 * max(step.error, 1e-10) ** -0.25
                if before is not None:  # Gustafsson's predictive controller
                    factor = min(factor, factor * (h / before[0]) * (before[1] / max(step.error, 1e-10)) ** 0.25)
                before = h, max(step.error, 1e-2)
                factor = min(8.0, max(0.2, factor))
                if not 1.0 <= factor <= 1.2:
                    self.h = min(h * factor, control.most)
            elif self.steps:
                self.h = min(control.step or h, grid.time(self.steps + 1) - self.t)

    def _shrink(self, h: float, cause: SolveError | None) -> None:
        self.rejected += 1
        self.h = self.control.allowed(h, max(abs(self.t), abs(self.until)), cause)

    def _accept(self, step: Step, end: float | None) -> None:
        self.iterations += step.iterations
        t = step.end.t if end is None else end
        powers, least = self.stepper.powers(step)
        added = self.stepper.integral(step, powers, step.end.t)
        if self.save_at is None:
            self._keep([(t, step.end.x, *self._row(step.end, self.sums + added, least))])
        else:
            last = int(np.searchsorted(self.save_at, t, side="right"))
            rows: list[tuple[float, Array, Array, Array]] = []
            for when in self.save_at[self.saved : last]:
                x, z = self.stepper.dense(step, when) if when < t else (step.end.x, step.end.z)
                sums = self.sums + (self.stepper.integral(step, powers, when) if when < t else added)
                rows.append((when, x, *self._row(RadauState(when, x, z), sums, least)))
            self._keep(rows)
            self.saved = last
        self.sums += added
        self.steps += 1
        self.state, self.t = RadauState(t, step.end.x, step.end.z), t
        now = time.perf_counter()
        if self.progress is not None and now - self.looked > RESPONSE:
            self.looked = now
            self.progress(self.t, self.until, self.stats())

    def _row(self, state: RadauState, sums: Array, least: float) -> tuple[Array, Array]:
        energies = self.stepper.energies(state)
        made = self.stepper.model.tables.kind == IRREVERSIBLE
        return np.where(made, sums[4:], energies), np.array([*sums[:4], least])

    def _keep(self, rows: list[tuple[float, Array, Array, Array]]) -> None:
        if rows:
            times, xs, energies, sums = (np.array(column) for column in zip(*rows, strict=True))
            self.recorder.add(times, Chunk(xs, energies, sums, 0, None))

    def stats(self) -> dict[str, Any]:
        """What the run did so far."""
        stepper = self.stepper
        return {
            "method": stepper.name,
            "form": self.form,
            "steps": self.steps,
            "rejected": self.rejected,
            "iterations": self.iterations,
            "evaluations": stepper.evaluations,
            "factorisations": stepper.factorisations,
            "dependent_equations": 0,
            "unknowns": stepper.model.unknowns,
            "setup_s": self.setup,
            "integrate_s": time.perf_counter() - self.begin - self.setup,
            "least_production": self.recorder.least,
        }

    def solution(self) -> Solution:
        """The solution so far."""
        return solution_of(self.problem, self.recorder.result(), self.stats())
