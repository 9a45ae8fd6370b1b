"""Sampled inputs: a function of measurements, computed once a period and held until the next sample.

Steps end where a sample is taken and where its value takes effect, by every method. What was held stays known: an input
is a piecewise constant function of time, of the past too, for audits, loads and files.
"""

from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import OptionError, Outcome, SolveError, number_of
from ephs.solve.posing.problem import Problem, State
from ephs.solve.running.control import SLIVER
from ephs.solve.running.snapshot import Snapshot

FINEST = 1e3
"""Least period, in roundings of the time."""
MOST = 10_000_000
"""Largest number of samples in one run: all are stored."""


@final
@dataclass(frozen=True, slots=True)
class Sampled:
    """An input from a digital controller: ``inputs={"joints.waist": Sampled(1e-3, control)}``.

    Parameters
    ----------
    period
        Time between samples in s; samples are taken at t₀ + k·period.
    function
        f(t, state) -> numbers, with the state read as by other inputs; with ``memory`` f(t, state, memory) ->
        (numbers, memory for the next sample).
    memory
        Initial memory of the controller: numbers, arrays, and lists and mappings of these. None: no memory.
    delay
        Time in s from a sample until its value takes effect; before the first one, the value is ``initial``.
    limits
        (lower, upper) bounds of the values: numbers, or arrays of the length of the function's result.
    noise
        Measured quantity -> standard deviation: ``{"joints.waist.rate": 0.01}``, or by path of a state.
    seed
        Seed of the noise, which depends only on the seed and the number of the sample.
    initial
        Value before the first sample takes effect: a number, or an array.

    Raises
    ------
    OptionError
        A number is not finite or out of range; a ValueError.
    """

    period: float
    function: Callable[..., Any]
    memory: Any = None
    delay: float = 0.0
    limits: tuple[Any, Any] | None = None
    noise: Mapping[str, Any] = field(default_factory=dict[str, Any])
    seed: int = 0
    initial: Any = 0.0

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise OptionError("Sampled.function", self.function, "a function f(t, state)")
        for key, bound, least in (("period", ">", np.finfo(float).tiny), ("delay", ">=", 0.0)):
            given, expected = getattr(self, key), f"a number of seconds {bound} 0"
            if not least <= number_of(f"Sampled.{key}", given, expected) < np.inf:
                raise OptionError(f"Sampled.{key}", given, expected)
        if self.limits is not None and not np.all(np.asarray(self.limits[0]) <= np.asarray(self.limits[1])):
            raise OptionError("Sampled.limits", self.limits, "(lower, upper), lower <= upper")
        for name, size in self.noise.items():
            if not np.all(np.asarray(size, dtype=float) >= 0.0):
                raise OptionError(f"Sampled.noise[{name!r}]", size, "standard deviations >= 0")


