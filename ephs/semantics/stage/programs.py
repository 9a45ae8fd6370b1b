"""Programs: named entry functions with described arguments, callable on NumPy arrays."""

import ctypes
import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, wraps
from itertools import pairwise
from types import MappingProxyType
from typing import Any, Final, cast, final

import numpy as np

from ephs.semantics.stage.duals import Duals
from ephs.semantics.stage.emission import IntegerPointer, RealPointer, Symbol, TruthSymbol, WholeSymbol, Writer
from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.kinds import INTEGER, REAL, Atom, Kind, described, dual
from ephs.semantics.stage.llvm import Library, compile_text, load
from ephs.semantics.stage.machine import Machine
from ephs.semantics.stage.memory import ArrayIntegers, ArrayReals
from ephs.semantics.stage.plain import PLAIN
from ephs.semantics.stage.records import IntegerField, RealField

__all__ = ["Bound", "Call", "Entry", "Program"]

ATOMS: Final[Mapping[Atom, tuple[str, Any]]] = MappingProxyType(
    {
        "reals": ("ptr noalias", ctypes.c_void_p),
        "integers": ("ptr noalias", ctypes.c_void_p),
        "real": ("double", ctypes.c_double),
        "integer": ("i64", ctypes.c_int64),
    }
)


@final
class Entry:
    """A function of a program, and the kinds of its arguments.

    Parameters
    ----------
    function
        A staged function. Its result is None, a real number, an integer or a condition.
    **kinds
        Its arguments after the evaluator, in order: `real()`, `integer()`, `vector()`, `indices()`, `matrix()`,
        `table(Record)`.
    """

    def __init__(self, function: Callable[..., Any], **kinds: Kind | RealField | IntegerField) -> None:
        self.function = function
        self.kinds = {
            name: kind if isinstance(kind, Kind) else REAL if isinstance(kind, RealField) else INTEGER
            for name, kind in kinds.items()
        }
        names = list(inspect.signature(function).parameters)[1:]
        if names != list(kinds):
            raise StageError(
                "parameters", where=self.name, expected=", ".join(names) or "none", found=", ".join(kinds) or "none"
            )

    @property
    def name(self) -> str:
        """The function's name, for errors."""
        return getattr(self.function, "__qualname__", repr(self.function))

    @property
    def atoms(self) -> list[Atom]:
        """The atoms of all arguments."""
        return [atom for kind in self.kinds.values() for atom in kind.atoms]

    def split(self, arguments: tuple[Any, ...]) -> list[Any]:
        """Return the atoms of arguments, checked."""
        if len(arguments) != len(self.kinds):
            expected = f"{len(self.kinds)} arguments ({', '.join(self.kinds)})"
            raise StageError("parameters", where=self.name, expected=expected, found=len(arguments))
        parts: list[Any] = []
        for (name, kind), value in zip(self.kinds.items(), arguments, strict=True):
            found = kind.split(value)
            if found is None:
                raise StageError(
                    "argument", where=self.name, argument=name, found=described(value), expected=kind.expected
                )
            parts += found
        return parts

    def tangent(self, *active: str, directions: int = 1) -> "Entry":
        """Return this function with exact derivatives along directions.

        Parameters
        ----------
        *active
            The arguments that have derivatives, read or written; each is given as a pair: the argument, and an array
            of its slopes, of its shape, and the number of directions after it where there are several.
        directions
            How many derivatives are computed at once.

        Raises
        ------
        StageError
            An argument is not there. Later: a number with a derivative is stored in memory that is not active.
        """
        if unknown := [name for name in active if name not in self.kinds]:
            raise StageError("active", where=self.name, found=", ".join(unknown), expected=", ".join(self.kinds))

        @wraps(self.function)
        def run(on: Evaluator, *arguments: Any) -> Any:
            return self.function(Duals(on, directions), *arguments)

        kinds = {name: dual(kind, directions, name in active) for name, kind in self.kinds.items()}
        return Entry(run, **kinds)

    def run(self, on: Evaluator, parts: Iterator[Any]) -> Any:
        """Run the function with arguments made of cells and numbers."""
        return self.function(on, *[kind.join([next(parts) for _ in kind.atoms]) for kind in self.kinds.values()])


@final
@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """A compiled function with its arrays fetched once; call it with the numbers among its arguments, in order."""

    function: Callable[..., Any]
    passed: tuple[Any, ...]
    numbers: tuple[int, ...]
    owner: object

    def __call__(self, *numbers: float) -> Any:
        if not numbers:
            return self.function(*self.passed)
        passed = list(self.passed)
        for place, number in zip(self.numbers, numbers, strict=True):
            passed[place] = number
        return self.function(*passed)


