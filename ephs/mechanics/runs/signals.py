"""Inputs as signals: constants, functions of time, functions of time and state; users' times."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import AssemblyError, listed
from ephs.solve.posing.errors import OptionError, nearest_of
from ephs.solve.posing.motion_law import MotionLaw
from ephs.solve.posing.probe import ProbedInput
from ephs.solve.posing.problem import Problem, Signal, State, States
from ephs.solve.posing.sampled import Held

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

View = Callable[[State], Mapping[Path, Array]]
EXAMPLES = {
    "inputs": '{"joints.waist": 1.0}',
    "bounds": '{"osc.pe.k": (1.0, 2.0)}',
    **dict.fromkeys(("initial", "sigma"), '{"osc.pe.q": 1.0}'),
    "start": '{"osc.pe.k": 1.0}',
}
"""Options that are mappings, with an example for messages."""


def signal(value: Any, *, effort: bool, name: str, size: int | None, view: View = States) -> Signal:
    """A signal from a constant, f(t), or f(t, state), of ``size`` numbers; ``view`` makes what f reads of the states.

    Raises
    ------
    AssemblyError
        A constant is something else.
    """
    if isinstance(value, MotionLaw):
        if not effort:
            raise AssemblyError("input", name, found=repr(value), expected="an effort: a motion law prescribes a rate")
        return Signal.of_motion(value, name)
    if not callable(value):
        found = numbers_of(value)
        expected = f"{size or ''} finite number{'' if size == 1 else 's'}".strip()
        if found is None or not np.isfinite(found).all() or (size is not None and found.shape != (size,)):
            raise AssemblyError("input", name, found=repr(value), expected=expected)
        return Signal(found, effort, name, size)
    function: Any = value
    if takes_state(function):
        return Signal(lambda t, state: function(t, view(state)), effort, name, size)
    return Signal(lambda t, _state: function(t), effort, name, size, held=isinstance(function, Held), timed=True)


def numbers_of(value: Any) -> Array | None:
    """Input as an array of real numbers, NaN where masked, None where it is none; texts and truth values are none."""
    try:
        given = np.ma.asanyarray(value)
        return np.atleast_1d(given.astype(float).filled(np.nan)) if given.dtype.kind in "iufO" else None
    except (TypeError, ValueError, OverflowError):
        return None


def jumps_of(jumps: Any, names: Iterable[str], t0: float, until: float) -> Array:
    """(n,) ascending times in s at which inputs jump, from a sequence, or from sequences by the input's name.

    Raises
    ------
    OptionError
        They are not in order, not within the run, or of something that is no input.
    """
    known = list(names)
    if jumps is not None and isinstance(jumps, Mapping):
        for name in jumps:
            if name not in known:
                expected = f"inputs: {', '.join(known) or 'none is given'}{nearest_of(str(name), known)}"
                raise OptionError("jumps", name, expected)
        parts = [jumps_of(jumps[name], known, t0, until) for name in jumps]
        return np.unique(np.concatenate([np.zeros(0), *parts]))
    times = np.zeros(0) if jumps is None else numbers_of(jumps)
    first, last = min(t0, until), max(t0, until)
    if times is None or times.ndim != 1 or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0.0):
        raise OptionError("jumps", jumps, "ascending times in s")
    if times.size and not (first <= times[0] and times[-1] <= last):
        raise OptionError("jumps", jumps, f"times in [{first!r}, {last!r}] s")
    return times


def times_of(save_at: "ArrayLike | None", t0: float, until: float) -> Array | None:
    """The times to keep, None: every step.

    Raises
    ------
    OptionError
        They are not in order, or not within the run.
    """
    if save_at is None:
        return None
    times = numbers_of(save_at)
    forward = until > t0
    if (
        times is None
        or times.ndim != 1
        or not np.all(np.isfinite(times))
        or np.any(np.diff(times if forward else -times) <= 0.0)
    ):
        raise OptionError("save_at", save_at, "ascending times in s" if forward else "descending times in s")
    if times.size and not (min(t0, until) <= times.min() and times.max() <= max(t0, until)):
        raise OptionError("save_at", save_at, f"times in [{min(t0, until)!r}, {max(t0, until)!r}] s")
    return times


def check_mappings(**options: object) -> None:
    """Refuse options that are no mappings from names to values."""
    for key, found in options.items():
        if not isinstance(found, Mapping | None):
            raise OptionError(key, found, f"names with values, as in {key}={EXAMPLES[key]}")


def check_options(options: Mapping[str, object], known: Sequence[str]) -> None:
    """Refuse options that there are not."""
    for key in options:
        if key not in known:
            raise OptionError(key, options[key], f"no such option; there are {listed(key, known)}")


def asked_of(problem: Problem, inputs: Mapping[str, Any]) -> list[ProbedInput]:
    """The functions among the inputs that a user gave, by time and states of the problem as it is solved."""
    found: list[ProbedInput] = []
    for name, given in inputs.items():
        values = given.values() if isinstance(given, Mapping) else [given]
        found += [
            _asked(problem, str(name), value)
            for value in values
            if callable(value) and not isinstance(value, Held | MotionLaw)
        ]
    return found


def _asked(problem: Problem, name: str, function: Callable[..., Any]) -> ProbedInput:
    seconds, given = problem.seconds, problem.given
    if not takes_state(function):
        return ProbedInput(name, lambda t, _state: function(t * seconds), False)

    def value(t: float, state: State | None) -> Any:
        assert state is not None
        return function(t * seconds, problem.view(state if given is None else given(state)))

    return ProbedInput(name, value, True)


def takes_state(function: Callable[..., Any]) -> bool:
    """Whether it takes a second argument, required or named state."""
    import inspect

    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # functions in C have no signature; mathematical ones take one argument
        return False
    places = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    given = [p for p in parameters if p.kind in places and (p.default is p.empty or p.name == "state")]
    return len(given) >= 2 and not isinstance(function, np.ufunc)
