"""Entry functions of programs: a staged function, the kinds of its arguments, and the functions derived from it."""

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import wraps
from inspect import Parameter
from typing import Any, Final, cast, final

from ephs.semantics.stage.duals import Duals
from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.kinds import Kind, described, dual, kind_of, of_field, pointer, signature_of, taped
from ephs.semantics.stage.reaching import Atom, Signature
from ephs.semantics.stage.records import IntegerField, RealField
from ephs.semantics.stage.taped import SlopeTape, Taped
from ephs.semantics.stage.unrolled import Unrolled


@final
class Entry:
    """A function of a program, and the kinds of its arguments.

    Parameters
    ----------
    function
        A staged function. Its result is None, a real number, an integer or a condition.
    **kinds
        Its arguments after the evaluator, in order: `real()`, `integer()`, `vector()`, `indices()`, `matrix()`,
        `table(Record)`; but those whose annotations say their kind, see `ephs.semantics.stage.kind_of`.
    """

    def __init__(self, function: Callable[..., Any], **kinds: Kind | RealField | IntegerField) -> None:
        self.function = function
        names = list(inspect.signature(function).parameters)[1:]
        given = _completed(function, kinds)
        self.kinds = {name: given.pop(name) for name in names if name in given} | given
        if names != list(self.kinds):
            found = ", ".join(self.kinds) or "none"
            raise StageError("parameters", where=self.name, expected=", ".join(names) or "none", found=found)
        self.atoms: list[tuple[str, Atom]] = [(name, atom) for name, kind in self.kinds.items() for atom in kind.atoms]
        """The atoms of all arguments, each with the name of its argument."""

    @staticmethod
    def bundled(
        function: Callable[..., Any], kinds: Mapping[str, "Kind | Any"],
        *made: tuple[Iterable[str], Callable[..., Any]],
    ) -> "Entry":  # fmt: skip
        """Return an entry function with arguments of these kinds, some of which the function takes as one.

        Parameters
        ----------
        function
            Takes after the evaluator what is made of arguments, then the other arguments, in order; last those whose
            kinds its annotations say.
        *made
            Names of arguments, and what makes one thing of them.
        """
        kinds = _completed(function, kinds, 1 + len(made))
        names, bundles = tuple(kinds), tuple((tuple(names), make) for names, make in made)

        def run(on: Evaluator, *arguments: Any) -> Any:
            given = dict(zip(names, arguments, strict=True))
            parts = [make(*[given.pop(name) for name in taken]) for taken, make in bundles]
            return function(on, *parts, *given.values())

        return Entry(_taking(run, function.__qualname__, names), **kinds)

    @property
    def name(self) -> str:
        """The function's name, for errors."""
        return getattr(self.function, "__qualname__", repr(self.function))

    @property
    def made_of(self) -> object:
        """Function and kinds, which are all that an entry is."""
        return self.function, self.kinds

    def signature(self, *, returns: bool = True) -> Signature:
        """Return how this function is called by its address; `returns`: it returns an integer or a condition."""
        return signature_of(returns=returns, **self.kinds)

    def split(
        self, arguments: tuple[Any, ...], trail: Callable[[str], tuple[int | None, ...]], after: int = 0,
        count: int | None = None,
    ) -> list[Any]:  # fmt: skip
        """Return the atoms of arguments, checked.

        Parameters
        ----------
        arguments
            So many (default: all) after the first so many.
        trail
            Says what shape follows that of an argument's numbers.
        """
        kinds = list(self.kinds.items())[after : None if count is None else after + count]
        if len(arguments) != len(kinds):
            expected = f"{len(kinds)} arguments ({', '.join(name for name, _ in kinds)})"
            raise StageError("parameters", where=self.name, expected=expected, found=len(arguments))
        parts: list[Any] = []
        for (name, kind), value in zip(kinds, arguments, strict=True):
            found = kind.split(value, trail(name))
            if found is None:
                members = f", and {trail(name)} members after it" if trail(name) else ""
                raise StageError(
                    "argument",
                    where=self.name,
                    argument=name,
                    found=described(value),
                    expected=kind.expected + members,
                )
            parts += found
        return parts

    def run(self, on: Evaluator, parts: Iterator[Any]) -> Any:
        """Run the function with arguments made of cells and numbers."""
        return self.function(on, *[kind.join([next(parts) for _ in kind.atoms]) for kind in self.kinds.values()])

    def tangent(self, *active: str, directions: int = 1) -> "Entry":
        """Return this function with exact derivatives along directions.

        Parameters
        ----------
        *active
            The arguments that have derivatives, read or written, all where none is named; each is given as a pair: the
            argument, and an array of its slopes, of its shape, and the number of directions after it where there are
            several. Parts of a group are pairs each; integers have no slopes. A function that is called by its address
            is then to be the tangent of all its arguments, along as many directions.
        directions
            How many derivatives are computed at once.

        Raises
        ------
        StageError
            An argument is not there. Later: a number with a derivative is stored in memory that is not active.
        """
        self._known(active)
        chosen = active or tuple(self.kinds)

        @wraps(self.function)
        def run(on: Evaluator, *arguments: Any) -> Any:
            return self.function(Duals(on, directions), *arguments)

        return Entry(run, **{name: dual(kind, directions, name in chosen) for name, kind in self.kinds.items()})

    def taped(self) -> "Entry":
        """Return this function writing a tape from which a gradient is read, see `ephs.semantics.stage.gradients`.

        Arguments with real numbers are pairs: the argument, and an array of int64 of its shape, the row of each number
        on the tape, 0 for constants. Three more follow: the tape's counters, places and slopes. What it calls by
        address is to be taped, too.
        """

        def run(on: Evaluator, *arguments: Any) -> Any:
            *own, counters, places, slopes = arguments
            taping = Taped(on, SlopeTape(counters.cells, places.cells, slopes.cells))
            return self.function(taping, *[_resolved(argument, taping) for argument in own])

        kinds = {name: taped(kind) for name, kind in self.kinds.items()} | TAPE
        return Entry(_taking(run, self.name, kinds), **kinds)

    def given(self, **values: Any) -> "Entry":
        """Return this function for some arguments known while staging, unrolled over them.

        Loops whose bounds are known are unrolled, and what is known to be zero vanishes. Arrays that are given start
        with the numbers that they hold and live in registers: what the function writes to them is not seen outside.

        Parameters
        ----------
        **values
            The arguments that are given; a call does not take them.

        Raises
        ------
        StageError
            An argument is not there, or not of its kind.
        """
        self._known(tuple(values))
        parts: dict[str, tuple[Any, ...]] = {}
        for name, value in values.items():
            kind, found = self.kinds[name], self.kinds[name].split(value, ())
            if found is None:
                what = described(value)
                raise StageError("argument", where=self.name, argument=name, found=what, expected=kind.expected)
            parts[name] = found

        def run(on: Evaluator, *arguments: Any) -> Any:
            unrolled, others = Unrolled(on), iter(arguments)
            return self.function(
                unrolled,
                *[
                    kind.join([unrolled.as_cells(part) for part in parts[name]]) if name in parts else next(others)
                    for name, kind in self.kinds.items()
                ],
            )

        rest = {name: kind for name, kind in self.kinds.items() if name not in parts}
        return Entry(_taking(run, self.name, rest), **rest)

    def _known(self, names: tuple[str, ...]) -> None:
        if unknown := [name for name in names if name not in self.kinds]:
            raise StageError("unknown", where=self.name, found=", ".join(unknown), expected=", ".join(self.kinds))


