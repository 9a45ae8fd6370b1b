"""Step control: tolerances by quantity, limits, and the controllers."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.solve.posing.errors import OptionError, Outcome, SolveError, number_of
from ephs.solve.running.snapshot import Resumable

SLIVER = 1e-9
"""Fraction of a step, or of a time, that is rounding of sums of steps."""
EXACT = 1e-12
"""Error in tolerances below which the next symmetric step is the longest allowed."""
FINEST = 1e-11
"""Least symmetric step as a fraction of the run."""
CRAWL, STRETCH = 1e-12, 64
"""Least mean advance of a step, as a fraction of the run, in so many steps: at 1e-12 a run needs 1e12 steps."""
SHORTEST = 16.0
"""Least step, in roundings of the time."""
NEAREST = 1e6
"""The same for a whole run, whose first steps are a small part of it."""
RTOL, ATOL = 1e-6, 1e-9
"""Default tolerances: six relative digits, 1e-9 of a unit absolute."""
FIRST = 1e-4
"""First step as a fraction of the time span: rejected if too long, growing fast if too short."""


@final
@dataclass(frozen=True, slots=True)
class Tolerance:
    """A tolerance for every state: one number, or numbers by quantity and path.

    Parameters
    ----------
    value
        For all states that nothing else is said of.
    special
        Kind of quantity (``"entropy"``), or path of a state or of what contains it (``"joints.pin"``) -> number; the
        longest path that fits counts, a path before a kind.
    """

    value: float
    special: Mapping[str, float]

    @classmethod
    def of(cls, name: str, given: "float | Mapping[str, float]", default: float) -> "Tolerance":
        """From the user's option ``name``; the key ``"*"`` is the default.

        Raises
        ------
        OptionError
            It is negative, or no number.
        """
        entries = dict(given) if isinstance(given, Mapping) else {"*": given}
        out: dict[str, float] = {}
        for key, number in entries.items():
            label = name if not isinstance(given, Mapping) else f"{name}[{key!r}]"
            out[str(key)] = number_of(label, number, "a number ≥ 0")
            if not (np.isfinite(out[str(key)]) and out[str(key)] >= 0.0):
                raise OptionError(label, number, "a number ≥ 0")
        return cls(out.pop("*", default), out)

    def at(self, path: Path | str, kind: str) -> float:
        """The tolerance of one state."""
        if not self.special:
            return self.value
        text = str(path)
        fits = [key for key in self.special if text == key or text.startswith(f"{key}.")]
        if fits:
            return self.special[max(fits, key=len)]
        return self.special.get(kind, self.value)

    def known(self, name: str, states: Iterable[tuple[Path, str]]) -> None:
        """Refuse keys that match no state.

        Raises
        ------
        OptionError
            It names the key.
        """
        listed = [(str(path), kind) for path, kind in states] if self.special else []
        for key in self.special:
            if not any(key == kind or text == key or text.startswith(f"{key}.") for text, kind in listed):
                kinds = ", ".join(sorted({kind for _, kind in listed}))
                raise OptionError(f"{name}[{key!r}]", self.special[key], f"the path of a state, or one of {kinds}")

    def rates(self, descriptor: Descriptor) -> Array:
        """(rate_size,): the tolerance of every entry of a left-trivialised change of the states."""
        out = np.empty(descriptor.rate_size)
        for slot in descriptor.states:
            out[slot.rates] = self.at(slot.path, slot.quantity.kind)
        return out


@final
@dataclass(frozen=True, slots=True)
class Grid:
    """The times k·h from the start of a run of ``span`` seconds, the last step shortened to end on its end."""

    span: float
    h: float

    @property
    def whole(self) -> int:
        """Number of steps of full length."""
        count = self.span / self.h
        nearest = round(count)  # no additional tiny step where h divides the time up to rounding
        return int(nearest) if abs(count - nearest) <= SLIVER * max(1.0, count) else int(count)

    @property
    def last(self) -> float:
        """Length of the shortened last step, 0 where there is none."""
        rest = self.span - self.whole * self.h
        return rest if rest > SLIVER * self.h else 0.0

    @property
    def count(self) -> int:
        """Number of steps."""
        return self.whole + bool(self.last)


@final
@dataclass(frozen=True, slots=True)
class Control:
    """Step control.

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

    rtol: Tolerance
    atol: Tolerance
    step: float | None
    least: float
    most: float
    max_steps: int | None

    def __post_init__(self) -> None:
        if self.rtol.value == 0.0 and self.atol.value == 0.0:
            raise OptionError("rtol", self.rtol.value, "rtol or atol > 0")
        for name, value in (("step", self.step), ("max_step", self.most)):
            if value is not None and not value > 0.0:
                raise OptionError(name, value, "a number of seconds > 0")
        if self.step is not None and not np.isfinite(self.step):
            raise OptionError("step", self.step, "a number of seconds > 0")
        if not (self.least >= 0.0 and np.isfinite(self.least)):
            raise OptionError("min_step", self.least, "a number of seconds ≥ 0")
        if self.least > self.most:
            raise OptionError("min_step", self.least, f"at most max_step = {self.most!r}")

    @property
    def tolerance(self) -> float:
        """The largest relative tolerance, or the largest absolute one where that is 0."""
        rtol, atol = (max(given.value, *given.special.values(), 0.0) for given in (self.rtol, self.atol))
        return rtol or atol

    def allowed(self, h: float, latest: float, cause: SolveError | None, finest: float = 0.0) -> float:
        """A shorter step h, at times up to ``latest``.

        Raises
        ------
        SolveError
            It is below the least that is allowed, ``finest`` or what rounding leaves: the cause, if there is one.
        """
        if h < max(self.least, SHORTEST * np.spacing(latest), finest):
            raise cause or SolveError(Outcome.TINY, "", f"{h:.3g} s")
        return h


