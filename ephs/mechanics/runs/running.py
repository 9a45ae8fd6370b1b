"""Runs of a problem by a method."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, final

import numpy as np

from ephs.mechanics.methods.registry import METHODS, MethodEntry, Setting, chosen
from ephs.mechanics.runs.system_problem import is_posed
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.semantics.descriptor.product import factors_of
from ephs.solve.auditing.growth import Again
from ephs.solve.march.control import Policy
from ephs.solve.posing.breakpoints import Breakpoints
from ephs.solve.posing.errors import OptionError, SolveError
from ephs.solve.posing.events import Event
from ephs.solve.posing.problem import Problem, State
from ephs.solve.result.solution import Solution
from ephs.solve.running.abreast import Part, integrate_abreast
from ephs.solve.running.control import RTOL, Control, Tolerance
from ephs.solve.running.loop import RunLoop, integrate
from ephs.solve.running.request import RunRequest
from ephs.solve.running.stepping import Stepper
from ephs.solve.running.watching import Progress

CLOSE = 1e-4
"""Tolerance of the steps of an independent run."""
FINE = 3e-4
"""Tolerances above this take so few steps that each part's own start costs more: measured of balls on a floor."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A problem, a method, and from when to when; in the problem's unit of time.

    Parameters
    ----------
    options
        The method's own.
    """

    problem: Problem
    method: MethodEntry
    start: float
    end: float
    control: Control
    options: Mapping[str, Any]

    def run(self, breakpoints: Breakpoints, request: RunRequest) -> Solution:
        """Run it.

        Raises
        ------
        SimulationError
            The run failed part-way; ``.partial`` is the solution up to there.
        """
        parts = self._parts(breakpoints, request)
        if len(parts) > 1:
            return integrate_abreast(self.problem, parts, request)
        seen = breakpoints.of(self.problem)
        return integrate(seen, self.start, self.end, partial(self._stepper, seen), self.control, breakpoints, request)

    def _stepper(self, problem: Problem) -> tuple[Stepper[Any], Policy | None]:
        return self.method.make(Setting(problem, self.start, self.control, self.options, method=self.method.name))

    def _parts(self, breakpoints: Breakpoints, request: RunRequest) -> list[Part]:
        """Runs of the independent parts; none where what is asked for, or what inputs read, is of the whole.

        All steps of a run are kept of its whole, constant ones are its own, and impacts are events.
        """
        problem, d, control = self.problem, self.problem.descriptor, self.control
        whole = request.save_at is None or request.events or request.journal
        whole = whole or control.step is not None or control.tolerance > FINE
        if whole or not problem.timed or breakpoints.sampled or d.strikes is not None:
            return []
        factors = factors_of(d, problem.prescribed, *([is_posed] if problem.mechanical else []))
        if len(factors) < 2:
            return []
        begin, asked = time.perf_counter(), replace(request, progress=None, remarks={})
        parts: list[Part] = []
        for factor in factors:
            own, known = _restricted(problem, factor.descriptor), breakpoints.again()
            seen = known.of(own)
            run = RunLoop(seen, self.start, self.end, *self._stepper(seen), control, known, asked, begin)
            parts.append((factor, run))
        return parts

    def serves(self, name: str) -> bool:
        """Whether another method, by its name, accepts the problem with these steps."""
        if name == self.method.name:
            return False
        try:
            method, _ = chosen(name, self.problem, step=self.control.step)
            method.make(Setting(self.problem, self.start, self.control, {}, method=name))
        except (OptionError, SemanticsError, SolveError, ArithmeticError, np.linalg.LinAlgError):
            return False
        return True

    def again(self, known: Breakpoints) -> Again | None:
        """Further runs of the problem, over the jumps that a run has known; None where steps are chosen."""
        if self.control.step is None:
            return None
        explicit = self.problem.mechanical and not self.method.name.startswith("rk")
        return Again(lambda h, to: self._coarser(known, h, to), partial(self._independent, known) if explicit else None)

    def _coarser(self, known: Breakpoints, h: float, to: float) -> Solution:
        unit = self.problem.seconds
        end = to / unit
        course = replace(self, end=end, control=replace(self.control, step=h / unit, max_steps=None))
        return course.run(Breakpoints(self.start, end, np.array(known.times)), RunRequest())

    def _independent(self, known: Breakpoints, times: Array, most: int) -> Solution:
        kept = times / self.problem.seconds
        tolerance = Tolerance(CLOSE, {})
        control = Control(tolerance, tolerance, None, 0.0, self.control.most, most)
        course = replace(self, end=float(kept[-1]), control=control, method=METHODS["rk87"], options={})
        return course.run(Breakpoints(self.start, course.end, np.array(known.times)), RunRequest(save_at=kept))


def _restricted(problem: Problem, descriptor: Descriptor) -> Problem:
    """The problem of an independent part."""
    return replace(
        problem,
        system=descriptor.system,
        descriptor=descriptor,
        initial={slot.path: problem.initial[slot.path] for slot in descriptor.states},
        signals={slot.path: problem.signals[slot.path] for slot in descriptor.outer},
        shown=None,
        given=None,
    )


def by_constant_steps(problem: Problem, until: float, step: float) -> Solution:
    """Run a problem from 0 to ``until`` by the natural method in steps of so many seconds, without an audit.

    Raises
    ------
    SimulationError
        See `Course.run`.
    """
    tolerance = Tolerance(RTOL, {})
    control = Control(tolerance, tolerance, step, 0.0, np.inf, None)
    return Course(problem, METHODS["natural"], 0.0, until, control, {}).run(Breakpoints(0.0, until), RunRequest())


def seen_from(problem: Problem, events: tuple[Event, ...], progress: Progress | None) -> tuple[Any, Any]:
    """Events and progress in times and states of the original problem."""
    given, seconds, view = problem.given, problem.seconds, problem.view

    def seen(event: Event) -> Event:
        function = event.function

        def read(t: float, state: State) -> float:
            return function(t * seconds, view(state if given is None else given(state)))

        return replace(event, function=read)

    if given is None:
        return tuple(map(seen, events)), progress
    told = None if progress is None else lambda t, until, stats: progress(t * seconds, until * seconds, stats)
    return tuple(map(seen, events)), told