@final
class Held:
    """The values of one sampled input along a run: a function of time, in s.

    Attributes
    ----------
    count
        How many samples were taken.
    """

    def __init__(self, name: str, sampled: Sampled, t0: float, until: float) -> None:
        self.name, self.sampled, self.count = name, sampled, 0
        near = float(np.spacing(max(abs(t0), abs(until))))
        least = max(FINEST * near, (until - t0) / MOST)
        if until < t0:
            raise OptionError(f"inputs[{name!r}]", "Sampled", "a run forward in time: samples are not undone")
        if sampled.period < least:
            raise OptionError(f"inputs[{name!r}].period", sampled.period, f"at least {least:.3g} s")
        steps = np.arange(int(np.floor((until - t0) / sampled.period + SLIVER)) + 1)
        self.samples: list[float] = (t0 + steps * sampled.period).tolist()
        self._times: list[float] = []
        self._values: list[Array] = []
        self._memory = sampled.memory

    @property
    def times(self) -> Array:
        """(n,) in s, at which steps end: samples, and where they take effect."""
        whole = np.array(self.samples)
        return np.unique(np.concatenate([whole, whole + self.sampled.delay])) if self.sampled.delay else whole

    def __call__(self, t: float) -> Any:
        """Held value at a time; where one value takes over from another, the new one."""
        k = bisect_right(self._times, t) - 1
        if k >= 0:
            return self._values[k]
        first = np.asarray(self.sampled.initial, dtype=float)
        return np.broadcast_to(first, self._values[0].shape) if self._values else first

    def due(self, t: float, near: float) -> bool:
        """Whether the next sample is at a time, to ``near`` s."""
        return self.count < len(self.samples) and self.samples[self.count] <= t + near

    def sample(self, view: Any) -> None:
        """Take the next sample of the readings of ``view``.

        Raises
        ------
        SolveError
            The function raised an exception, or gave no finite numbers.
        """
        t, of = self.samples[self.count], self.sampled
        try:
            seen = view if not of.noise else _NoisyView(view, "", self._noise(view))
            if of.memory is None:
                given = of.function(t, seen)
            else:
                given, self._memory = of.function(t, seen, self._memory)
            value = np.atleast_1d(np.array(given, dtype=float))
            if of.limits is not None:
                value = np.clip(value, *of.limits)
        except (SolveError, MemoryError, OptionError):
            raise
        except Exception as error:
            raise SolveError(Outcome.INPUT, self.name, f"{type(error).__name__}: {error}", error) from error
        if not np.isfinite(value).all():
            raise SolveError(Outcome.INPUT, self.name, f"it is {value.tolist()}")
        self._times.append(t + of.delay)
        self._values.append(value)
        self.count += 1

    def _noise(self, view: Any) -> dict[str, Array]:
        """Noise of each measured value in this sample."""
        rng = np.random.default_rng([self.sampled.seed, self.count])
        out: dict[str, Array] = {}
        for name, size in self.sampled.noise.items():
            try:
                value = np.asarray(_read(view, name), dtype=float)
            except (KeyError, AttributeError) as error:
                raise OptionError(f"inputs[{self.name!r}].noise", name, f"what is measured: {error}") from error
            out[name] = np.asarray(size, dtype=float) * rng.standard_normal(value.shape)
        return out

    def snapshot(self) -> Snapshot:
        """Snapshot for `restore`."""
        return {
            "count": self.count,
            "values": [list(map(float, value)) for value in self._values],
            "memory": self._memory,
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Resume from a snapshot."""
        self.count, self._memory = snapshot["count"], snapshot["memory"]
        self._values = [np.array(value, dtype=float) for value in snapshot["values"]]
        self._times = [t + self.sampled.delay for t in self.samples[: self.count]]


@final
class _NoisyView:
    """A view with noise on some of its readings, by name: ``joints.waist.rate``."""

    def __init__(self, of: Any, at: str, noise: Mapping[str, Array]) -> None:
        self._of, self._at, self._noise = of, at, noise

    def __getattr__(self, name: str) -> Any:
        return self._seen(getattr(self._of, name), name)

    def __getitem__(self, name: Any) -> Any:
        return self._seen(self._of[name], str(name))

    def _seen(self, value: Any, name: str) -> Any:
        here = f"{self._at}.{name}" if self._at else name
        if here in self._noise:
            return value + self._noise[here]
        return _NoisyView(value, here, self._noise) if any(k.startswith(here + ".") for k in self._noise) else value


@final
@dataclass(frozen=True, slots=True)
class Sampling:
    """A sampled input of a problem in its own unit of time."""

    held: Held
    problem: Problem

    def take(self, t: float, near: float, state: Callable[[], State]) -> None:
        """Sample a state of the problem if a sample is due at a time.

        Raises
        ------
        SolveError
            The function has no value.
        """
        problem = self.problem
        if self.held.due(t * problem.seconds, near * problem.seconds):
            now = state()
            self.held.sample(problem.view(now if problem.given is None else problem.given(now)))


def _read(view: Any, name: str) -> Any:
    """Reading of a view under a name: ``joints.left.waist.rate``, or the path of a state."""
    kind, _, rest = name.partition(".")
    of, _, what = rest.rpartition(".")
    try:
        return view[name]
    except KeyError:
        return getattr(getattr(view, kind)[of], what)


def holding(inputs: Mapping[Any, Any], t0: float, until: float) -> tuple[dict[Any, Any], list[Held]]:
    """Inputs with functions of time in place of sampled ones, and these.

    Raises
    ------
    OptionError
        A period is too short for the run, or that goes backward in time.
    """
    held: list[Held] = []

    def sampled_at(name: str, value: Any) -> Any:
        if not isinstance(value, Sampled):
            return value
        held.append(Held(name, value, t0, until))
        return held[-1]

    out: dict[Any, Any] = {}
    for key, value in inputs.items():
        name = ", ".join(key) if isinstance(key, tuple) else str(key)
        parts = isinstance(value, Mapping)
        out[key] = (
            {side: sampled_at(name, given) for side, given in value.items()} if parts else sampled_at(name, value)
        )
    return out, held