@final
class Call:
    """An entry function in machine code; calls do not hold the interpreter's lock."""

    def __init__(self, entry: Entry, library: Library, symbol: str, result: Any) -> None:
        self.entry = entry
        self.address = library.address(symbol)
        self._library = library
        self._function = ctypes.CFUNCTYPE(result, *(ATOMS[atom][1] for atom in entry.atoms))(self.address)

    def bind(self, *arguments: Any) -> Bound:
        """Check arguments once; what comes back keeps their arrays alive and may be called again and again."""
        parts = self.entry.split(arguments)
        _apart(self.entry, parts)
        numbers: list[int] = []
        place = 0
        for kind in self.entry.kinds.values():
            if kind in (REAL, INTEGER):
                numbers.append(place)
            place += len(kind.atoms)
        return Bound(self._function, tuple(_passed(part) for part in parts), tuple(numbers), (self, parts))

    def __call__(self, *arguments: Any) -> Any:
        return self.bind(*arguments)()


def _passed(part: Any) -> Any:
    return part.__array_interface__["data"][0] if isinstance(part, np.ndarray) else part


def _apart(entry: Entry, parts: list[Any]) -> None:
    """Refuse arrays that share memory: programs are compiled as if none did."""
    spans: list[tuple[int, int, str]] = []
    atoms = iter(parts)
    for name, kind in entry.kinds.items():
        for array in [next(atoms) for _ in kind.atoms]:
            if isinstance(array, np.ndarray) and array.size:
                start = _passed(array)
                spans.append((start, start + array.nbytes, name))
    spans.sort()
    for (_, end, one), (start, _, other) in pairwise(spans):
        if start < end:
            raise StageError("overlap", where=entry.name, argument=one, other=other)


@final
class Program:
    """Entry functions that become one module of machine code.

    Parameters
    ----------
    name
        The program's name: functions of the object code are named `<name>_<entry>`.
    **entries
        The entry functions, each under its name.
    """

    def __init__(self, name: str, **entries: Entry) -> None:
        if not entries or not name.isidentifier():
            raise StageError("entries", where=name, found=", ".join(entries) or "none")
        self.name, self.entries = name, MappingProxyType(entries)

    @cached_property
    def _staged(self) -> tuple[str, dict[str, str]]:
        on = Machine()
        results: dict[str, str] = {}
        for name, entry in self.entries.items():
            names = [f"%a{place}" for place in range(len(entry.atoms))]
            parameters = [f"{ATOMS[atom][0]} {x}" for atom, x in zip(entry.atoms, names, strict=True)]

            def body(to: Writer, entry: Entry = entry, names: list[str] = names) -> object:
                makers = {"reals": RealPointer, "integers": IntegerPointer, "real": Symbol, "integer": WholeSymbol}
                parts = (makers[atom](to, x) for atom, x in zip(entry.atoms, names, strict=True))
                return _result(on, entry, entry.run(on, parts))

            results[name], _ = on.define(f"{self.name}_{name}", parameters, body)
        return on.text, results

    @property
    def text(self) -> str:
        """The program as assembly text of LLVM."""
        return self._staged[0]

    @cached_property
    def _compiled(self) -> Mapping[str, Call]:
        text, results = self._staged
        library = load(compile_text(text))
        types = {"void": None, "double": ctypes.c_double, "i64": ctypes.c_int64}
        return MappingProxyType(
            {
                name: Call(entry, library, f"{self.name}_{name}", types[results[name]])
                for name, entry in self.entries.items()
            }
        )

    def compiled(self) -> Mapping[str, Call]:
        """Return the entry functions in machine code, by name."""
        return self._compiled

    def plain(self) -> Mapping[str, Callable[..., Any]]:
        """Return the entry functions run with floats, by name: the same calls, the same results."""

        def made(entry: Entry) -> Callable[..., Any]:
            def run(*arguments: Any) -> Any:
                parts = entry.split(arguments)
                _apart(entry, parts)
                makers = {"reals": ArrayReals, "integers": ArrayIntegers, "real": np.float64, "integer": int}
                flat = (_cells(makers[atom], part) for atom, part in zip(entry.atoms, parts, strict=True))
                with np.errstate(all="ignore"):
                    result = entry.run(PLAIN, flat)
                return None if result is None else int(result) if _is_integer(result) else float(result)

            return run

        return MappingProxyType({name: made(entry) for name, entry in self.entries.items()})


def _cells(maker: Callable[[Any], Any], part: Any) -> Any:
    return maker(part.reshape(-1) if isinstance(part, np.ndarray) else part)


def _is_integer(result: Any) -> bool:
    return isinstance(result, bool | int | np.bool | np.integer)


def _result(on: Evaluator, entry: Entry, result: object) -> object:
    """Return an entry's result as machine code hands it over."""
    if isinstance(result, bool | TruthSymbol):
        result = on.select(result, 1, 0)
    if result is None or isinstance(result, Symbol | WholeSymbol):
        return result
    if isinstance(result, int | float):
        machine = cast("Machine", on)
        to = machine.to
        if isinstance(result, int):
            return WholeSymbol(to, str(result))
        return Symbol(to, to.of_real(result))
    raise StageError("result", where=entry.name, found=type(result).__name__)
