"""Interface between the time loop and a method: one or many steps per call; steps and records."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeAlias, TypeVar, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.running.control import Control
from ephs.solve.running.snapshot import Snapshot

if TYPE_CHECKING:
    from ephs.solve.march.control import Policy
    from ephs.solve.result.record import RunRecord

S = TypeVar("S")
S_co = TypeVar("S_co", covariant=True)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """Record of one instant.

    Parameters
    ----------
    x
        (point_size,) the states.
    energies
        (components,): energy of each storage in J, entropy made by each irreversible component in J/K.
    sums
        (4,): heat, energy supplied, exergy supplied in J, entropy made in J/K.
    """

    x: Array
    energies: Array
    sums: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Attempt(Generic[S]):
    """A solved step.

    Parameters
    ----------
    start, end
        The method's state before and after it.
    h
        Its length in s.
    error
        Estimated error relative to the tolerances; 0 where the method has no estimate.
    least
        The least entropy production of a component in it, in J/K.
    detail
        What dense output needs.
    worst
        Path of the state of the largest error, where it is known.
    happened
        Events that the method met in it by itself: time in s, name, and the state then.
    """

    start: S
    end: S
    h: float
    error: float
    least: float
    detail: Any = None
    worst: str = ""
    happened: tuple[tuple[float, str, S], ...] = ()


Instant: TypeAlias = tuple[float, S_co, float]
"""A time in s, the method's state then, and the least production in the step before."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Taken(Generic[S_co]):
    """Instants of many steps as arrays; states are made of them where one is asked for.

    Parameters
    ----------
    times, least
        (n,) in s; least entropy production in the step before, in J/K.
    data
        Arrays of n rows each, as the method reads them.
    state
        The method's state at the instant of a number.
    """

    times: Array
    least: Array
    data: tuple[Array, ...]
    state: Callable[[int], S_co]

    def __len__(self) -> int:
        return int(self.times.size)

    def __getitem__(self, number: int) -> Instant[S_co]:
        at = range(len(self))[number]
        return float(self.times[at]), self.state(at), float(self.least[at])

    def __iter__(self) -> Iterator[Instant[S_co]]:
        return (self[number] for number in range(len(self)))


Instants: TypeAlias = Taken[S_co] | Sequence[Instant[S_co]]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Span(Generic[S]):
    """Remainder of a run: from a state to its end, by steps of which the next one is h seconds long.

    The run began at ``t0``; ``counts`` are those of its steps so far. ``save_at`` are the times to keep, of which
    ``saved`` are kept already; None: every step. Without a ``policy`` steps are constant.
    """

    state: S
    t0: float
    until: float
    h: float
    control: Control
    policy: "Policy | None"
    save_at: Array | None
    saved: int
    counts: "Counts" = field(default_factory=lambda: Counts())


@final
@dataclass(frozen=True, slots=True)
class Counts:
    """Steps that were taken, tries that were rejected, lengths in s, the least entropy production, the next step."""

    steps: int = 0
    rejected: int = 0
    shortest: float = float("inf")
    longest: float = 0.0
    least: float = float("inf")
    h: float = 0.0

    def after(self, h: float, least: float, steps: int = 1) -> "Counts":
        """The counts after further steps of h seconds."""
        lengths = min(self.shortest, h), max(self.longest, h)
        return Counts(self.steps + steps, self.rejected, *lengths, min(self.least, least), self.h)


def too_fast(method: str, worst: str, asked: float) -> SolveError:
    """Refusal of the step length, in s, that a tolerance requires at a state."""
    told = f"{method} would need steps of about {asked:.1g} s" if np.isfinite(asked) else "its error is not finite"
    return SolveError(Outcome.TINY, worst, told)


def at_time(state: S, t: float) -> S:
    """A method's state at a time that differs by rounding."""
    return replace(state, t=t)  # pyright: ignore[reportArgumentType, reportCallIssue]


class Leg(Protocol[S_co]):
    """A run in compiled code, several steps per call; ``left`` if it stopped before the end."""

    left: bool

    def advance(self, steps: int) -> bool:
        """Take up to ``steps`` steps; whether the end is reached.

        Raises
        ------
        SolveError
            A step has no solution.
        """
        ...

    def rows(self) -> Instants[S_co]:
        """Instants to keep since the last call."""
        ...

    @property
    def time(self) -> float:
        """The time reached."""
        ...

    @property
    def state(self) -> S_co:
        """The state reached."""
        ...

    @property
    def counts(self) -> Counts:
        """Statistics so far."""
        ...

    def snapshot(self) -> Snapshot:
        """Present state, for `restore` of a leg of the same run."""
        ...

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        ...


class Stepper(Protocol[S]):
    """A method on one problem: start, step, and layout of its states, which are values with a time ``t``."""

    name: str

    def start(self, t: float, h: float) -> S:
        """The method's state at the initial values; h is the length of the first step."""
        ...

    def prepare(self, state: S, h: float) -> None:
        """Compile programs that are not in the cache, before timing starts."""
        ...

    def step(self, state: S, h: float) -> Attempt[S]:
        """One step of h seconds, which may be negative.

        Raises
        ------
        SolveError
            The step has no solution.
        """
        ...

    def many(self, span: Span[S]) -> Leg[S] | None:
        """Compiled run of many steps; None where there is none, or where inputs must be evaluated in Python."""
        ...

    def inside(self, attempt: Attempt[S], t: float) -> S:
        """The state at a time within a step, to the method's order."""
        ...

    def missed(self, attempt: Attempt[S]) -> float | None:
        """Error of a step, by others of another length, in tolerances; None where the balance of energy shows it."""
        ...

    def anew(self, state: S) -> S:
        """The same state as a start after a jump of inputs, without the former rates."""
        ...

    def row(self, state: S) -> Row:
        """Record of a state."""
        ...

    def record(self, taken: Instants[S]) -> "RunRecord":
        """Records of many instants."""
        ...

    def stats(self) -> dict[str, Any]:
        """Counts, for the solution's statistics."""
        ...

    def snapshot(self, state: S) -> Snapshot | None:
        """Memory between steps besides the state ``state``; a new method with both takes identical steps. None if
        unavailable: a resumed run then starts again."""
        ...

    def restore(self, snapshot: Snapshot, state: S) -> None:
        """Go on from a snapshot."""
        ...
