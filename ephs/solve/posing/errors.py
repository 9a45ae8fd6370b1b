"""Failures of a run: named outcomes with time, component, equation, advice, and the partial solution."""

from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from enum import StrEnum
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import nearest_of as nearest_of

if TYPE_CHECKING:
    from ephs.solve.equations.model import Model
    from ephs.solve.result.solution import Solution

__all__ = [
    "LARGEST",
    "Interrupted",
    "OptionError",
    "Other",
    "Outcome",
    "SimulationError",
    "SolveError",
    "count_of",
    "failing_at",
    "nearest_of",
    "number_of",
    "or_take",
    "serves_not",
    "solve_error_of",
    "worst_entry",
]


class Outcome(StrEnum):
    """Cause that ended a run, in words, with its remedy."""

    advice: str
    """Advice for the user."""

    def __new__(cls, value: str, advice: str) -> "Outcome":
        """An outcome whose value is the cause."""
        made = str.__new__(cls, value)
        made._value_, made.advice = value, advice
        return made

    DIVERGED = "the equations of the step have no solution near the state", "take a smaller step"
    SINGULAR = "the equations of the step are singular", "take a smaller step, or start elsewhere"
    CONTRADICTION = (
        "a constraint contradicts the others",
        "check prescribed motions and initial values, or take a smaller step",
    )
    OPEN = (
        "a loop that cannot be closed near the state",
        "take a smaller step, or check prescribed motions: the mechanism may be at the end of its travel",
    )
    SHAKY = (
        "a mechanism that is movable to first order only",
        "change its geometry or add springs: rigid joints transmit no force across their line",
    )
    TURN = "a rotation of π or more in one step", "take a smaller step: h·|ω| must stay below π"
    TEMPERATURE = (
        "an absolute temperature that is not positive",
        "check initial temperatures and heat capacities, or take a smaller step",
    )
    ENTROPY = (
        "a component that destroys entropy",
        "correct the component's function; if it is right, take a smaller step",
    )
    LAWLESS = (
        "a step in which a component loses entropy",
        "take a smaller step, as its damping may be stiff; if that is refused too, correct the component",
    )
    EXTENT = "a length or a volume that is not positive", "check initial values, or take a smaller step"
    DOMAIN = (
        "an energy or a flow that is not a finite number",
        "check initial values and the component's function there, or take a smaller step",
    )
    DEPTH = (
        "surfaces that overlap so deeply that their contact has no direction",
        "give the contact more stiffness, use thicker shapes, or start with the surfaces apart",
    )
    RANGE = "a state beyond the range of numbers", "check initial values and inputs, or take a smaller step"
    PYTHON = "a Python function of the model raised an exception", "see the exception above this one"
    INCONSISTENT = (
        "an initial state that contradicts the constraints",
        "give initial values that satisfy the constraints",
    )
    TINY = (
        "a step below the smallest allowed one",
        "loosen rtol and atol, lower min_step, or look for a singularity at this time",
    )
    MANY = "more steps than are allowed", "raise max_steps, or loosen rtol and atol"
    UNDETERMINED = "the motion is not determined", "add a storage, friction or a constraint there, which determines it"
    RESTLESS = (
        "no state found in which nothing moves",
        "start nearer to one, or add a spring, a stop of the drive or an environment",
    )
    INPUT = (
        "an input's function has no value",
        "see the exception above this one, or return as many finite numbers as expected",
    )
    EVENT = (
        "an event's function has no value",
        "see the exception above this one, or give a function that returns a number everywhere",
    )
    UNWRITTEN = "the journal cannot be written", "free space on the disk, then resume the run with the same journal"
    PROGRESS = "the progress function raised an exception", "see the exception above this one"
    UNLAWFUL = (
        "the result does not pass its audit",
        'the whole solution is in .partial; audit="warn" returns it with a warning',
    )
    MEMORY = "not enough memory", "keep fewer times with save_at, or take longer steps"
    INTERRUPTED = "interrupted", "the solution up to there is in .partial"


Other = tuple[str, str]
"""Another method by its name, and what it does."""
_OTHERS: Mapping[Outcome, Other] = {
    Outcome.SINGULAR: ("natural", "omits redundant equations"),
    Outcome.LAWLESS: ("radau", "takes long steps where damping is stiff"),
    Outcome.TINY: ("radau", "damps fast modes"),
}
LARGEST = 1e150
"""Bound of states: squares of larger ones overflow."""
_OF_KERNEL = {1: Outcome.TURN, 2: Outcome.TEMPERATURE, 3: Outcome.PYTHON, 4: Outcome.EXTENT, 5: Outcome.DOMAIN}


def serves_not(_name: str) -> bool:
    """No other method is known to accept the problem."""
    return False


def or_take(other: Other | None, serves: Callable[[str], bool]) -> str:
    """End of an advice that names another method, where that one accepts the problem; else nothing."""
    return f", or take {other[0]}, which {other[1]}" if other is not None and serves(other[0]) else ""