def first_step(control: Control, span: float) -> float:
    """The length of the first step, in s, of a run over ``span`` seconds."""
    return control.step or min(max(FIRST * span, control.least), control.most, span)


def told_apart(t0: float, until: float, step: float | None) -> None:
    """Raise an error where times of the run differ by rounding only.

    Raises
    ------
    OptionError
        The end is too near to the start for the numbers that times are there, or the step is too short.
    """
    rounding = float(np.spacing(max(abs(t0), abs(until))))
    if step is not None and step < SHORTEST * rounding:
        expected = f"at least {SHORTEST * rounding:.3g} s: times up to {max(abs(t0), abs(until)):g} s are no finer"
        raise OptionError("step", step, expected)
    if abs(until - t0) < NEAREST * rounding:
        raise OptionError("until", until, f"a time at least {NEAREST * rounding:.3g} s from t0 = {t0!r} s")


@final
class Advance:
    """Watches that steps of variable length come forward: near a singularity they may shrink without an end.

    Parameters
    ----------
    span
        Length of the run in its unit of time; 0 where steps are constant, which come to their end.
    """

    def __init__(self, t0: float, span: float) -> None:
        self._span, self._steps, self._t = span, 0, t0

    def require(self, steps: int, t: float) -> None:
        """After a number of steps, at a time.

        Raises
        ------
        SolveError
            The last ones are too short to come to the end of the run.
        """
        count = steps - self._steps
        if count < STRETCH:
            return
        mean = abs(t - self._t) / count
        if mean < CRAWL * self._span:
            raise SolveError(Outcome.TINY, "", f"{mean:.3g} s")
        self._steps, self._t = steps, t


@final
class Symmetric(Resumable):
    """The next step follows from the error of the last step alone.

    Each is tried again until its error is within a factor of what was aimed at: to that factor the step's length is a
    function of the step alone, and the same backward in time.

    Parameters
    ----------
    exponent
        The power of the step with which the estimate falls.
    """

    changing = ("_tries",)
    AIM, NEAR, TRIES, GROWTH = 0.5, 1.6, 4, 4.0
    finest = FINEST
    """Least fraction of the tolerance: below it are rounding of states and excessive step counts."""

    def __init__(self, exponent: float) -> None:
        self._exponent, self._tries = exponent - 1.0, 0

    def judge(self, h: float, error: float, span: float) -> tuple[bool, float]:
        """Accept errors within a factor of the aim, or after some tries within the tolerance.

        A step of h in a run of T may have h/T of the tolerance.
        """
        error *= span / h
        if not np.isfinite(error):
            return False, 0.25 * h
        wanted = float(np.clip(self._wanted(h, error), 0.1 * h, self.GROWTH * h))
        near = self.AIM / self.NEAR <= error <= self.AIM * self.NEAR
        self._tries += 1
        if near or (error <= 1.0 and (self._tries >= self.TRIES or wanted >= self.GROWTH * h)):
            self._tries = 0
            return True, wanted
        return False, wanted

    def wanted(self, h: float, error: float, span: float) -> float:
        """Length of the step whose error would equal the aim, without a lower limit."""
        return self._wanted(h, error * span / h)

    def _wanted(self, h: float, error: float) -> float:
        return h * (self.AIM / max(error, EXACT)) ** (1.0 / self._exponent)