def _completed(function: Callable[..., Any], kinds: Mapping[str, Any], known: int = 1) -> dict[str, Kind]:
    """Kinds, and then those that the annotations of a function's arguments say, but for the first so many."""
    found = {name: of_field(kind) for name, kind in kinds.items()}
    for name, parameter in list(inspect.signature(function).parameters.items())[known:]:
        if name not in found and (kind := kind_of(parameter.annotation)) is not None:
            found[name] = kind
    return found


def _taking(run: Callable[..., Any], name: str, names: Iterable[str]) -> Callable[..., Any]:
    """A function of any arguments, with a name and the names of its arguments."""
    run.__qualname__ = name
    parameters = [Parameter(each, Parameter.POSITIONAL_OR_KEYWORD) for each in ("on", *names)]
    run.__signature__ = inspect.Signature(parameters)  # pyright: ignore[reportFunctionMemberAccess]
    return run


def _resolved(argument: Any, on: Taped) -> Any:
    """An argument of a taped function; groups part by part."""
    if is_dataclass(argument) and not isinstance(argument, type) and not callable(argument):
        made = cast("Callable[..., Any]", type(argument))
        return made(**{field.name: _resolved(getattr(argument, field.name), on) for field in fields(argument)})
    return cast("Callable[[Taped], Any]", argument)(on)


TAPE: Final[dict[str, Kind]] = {
    "counters": pointer("integers"), "tape_places": pointer("integers"), "tape_slopes": pointer("reals"),
}  # fmt: skip
"""A tape, as taped functions take it behind their own arguments."""
