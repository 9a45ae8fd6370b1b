"""Search of inputs, functions of time, for changes shorter than steps.

Every function is asked at points of its own, ahead of the steps, at most a given width apart. Where it changes from
one point to the next much faster than before, the place is found by bisection. Shorter changes stay unseen.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.problem import State
from ephs.solve.running.snapshot import Snapshot

WIDTH = 1.0 / 2000.0
"""Spacing of samples of a function as a fraction of the run."""
FIRST, GROWTH = 1.0 / 64.0, 4.0
"""The first points after a jump are nearer: by this part of the width, and each by this factor farther than the last,
so that there is a rate of change to compare with."""
SHARP = 4.0 / 3.0
"""A rate of change is examined that is above the last two by more than this part of what parabolas reach, with their
vertex where the last interval begins: 2 + g for an interval g times as long as the last one."""
SMALL = 1e-6
"""Fraction of the largest value so far below which a change is ignored."""
SHARE = 0.1
"""Least share of the change between two points, however near, that makes it a jump."""
MISSED = 0.75
"""Part of the course of a function that the parabola through three points of a step, at its quarters, may leave out: of
a pulse that no stage meets, everything."""
KEPT = "values", "last", "before", "largest", "width"
"""Numbers of a course that journals keep."""
RESOLVED = 0.25
"""Least duration of a steep change that steps resolve, as a fraction of a step."""


@final
@dataclass(frozen=True, slots=True)
class ProbedInput:
    """A user's function as an input.

    Parameters
    ----------
    name
        What the user calls it.
    value
        Of the time in the units of the run, and the states where it wants them.
    stateful
        Whether it wants the states.
    """

    name: str
    value: Callable[[float, State | None], Any]
    stateful: bool

    def at(self, t: float, state: State | None) -> list[float]:
        """Its numbers at a time."""
        found = self.value(t, state)
        return [found] if isinstance(found, float) else np.ravel(np.asarray(found, dtype=float)).tolist()


@final
@dataclass(frozen=True, slots=True)
class Change:
    """A fast change of an input, from one time to another: the same ones for a jump."""

    name: str
    start: float
    end: float


@dataclass(slots=True)
class _SignalCourse:
    """Course of one function: its last values, their rates of change in the last two intervals, the largest so far,
    and the last width in s."""

    asked: ProbedInput
    values: list[float] = field(default_factory=list[float])
    last: list[float] = field(default_factory=list[float])
    before: list[float] = field(default_factory=list[float])
    largest: list[float] = field(default_factory=list[float])
    width: list[float] = field(default_factory=list[float])

    def begin(self, t: float, state: State | None) -> None:
        """Discard samples before t."""
        self.follow(self.asked.at(t, state))
        if not self.largest:
            self.largest = [0.0] * len(self.values)

    def follow(self, values: list[float]) -> None:
        """Restart from these values."""
        self.values, self.last, self.before, self.width = values, [], [], []

    def sharp(self, values: list[float], width: float) -> bool:
        """Whether the change to these values, over a width in s, must be examined; if not, they become the last."""
        rates: list[float] = []
        found, most = False, SHARP * (2.0 + width / self.width[0]) if self.width else 0.0
        for j, value in enumerate(values):
            change = abs(value - self.values[j])
            if abs(value) > self.largest[j]:
                self.largest[j] = abs(value)
            rates.append(change / width)
            if self.last and change > SMALL * self.largest[j] and rates[j] > most * self.last[j]:
                found = found or not self.before or rates[j] > most * self.before[j]
        if not found:
            self.values, self.last, self.before, self.width = values, rates, self.last, [width]
        return found


@final
class SignalProbe:
    """The search along one run.

    Parameters
    ----------
    asked
        The functions.
    t0, until
        Start and end of the run in s; it may go backward.
    within
        Keeps times on one side of what is known to jump.
    """

    def __init__(self, asked: Sequence[ProbedInput], t0: float, until: float, within: Callable[[float], float]) -> None:
        self._courses = [_SignalCourse(one) for one in asked]
        self._sign, self._width, self._within = float(np.sign(until - t0)), WIDTH * abs(until - t0), within
        self._nearest = 4.0 * float(np.spacing(max(abs(t0), abs(until))))
        self._at, self._spacing = t0, 0.0

    def begin(self, t: float) -> None:
        """Restart the observation at this time."""
        self._at, self._spacing = t, 0.0

    def look(self, to: float, limit: float, h: float, state: Callable[[], State]) -> Change | None:
        """The first fast change before a time that steps of h seconds would not resolve, or None.

        It looks beyond that time to its own next point, but not beyond ``limit``. The states are those where the next
        step starts. A function that fails is left to the step that asks for it.
        """
        to = min(to, limit) if self._sign > 0.0 else max(to, limit)
        if self._sign * (to - self._at) <= 0.0:
            return None
        now = state() if any(course.asked.stateful for course in self._courses) else None
        try:
            if not self._spacing:
                for course in self._courses:
                    course.begin(self._within(self._at), now)
                self._spacing = FIRST * self._width
            else:
                for course in self._courses:
                    if course.asked.stateful:
                        course.values = course.asked.at(self._within(self._at), now)
            while self._sign * (to - self._at) > 0.0:
                rest = abs(limit - self._at)
                after = limit if self._spacing >= rest else self._at + self._sign * self._spacing
                found = self._changes(after, h, now)
                self._at, self._spacing = after, min(GROWTH * self._spacing, self._width)
                if found:
                    return min(found, key=lambda change: self._sign * change.start)
        except Exception:  # exceptions of a user's function are raised again at the step that evaluates it
            return None
        return None

    def followed(self, t: float, h: float) -> float:
        """Length of a step from t, of h seconds or a part, in which parabolas follow the functions of time.

        Estimates of errors know of a longer one only what its stages meet: of a short pulse, nothing.
        """
        timed = [course for course in self._courses if not course.asked.stateful]
        largest = np.concatenate([[0.0], *(course.largest for course in timed)])
        count, n, seen = 2 ** int(np.ceil(np.log2(max(4.0, h / self._width)))), 2, list[Array]()
        with suppress(Exception):  # raised again at the step that evaluates it
            while timed and (n := 2 * n) <= count:
                for k in range(len(seen), n + 1):
                    when = self._within(t + self._sign * h * k / count)
                    seen.append(np.concatenate([[0.0], *(course.asked.at(when, None) for course in timed)]))
                course, s = np.array(seen), np.linspace(-2.0, 2.0, n + 1)
                weights = np.array([0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)])
                missed = np.abs(course - weights.T @ course[n // 4 : n : n // 4]).sum(axis=0)
                if (missed > np.maximum(MISSED * np.abs(course - course[n // 2]).sum(axis=0), SMALL * largest)).any():
                    return 0.25 * h * n / count
        return h

    def _changes(self, after: float, h: float, state: State | None) -> list[Change]:
        """Fast changes between the last point and the next."""
        found: list[Change] = []
        when, width = self._within(after), max(abs(after - self._at), self._nearest)
        for course in self._courses:
            before, values = course.values, course.asked.at(when, state)
            if course.sharp(values, width):
                change = self._located(course.asked, before, values, when, h, state)
                course.follow(values)
                if change is not None:
                    found.append(change)
        return found

    def _located(
        self, asked: ProbedInput, first: list[float], last: list[float], when: float, h: float, state: State | None
    ) -> Change | None:
        """The change between the last point and a time, by bisection; None if steps of h seconds resolve it."""
        before, after, a, b = self._within(self._at), when, first, last
        j = int(np.argmax(np.abs(np.subtract(b, a))))
        whole = abs(b[j] - a[j])
        most = before, after
        while abs(after - before) > self._nearest:
            middle = 0.5 * (before + after)
            c = asked.at(middle, state)
            if abs(c[j] - a[j]) > abs(b[j] - c[j]):
                after, b = middle, c
            else:
                before, a = middle, c
            share = abs(b[j] - a[j])
            if share < SHARE * whole:
                steep = abs(most[1] - most[0]) < RESOLVED * h
                return Change(asked.name, self._within(self._at), when) if steep else None
            if share > 0.5 * whole:
                most = before, after
        return Change(asked.name, after, after)

    def snapshot(self) -> Snapshot:
        """Snapshot for `restore`."""
        courses = [[getattr(course, name) for name in KEPT] for course in self._courses]
        return {"at": self._at, "spacing": self._spacing, "courses": courses}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self._at, self._spacing = snapshot["at"], snapshot["spacing"]
        for course, found in zip(self._courses, snapshot["courses"], strict=True):
            for name, numbers in zip(KEPT, found, strict=True):
                setattr(course, name, list(numbers))
