"""Formulas as data: expression trees of a closed list of operations, written from traces and evaluated without code.

A term is a number, the name of a scalar port, or a tuple of an operation's name and its arguments;
``("entry", "q", 3)`` is a number of the port q. In a document tuples are lists.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from operator import add, mul
from types import MappingProxyType
from typing import Any, TypeAlias, cast, final

import numpy as np

from ephs.operad.reading import Reader
from ephs.semantics.derive.recording import Recorded, Recording, Untraceable

Term: TypeAlias = "float | str | tuple[Any, ...]"
DEPTH, NODES = 50, 10_000
"""Limits on the depth of a term and on its numbers, names and operations."""


def rational_term(number: Fraction) -> Term:
    """The term of a rational number: a float, where one has its value, else a whole number or a quotient."""
    with suppress(OverflowError):
        if (found := float(number)) == number:
            return found
    p, q = number.numerator, number.denominator
    return p if q == 1 else ("/", p, q)


def _sum(*terms: Any) -> Any:
    return reduce(add, terms)


def _product(*factors: Any) -> Any:
    return reduce(mul, factors)


def _minus(first: Any, *second: Any) -> Any:
    return first - second[0] if second else -first


def _quotient(a: Any, b: Any) -> Any:
    return a / b


def _power(a: Any, b: Any) -> Any:
    return a**b


def _sign(a: Any) -> Any:
    return a.sign() if isinstance(a, Recorded) else np.sign(a)  # NumPy asks objects for no sign


OPERATIONS: Mapping[str, tuple[int, int, Callable[..., Any]]] = MappingProxyType(
    {
        "+": (1, NODES, _sum),
        "*": (1, NODES, _product),
        "-": (1, 2, _minus),
        "/": (2, 2, _quotient),
        "^": (2, 2, _power),
        "abs": (1, 1, np.absolute),
        "atan2": (2, 2, np.arctan2),
        "acos": (1, 1, np.arccos),
        "acosh": (1, 1, np.arccosh),
        "asin": (1, 1, np.arcsin),
        "asinh": (1, 1, np.arcsinh),
        "atan": (1, 1, np.arctan),
        "atanh": (1, 1, np.arctanh),
    }
    | {name: (1, 1, getattr(np, name)) for name in ("cos", "cosh", "exp", "log", "sin", "sinh", "sqrt", "tan", "tanh")}
    | {"sign": (1, 1, _sign)}
)
"""Least and largest number of arguments, and the function, of each operation but ``entry``."""


def _value(term: Term, x: Mapping[str, Any]) -> Any:
    if isinstance(term, str):
        return x[term]
    if not isinstance(term, tuple):
        return term
    word, *arguments = term
    if word == "entry":
        return x[arguments[0]][arguments[1]]
    return OPERATIONS[word][2](*(_value(each, x) for each in arguments))


@final
@dataclass(frozen=True, slots=True)
class WrittenFunction:
    """A function of numbers, arrays or symbols, by name: the value of a term.

    Parameters
    ----------
    name
        What the function is called.
    """

    term: Term
    name: str = "energy"

    @property
    def __name__(self) -> str:
        return self.name

    def __call__(self, **x: Any) -> Any:
        """The value."""
        return _value(self.term, x)


@final
@dataclass(frozen=True, slots=True)
class TermMatrix:
    """A matrix of terms as a function, with rows of equal length."""

    rows: tuple[tuple[Term, ...], ...]

    @property
    def numbers(self) -> bool:
        """Whether it is constant."""
        return all(isinstance(entry, float) for row in self.rows for entry in row)

    def __call__(self, **x: Any) -> list[list[Any]]:
        """The values."""
        return [[_value(entry, x) for entry in row] for row in self.rows]


@final
@dataclass(frozen=True, slots=True)
class StructureFunction:
    """L and C of a Dirac structure as one function; either may be absent."""

    skew: TermMatrix | None
    constraint: TermMatrix | None

    def __call__(self, **x: Any) -> tuple[list[list[Any]] | None, list[list[Any]] | None]:
        """The values."""
        return self.skew and self.skew(**x), self.constraint and self.constraint(**x)


def recorded(recording: Recording, inputs: Sequence[Term]) -> tuple[Term, ...]:
    """The terms of what a function recorded; those that are used several times are the same objects.

    Parameters
    ----------
    inputs
        Terms of the function's arguments, number by number.
    """
    return tuple(recording.tape.run(_RECORDED, float, list(inputs), list(recording.parameters)))


def _joined(word: str) -> Callable[..., Term]:
    """A sum or product, with that of its first terms in one."""

    def joined(a: Term, b: Term) -> Term:
        return (*a, b) if isinstance(a, tuple) and a[0] == word else (word, a, b)

    return joined


def _called(word: str) -> Callable[..., Term]:
    return lambda *arguments: (word, *arguments)


def _expm1(a: Term) -> Term:
    return ("-", ("exp", a), 1.0)


def _log1p(a: Term) -> Term:
    return ("log", ("+", 1.0, a))


_RECORDED: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {name: _called(name) for name in (*OPERATIONS, "sinhc", "turn_ratio", "turn_curve", "choose", "squared turn")}
    | {
        "turn_curve_slope": _called("turn_curve_slope"),
        "root": _called("root"),
        "+": _joined("+"),
        "*": _joined("*"),
        "negative": _called("-"),
        "absolute": _called("abs"),
        "power": _called("^"),
        "exponential": _called("^"),
        "expm1": _expm1,
        "log1p": _log1p,
    }
)
"""Operations of a tape as terms."""


def simple(term: Term) -> Term:
    """A term of a document: no deeper or larger than may be read back, of known operations.

    Raises
    ------
    Untraceable
        It is deeper or larger, or has a number that is not finite or an operation that documents do not know.
    """
    left = NODES

    def asked(entry: Term, depth: int) -> None:
        nonlocal left
        left -= 1
        if depth > DEPTH or left < 0:
            raise Untraceable(f"a formula of more than {DEPTH} levels or {NODES} numbers, names and operations")
        if isinstance(entry, float) and not math.isfinite(entry):
            raise Untraceable(f"the number {entry}")
        if isinstance(entry, tuple) and entry[0] != "entry":
            if entry[0] not in OPERATIONS:
                raise Untraceable(f"the function {entry[0]}")
            for argument in entry[1:]:
                asked(argument, depth + 1)

    asked(term, 1)
    return term


def record(term: Term) -> Any:
    """A term as part of a document."""
    if isinstance(term, tuple):
        word, *arguments = term
        return [word, *(record(argument) if word != "entry" else argument for argument in arguments)]
    return term


@final
@dataclass(slots=True)
class _Budget:
    """Remaining allowance of numbers, names and operations of a formula."""

    left: int


def term_from(reader: Reader, where: str, value: object, names: Mapping[str, int]) -> Term:
    """Read a term; the inverse of `record`.

    Parameters
    ----------
    names
        Name of each port that may occur -> how many numbers its value has.

    Raises
    ------
    PatternError
        What is no term, with its place, or one too deep or too large.
    """
    return _term(reader, where, value, names, _Budget(NODES), 1)


def _term(reader: Reader, where: str, value: object, names: Mapping[str, int], budget: _Budget, depth: int) -> Term:
    budget.left -= 1
    if depth > DEPTH or budget.left < 0:
        reader.refuse(where, "more", f"at most {DEPTH} levels, and {NODES} numbers, names and operations in a formula")
    if isinstance(value, str):
        if names.get(value) != 1:
            known = ", ".join(name for name, size in names.items() if size == 1) or "none"
            reader.refuse(where, value, f"the name of a port of one number: {known}")
        return value
    if not isinstance(value, list | tuple):
        return reader.finite(where, value)
    word, *arguments = reader.list(where, cast("object", value)) or [None]
    if word == "entry":
        return _entry(reader, where, arguments, names)
    known = OPERATIONS.get(word) if isinstance(word, str) else None
    if known is None:
        reader.refuse(f"{where}[0]", word, f"an operation: entry, {', '.join(sorted(OPERATIONS))}")
    assert isinstance(word, str)
    least, most, _ = known
    if not least <= len(arguments) <= most:
        reader.refuse(
            where, f"{len(arguments)} arguments of {word}", str(least) if least == most else f"{least} or more"
        )
    inner = (
        _term(reader, f"{where}[{i}]", argument, names, budget, depth + 1) for i, argument in enumerate(arguments, 1)
    )
    return (word, *inner)


def _entry(reader: Reader, where: str, arguments: list[object], names: Mapping[str, int]) -> Term:
    if len(arguments) != 2:
        reader.refuse(where, f"{len(arguments)} arguments of entry", "the name of a port, and a number from 0 on")
    name, number = reader.text(f"{where}[1]", arguments[0]), reader.whole(f"{where}[2]", arguments[1])
    size = names.get(name, 0)
    if size < 2:
        known = ", ".join(each for each, n in names.items() if n > 1) or "none"
        reader.refuse(f"{where}[1]", name, f"the name of a port of several numbers: {known}")
    if not 0 <= number < size:
        reader.refuse(f"{where}[2]", number, f"a whole number from 0 to {size - 1}")
    return ("entry", name, number)
