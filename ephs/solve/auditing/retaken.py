"""Verification of error estimates: some steps of a run, and the longest, repeated in thirds.

Methods that keep their balances whatever a step leaves out are steered by the difference of a step and two of half its
length. Where a step is so long that both leave out the same, that difference is small and the result is wrong. Thirds
of the step meet the motion at other times. What they add up to is the error of a run in tolerances, as the tolerance
is meant: without what an unstable motion makes of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar, final

import numpy as np

from ephs.solve.posing.breakpoints import Breakpoints
from ephs.solve.posing.errors import SolveError
from ephs.solve.running.snapshot import Snapshot, like, parts
from ephs.solve.running.stepping import Attempt, Stepper

S = TypeVar("S")
T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
PARTS = 3
"""Number of steps in place of one: no multiple of the two in the estimate."""
EACH, MOST = 60, 6
"""One in so many steps is taken again, at most so many and the longest: three steps in place of three times 60."""


def evenly_spread(size: int, count: int) -> list[int]:
    """Indices of ``count`` of ``size`` items, at even intervals from the first on."""
    return np.unique(np.linspace(0, size, count, endpoint=False).astype(int)).tolist()


def share_missed(order: int) -> float:
    """Part of the error of two half steps by which thirds of a step differ from them, of a method of this order."""
    return 1.0 - (2.0 / PARTS) ** order


@final
@dataclass(frozen=True, slots=True)
class Missed:
    """The error of chosen steps: its size in tolerances, and the time where a step's is largest."""

    size: float
    at: float


class Indexed(Protocol[T_co]):
    """Items by number."""

    def __len__(self) -> int: ...
    def __getitem__(self, number: int, /) -> T_co: ...


@final
class Spread(Generic[T]):
    """A sample of a sequence at even intervals: one item in 2ᵏ, at most twice `MOST`.

    Attributes
    ----------
    kept
        Items of the sample.
    count, stride
        Number of items added; one in ``stride`` is kept.
    """

    def __init__(self) -> None:
        self.kept: list[T] = []
        self.count, self.stride = 0, 1

    def add(self, items: Indexed[T]) -> None:
        """Add the next items of the sequence."""
        at, first, self.count = self.count, self.count, self.count + len(items)
        while (at := at + -at % self.stride) < self.count:
            if len(self.kept) == 2 * MOST:
                self.kept, self.stride = self.kept[::2], 2 * self.stride
            else:
                self.kept.append(items[at - first])
                at += 1

    def resume(self, kept: list[T], counts: Sequence[int]) -> None:
        """Go on from a sample, and from its count and stride."""
        self.kept, (self.count, self.stride) = kept, counts


@final
class Retaken(Generic[S]):
    """Some of the steps of a run, evenly spread, with the longest."""

    def __init__(self, *, wanted: bool) -> None:
        self._wanted = wanted
        self._spread = Spread[tuple[float, Attempt[S]]]()
        self._longest: tuple[float, Attempt[S]] | None = None

    def add(self, t: float, attempt: Attempt[S]) -> None:
        """A step from t that was accepted."""
        if not self._wanted:
            return
        if self._longest is None or abs(attempt.h) > abs(self._longest[1].h):
            self._longest = t, attempt
        self._spread.add([(t, attempt)])

    def missed(self, stepper: Stepper[S], breakpoints: Breakpoints, seconds: float) -> Missed | None:
        """The error of the run: that of its longest step, or of all by those that are spread, whichever is larger.

        None where no step was kept, or the method needs no such test.

        Parameters
        ----------
        stepper, breakpoints
            Those of the run.
        seconds
            Of its unit of time.
        """
        if self._longest is None:
            return None
        steps, spread = self._spread.count, self._spread.kept
        chosen = evenly_spread(len(spread), min(MOST, steps // EACH))
        found: list[tuple[float, float]] = []
        for t, attempt in [self._longest, *(spread[i] for i in chosen)]:
            breakpoints.stand(t)
            try:
                size = stepper.missed(attempt)
            except (SolveError, ArithmeticError, np.linalg.LinAlgError):  # thirds have no solution: no finding
                size = 0.0
            if size is None:
                return None
            found.append((size, t))
        mean = float(np.mean([size for size, _ in found[1:]])) if len(found) > 1 else 0.0
        return Missed(max(found[0][0], steps * mean), max(found)[1] * seconds)

    def snapshot(self) -> Snapshot:
        """Snapshot for `restore`."""
        kept = [self._longest, *self._spread.kept] if self._longest is not None else []
        return {
            "attempts": [[t, parts(of.start), parts(of.end), of.h, of.error, of.least] for t, of in kept],
            "counts": [self._spread.count, self._spread.stride],
        }

    def restore(self, snapshot: Snapshot, template: S) -> None:
        """Go on from a snapshot of states like the template."""
        found = [
            (t, Attempt(like(template, start), like(template, end), *rest))
            for t, start, end, *rest in snapshot["attempts"]
        ]
        self._longest = found[0] if found else None
        self._spread.resume(found[1:], snapshot["counts"])
