"""Events: functions of time and state whose zeros are located while a system is solved."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeVar, final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import OptionError, Outcome, SolveError
from ephs.solve.posing.problem import States
from ephs.solve.running.snapshot import Snapshot

S = TypeVar("S")
Point = tuple[float, float]
"""A time in s, and the value of an event's function there."""
SPLIT = 0.5 * (3.0 - 5.0**0.5)
"""Where an interval is divided: by the golden section, so that points do not fall in with periods."""
MARGIN = 3.0
"""Factor on the distance of two inner points from the chord, within which a function is taken to stay."""
MOST_SPLITS, MOST_CALLS = 4, 100
"""Bounds of the divisions of a step, and of the calls of a function within it."""


@final
@dataclass(frozen=True, slots=True)
class Event:
    """A zero crossing of a function of time and state.

    Parameters
    ----------
    function
        f(t, state) -> number; the state is read by path, as in inputs.
    name
        Its name in the solution.
    direction
        +1: only rising in time, −1: only falling, 0: both.
    stop
        Whether the run ends at this event.
    """

    function: Callable[[float, Mapping[Any, Array]], float]
    name: str = "event"
    direction: int = 0
    stop: bool = False

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise OptionError("events", self.function, "functions f(t, state)")
        if self.direction not in (-1, 0, 1):
            raise OptionError("events", self.direction, f"a direction of {self.name}: −1, 0 or 1")

    def value(self, t: float, state: Mapping[Any, Array]) -> float:
        """The function's value.

        Raises
        ------
        SolveError
            It raised an exception, or gave no finite number.
        """
        try:
            found = float(np.asarray(self.function(t, state), dtype=float).reshape(()))
        except MemoryError:
            raise
        except Exception as error:
            raise SolveError(Outcome.EVENT, "", f"{self.name}: {type(error).__name__}: {error}", error) from error
        if not np.isfinite(found):
            raise SolveError(Outcome.EVENT, "", f"{self.name} = {found}")
        return found


@final
@dataclass(frozen=True, slots=True, eq=False)
class Crossing:
    """An occurrence of an event: its name, the time in s, and the states by path."""

    name: str
    t: float
    state: Mapping[Path, Array]

    def record(self) -> dict[str, Any]:
        """As plain data, for statistics and files."""
        state = {str(path): np.atleast_1d(value).tolist() for path, value in self.state.items()}
        return {"name": self.name, "t": float(self.t), "state": state}

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> "Crossing":
        """From plain data."""
        state = {Path.of(path): np.array(value, dtype=float) for path, value in record["state"].items()}
        return cls(record["name"], float(record["t"]), States(state))


def events_of(given: Iterable[Any] | None) -> tuple[Event, ...]:
    """Events from a user's list: `Event` values, or functions, whose attributes ``terminal`` and ``direction`` count
    as in SciPy.

    Raises
    ------
    OptionError
        Something else is among them, or two have one name.
    """
    out: list[Event] = []
    for number, item in enumerate(given or ()):
        if isinstance(item, Event):
            out.append(item)
        elif callable(item):
            function: Any = item
            name = getattr(function, "__name__", "event")
            name = f"event {number}" if name == "<lambda>" else name
            terminal, direction = getattr(function, "terminal", False), getattr(function, "direction", 0)
            out.append(Event(function, name, int(np.sign(direction)), bool(terminal)))
        else:
            raise OptionError("events", item, "functions f(t, state) or ephs.Event values")
    names = [event.name for event in out]
    for name in names:
        if names.count(name) > 1:
            raise OptionError("events", name, "names that differ")
    return tuple(out)