def worst_entry(values: Array) -> int:
    """Number of the largest entry, or of the first that is no number."""
    return int(np.argmax(np.nan_to_num(values, nan=np.inf)))


@final
class OptionError(ValueError):
    """An invalid option of a run: name, value found, values expected."""

    def __init__(self, key: str, found: object, expected: str) -> None:
        super().__init__(f"{key} is {found!r}, expected {expected}")
        self.key, self.found, self.expected = key, found, expected

    def __reduce__(self) -> tuple[object, ...]:
        return (OptionError, (self.key, self.found, self.expected))


def no_model(found: object) -> OptionError:
    """Refusal of what is neither a scene nor a system."""
    return OptionError("model", found, "a Scene, as ephs.load makes it of a file, or a System")


def number_of(key: str, given: object, expected: str = "a number of seconds") -> float:
    """The number of the option ``key``; texts and truth values are none.

    Raises
    ------
    OptionError
        It is none.
    """
    if isinstance(given, str | bytes | bool | np.bool_):
        raise OptionError(key, given, expected)
    try:
        return float(given)  # pyright: ignore[reportArgumentType] - this is what is tried
    except (TypeError, ValueError, OverflowError):
        raise OptionError(key, given, expected) from None


def count_of(key: str, given: object) -> int:
    """The whole number above 0 of the option ``key``; 1e6 is one.

    Raises
    ------
    OptionError
        It is none.
    """
    expected = "a whole number > 0"
    number = number_of(key, given, expected)
    if not (number > 0.0 and number.is_integer()):
        raise OptionError(key, given, expected)
    return int(number)


class SimulationError(RuntimeError):
    """A failed run.

    Attributes
    ----------
    outcome, time, path, equation, advice
        Cause, time in s, component, equation, and advice.
    partial
        The Solution up to the failure, or None if it happened before the first step.

    Parameters
    ----------
    serves
        Whether a method by its name is another one than that of the run, and accepts the problem.
    hint
        What else the advice is to say.
    """

    def __init__(
        self,
        outcome: Outcome,
        time: float,
        path: str,
        equation: str,
        partial: "Solution | None",
        serves: Callable[[str], bool] = serves_not,
        hint: str = "",
    ) -> None:
        self.outcome, self.time, self.path, self.equation = outcome, time, path, equation
        self.advice = outcome.advice + hint + or_take(_OTHERS.get(outcome), serves)
        self.partial = partial
        where = f" at {path}" if path else ""
        what = f" ({equation})" if equation else ""
        super().__init__(f"t = {time:.9g} s{where}: {outcome.value}{what}; {self.advice}")


@final
class Interrupted(SimulationError):
    """A run that the user stopped."""


@final
class SolveError(Exception):
    """A failed step inside the solver, before time and partial solution are known."""

    def __init__(self, outcome: Outcome, path: str, equation: str, cause: BaseException | None = None) -> None:
        super().__init__(outcome.value, path, equation)
        self.outcome, self.path, self.equation, self.cause = outcome, path, equation, cause

    @classmethod
    def of_component(cls, status: int, model: "Model", component: int) -> "SolveError":
        """Outcome by the status of a component's kernel."""
        callback = model.callbacks.get(component)
        cause = callback.raised if callback else None
        outcome = _OF_KERNEL.get(status % 10, Outcome.DIVERGED)
        if outcome is Outcome.PYTHON and isinstance(cause, KeyboardInterrupt):
            outcome = Outcome.INTERRUPTED
        told = f"{type(cause).__name__}: {cause}" if outcome is Outcome.PYTHON and cause is not None else ""
        depth = model.depth_of(component)
        if outcome is Outcome.DOMAIN and depth < np.inf:
            outcome, told = Outcome.DEPTH, f"by more than {depth:.3g} m"
        return cls(outcome, str(model.path_of(component)), told, cause)

    def of_iteration(self) -> "SolveError":
        """The same for an iteration outside a domain that the motion does not leave."""
        return SolveError(Outcome.DIVERGED, self.path, f"its iteration reaches {self.outcome.value}", self.cause)

    @classmethod
    def undetermined(cls, model: "Model", unknown: int) -> "SolveError":
        """An unknown without equation."""
        return cls(Outcome.UNDETERMINED, model.row_path(unknown), model.unknown_name(unknown))


def solve_error_of(error: Exception) -> SolveError:
    """Arithmetic errors of a step: NumPy's and Python's own exceptions by the names of outcomes."""
    if isinstance(error, SolveError):
        return error
    outcome = Outcome.RANGE if isinstance(error, ArithmeticError) else Outcome.SINGULAR
    return SolveError(outcome, "", str(error), error)


@contextmanager
def failing_at(t: float) -> Generator[None, None, None]:
    """A failure inside the solver at a time t in s as an error for users, without a partial solution."""
    try:
        yield
    except (SolveError, ArithmeticError, np.linalg.LinAlgError) as raised:
        error = solve_error_of(raised)
        raise SimulationError(error.outcome, t, error.path, error.equation, None) from error.cause
