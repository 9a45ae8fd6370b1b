"""Jumps of inputs: steps end at them and restart on the other side.

A time within rounding of a jump means the side that the run is on: before it until a step has ended there, then after.
So a step never mixes both, whatever rounding its own points have, and whatever that of a user's function.
"""

from bisect import bisect_left, insort
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.motion_law import MotionLaw
from ephs.solve.posing.probe import Change, ProbedInput, SignalProbe
from ephs.solve.posing.problem import Problem, Signal, State
from ephs.solve.posing.sampled import Sampling
from ephs.solve.running.snapshot import Snapshot

NEAR = 16.0
"""Tolerance for equal times, in roundings of the time."""
MOST_FOUND = 1000
"""Largest number of detected jumps in one run: a function with more is not piecewise smooth."""


@final
class Breakpoints:
    """The jumps of one run, declared or detected.

    Parameters
    ----------
    t0, until
        Start and end in s; the run may go backward.
    declared
        (n,) ascending times.
    asked
        Functions that are searched for jumps.
    held
        Sampled inputs, whose times are among those declared.
    """

    def __init__(
        self,
        t0: float,
        until: float,
        declared: Array | None = None,
        asked: Sequence[ProbedInput] = (),
        held: Sequence[Sampling] = (),
    ) -> None:
        self._held, self._asked = held, asked
        self._until, self._sign, self._at = until, 1.0 if until > t0 else -1.0, t0
        self.near = NEAR * float(np.spacing(max(abs(t0), abs(until))))
        self._times: list[float] = [] if declared is None else declared.tolist()
        self._declared = frozenset(self._times)
        self._found: list[Change] = []
        self._split = 0
        self._probe = SignalProbe(asked, t0, until, self.within) if asked else None

    def again(self) -> "Breakpoints":
        """The same for another run from here, which finds jumps for itself."""
        found = Breakpoints(self._at, self._until, np.array(self._times), self._asked)
        if found._probe is not None:
            found._probe.begin(self._at)
        return found

    @property
    def sampled(self) -> bool:
        """Whether inputs are sampled."""
        return bool(self._held)

    @property
    def times(self) -> tuple[float, ...]:
        """All known jumps, ascending."""
        return tuple(self._times)

    @property
    def active(self) -> bool:
        """Whether jumps are known or possible."""
        return bool(self._times) or self._probe is not None

    def of(self, problem: Problem) -> Problem:
        """The problem with inputs evaluated on the run's side of jumps; solutions refer to the original problem."""
        if not self.active or problem.constant:
            return problem
        signals = {path: self._sided(signal) for path, signal in problem.signals.items()}
        return replace(problem, signals=signals, shown=lambda record, stats: (problem, record, stats))

    def _sided(self, signal: Signal) -> Signal:
        value = signal.value
        if not callable(value) or isinstance(value, MotionLaw):
            return signal
        return replace(signal, value=lambda t, state: value(self.within(t), state))

    def within(self, t: float) -> float:
        """Time on the run's side of a jump within rounding of it."""
        if not self._times:
            return t
        k = bisect_left(self._times, t - self.near)
        if k == len(self._times) or self._times[k] > t + self.near:
            return t
        jump = self._times[k]
        ahead = self._sign * (jump - self._at) > 0.0
        return jump - self._sign * self.near if ahead else jump + self._sign * self.near

    def end(self, t: float, h: float, state: Callable[[], State]) -> float:
        """Latest end of a step of h seconds from t: the next jump, or the end of the run."""
        limit = self._next(t)
        if self._probe is None or len(self._found) > MOST_FOUND:
            return limit
        if limit != self._until and limit not in self._declared:  # a detected jump: the search continues from it
            return limit
        change = self._probe.look(t + self._sign * h, limit, h, state)
        if change is None:
            return limit
        apart = [
            when
            for when in {change.start, change.end}
            if self._sign * (when - t) > self.near and self._sign * (limit - when) > self.near
        ]
        for when in apart:
            insort(self._times, when)
        if apart:
            self._found.append(change)
        return self._next(t)

    def followed(self, t: float, h: float) -> float:
        """Length of a step of at most h seconds from t that passes over no pulse of a function of time."""
        return h if self._probe is None else self._probe.followed(t, h)

    def _next(self, t: float) -> float:
        if self._sign > 0.0:
            k = bisect_left(self._times, t + self.near)
            return min(self._times[k], self._until) if k < len(self._times) else self._until
        k = bisect_left(self._times, t - self.near) - 1
        return max(self._times[k], self._until) if k >= 0 else self._until

    def stand(self, t: float) -> None:
        """Set the present time; all later jumps are ahead."""
        self._at = t

    def enter(self, t: float, state: Callable[[], State], *, split: bool = False) -> None:
        """Record the end of a step at a jump, with its state; ``split``: it is part of a constant step.

        Raises
        ------
        SolveError
            The function of a sampled input has no value there.
        """
        for sampling in self._held:
            sampling.take(t, self.near, state)
        self._at = t
        self._split += split
        if self._probe is not None:
            self._probe.begin(t)

    @property
    def split(self) -> int:
        """Number of additional steps from dividing constant ones."""
        return self._split

    def stats(self) -> dict[str, Any]:
        """Statistics: the number of declared jumps, the jumps found, the number of divided steps."""
        if not (self._times or self._found):
            return {}
        sampled = {"samples": {one.held.name: one.held.count for one in self._held}} if self._held else {}
        found = [{"t": change.end, "input": change.name} for change in self._found]
        return {"jumps": {"declared": len(self._declared), "found": found, "divided_steps": self._split, **sampled}}

    def snapshot(self) -> Snapshot:
        """Snapshot for `restore`."""
        return {
            "at": self._at,
            "times": self._times,
            "found": [[change.name, change.start, change.end] for change in self._found],
            "split": self._split,
            "held": [one.held.snapshot() for one in self._held],
            "probe": self._probe.snapshot() if self._probe is not None else None,
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Resume from a snapshot."""
        self._at, self._times, self._split = snapshot["at"], list(snapshot["times"]), snapshot["split"]
        self._found = [Change(*change) for change in snapshot["found"]]
        for one, found in zip(self._held, snapshot["held"], strict=True):
            one.held.restore(found)
        if self._probe is not None:
            self._probe.restore(snapshot["probe"])