@final
class Watch:
    """Looks for events from step to step."""

    def __init__(self, events: tuple[Event, ...], t: float, state: Mapping[Path, Array]) -> None:
        self.events = events
        self.crossings: list[Crossing] = []
        self._before = [event.value(t, state) for event in events]

    def step(
        self, t0: float, t1: float, end: Mapping[Path, Array], inside: Callable[[float], Mapping[Path, Array]]
    ) -> float | None:
        """Record the events after t0 and up to t1; return the time of a terminal one, if any.

        A function that is zero at t0 has crossed there already; it counts again only after it has left zero. Where it
        bends, it is called at instants within the step, too, so that it cannot cross and come back unseen.
        """
        after = [event.value(t1, end) for event in self.events]
        found: list[tuple[float, int]] = []
        for i, (event, a, b) in enumerate(zip(self.events, self._before, after, strict=True)):
            look = _Look(event, inside)
            for x, y in pairwise(look.points((t0, a), (t1, b))):
                rising = (y[1] > x[1]) == (t1 > t0)
                crossed = x[1] != 0.0 and (y[1] == 0.0 or (x[1] < 0.0) != (y[1] < 0.0))
                if crossed and (event.direction == 0 or (event.direction > 0) == rising):
                    found.append((look.zero(x, y), i))
        self._before = after
        found.sort(key=lambda pair: abs(pair[0] - t0))
        for t, i in found:
            self.crossings.append(Crossing(self.events[i].name, t, end if t == t1 else inside(t)))
            if self.events[i].stop:
                return t
        return None

    def stats(self) -> dict[str, Any]:
        """The events so far as plain data, if any are defined or have occurred."""
        return {"events": [one.record() for one in self.crossings]} if self.events or self.crossings else {}

    def add(self, happened: Iterable[tuple[float, str, S]], states: Callable[[S], Mapping[Path, Array]]) -> None:
        """Record an event detected by the method: time, name, and the method's state with its ``states`` by path."""
        count = len(self.crossings)
        self.crossings += [Crossing(name, t, states(state)) for t, name, state in happened]
        if len(self.crossings) > count:
            self.crossings.sort(key=lambda crossing: crossing.t)

    def snapshot(self) -> Snapshot:
        """Events so far, and the functions' values."""
        return {"before": self._before, "crossings": [crossing.record() for crossing in self.crossings]}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self._before = list(snapshot["before"])
        self.crossings = [Crossing.of_record(record) for record in snapshot["crossings"]]


@final
@dataclass(frozen=True, slots=True)
class _Look:
    """Looks for zeros of an event's function within a step, whose states ``inside`` has."""

    event: Event
    inside: Callable[[float], Mapping[Path, Array]]

    def points(self, first: Point, last: Point) -> list[Point]:
        """Times and values from the first to the last: as far as bends tell, one zero at most between each two.

        Two points within say how far the function bends from its chord. Where more than that could lead it to zero and
        back, or make it turn where it crosses, there are more points.
        """
        out, waiting, left = [first], [(first, last, 0)], MOST_CALLS
        while waiting:
            begin, end, depth = waiting.pop()
            (t0, a), (t1, b) = begin, end
            times = [t0 + share * (t1 - t0) for share in (SPLIT, 1.0 - SPLIT)]
            if not left or depth > MOST_SPLITS or not min(t0, t1) < min(times) < max(times) < max(t0, t1):
                out.append(end)
                continue
            left -= 2
            inner = [(t, self.event.value(t, self.inside(t))) for t in times]
            values = [a, *(value for _, value in inner), b]
            chord = [a + share * (b - a) for share in (SPLIT, 1.0 - SPLIT)]
            bend = max(abs(value - line) for value, line in zip(values[1:3], chord, strict=True))
            crosses = min(values) <= 0.0 <= max(values)
            if MARGIN * bend > (0.25 * abs(b - a) if crosses else min(map(abs, values))):
                parts = pairwise([begin, *inner, end])
                waiting += [(x, y, depth + 1) for x, y in reversed(list(parts))]
            else:
                out += [*inner, end]
        return out

    def zero(self, first: Point, last: Point) -> float:
        """The zero between two points."""
        from scipy.optimize import brentq

        (t0, a), (t1, b) = first, last
        if b == 0.0:
            return t1

        def value(t: float) -> float:
            if t == t0:
                return a
            return b if t == t1 else self.event.value(t, self.inside(t))

        precision = 4.0 * float(np.spacing(max(abs(t0), abs(t1))))
        root: Any = brentq(value, t0, t1, xtol=precision, maxiter=200)
        return float(root)
