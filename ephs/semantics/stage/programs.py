"""Programs: entry functions under names, run with floats or arrays, or compiled together to machine code."""

from collections.abc import Callable, Mapping
from functools import cache
from threading import RLock
from types import MappingProxyType
from typing import Any, Final, cast, final

import numpy as np

from ephs.semantics.stage.arrays import ARRAYS, Batch, BatchCells
from ephs.semantics.stage.calling import Call, apart, packed
from ephs.semantics.stage.emission import FunctionWriter, IntegerPointer, RealPointer, Symbol, TruthSymbol, WholeSymbol
from ephs.semantics.stage.entries import Entry
from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.known import known
from ephs.semantics.stage.machine import Machine
from ephs.semantics.stage.memory import ArrayIntegers, ArrayReals
from ephs.semantics.stage.objects import HIGHEST, compiled
from ephs.semantics.stage.plain import PLAIN
from ephs.semantics.stage.reaching import Atom

_COMPILING: Final = RLock()
_PLACES: Final["dict[int, tuple[Program, str, Call]]"] = {}
"""Program, entry and call of each address of machine code; tables contain addresses only, so code lives as long as
the process."""


@final
class Program:
    """Entry functions that become one module of machine code.

    Parameters
    ----------
    name
        The program's name: functions of the object code are named `<name>_<entry>`.
    level
        Highest level of optimisation that pays, see `objects.level`.
    **entries
        The entry functions, each under its name.
    """

    def __init__(self, name: str, level: int = HIGHEST, /, **entries: Entry) -> None:
        if not entries or not name.isidentifier():
            raise StageError("entries", where=name, found=", ".join(entries) or "none")
        self.name, self.level, self.entries = name, level, MappingProxyType(entries)

    def tangent(self, directions: int = 1) -> "Program":
        """Return the program of all entry functions' tangents, see `Entry.tangent`."""
        return _tangent(self, directions)

    def taped(self) -> "Program":
        """Return the program of all entry functions that write a tape, see `Entry.taped`."""
        return _taped(self)

    def text(self, members: int = 1, shared: tuple[str, ...] = (), *, blocks: bool = True) -> str:
        """Return the program as assembly text of LLVM, with or without the functions on blocks of memory."""
        text, packed, _ = _staged(self, members, shared)
        return text + packed if blocks else text

    def header(self) -> str:
        """Return declarations in C of the entry functions in object code.

        Arrays are contiguous, row by row, of ``double`` and ``int64_t``, and must not overlap; their sizes follow them.
        A table is an array of its integers, one of its numbers, and the count of its rows; `Record` lays out a row.
        The object code keeps no state, so calls from several threads are independent, and needs no library but C's
        ``memset``, ``memcpy`` and ``memmove``.
        """
        *_, results = _staged(self, 1, ())
        lines = [f"{_C[results[name]]} {self.name}_{name}({_c(entry)});" for name, entry in self.entries.items()]
        return _HEADER.format(guard=f"{self.name.upper()}_H", lines="\n".join(lines))

    def compiled(self, members: int = 1, shared: tuple[str, ...] = ()) -> Mapping[str, Call]:
        """Return the entry functions in machine code, by name.

        Parameters
        ----------
        members
            Members that are computed side by side: 1, or 2, 4, 8. Arrays of real numbers then have an axis of members
            after their own, and real numbers are arrays of one for each member.
        shared
            Arguments that are the same for all members, without that axis.
        """
        with _COMPILING:  # code compiled twice by a second thread would be freed with its addresses
            return _compiled(self, members, shared)

    def plain(self) -> Mapping[str, Callable[..., Any]]:
        """Return the entry functions run with floats, by name: the same calls, the same results."""
        return MappingProxyType({name: _interpreted(entry, False) for name, entry in self.entries.items()})

    def arrays(self) -> Mapping[str, Callable[..., Any]]:
        """Return the entry functions run with arrays as numbers, by name.

        Each array of real numbers has an axis of members after its own, or is the same for all; likewise each real
        number may be an array of one for each member.
        """
        return MappingProxyType({name: _interpreted(entry, True) for name, entry in self.entries.items()})


def located(address: int) -> tuple[Program, str] | None:
    """Return the program and name of the entry function at an address, or None."""
    return found[:2] if (found := _PLACES.get(address)) is not None else None


_HEADER = """\
#ifndef {guard}
#define {guard}
#include <stdint.h>
#ifdef __cplusplus
#define restrict __restrict
extern "C" {{
#endif
{lines}
#ifdef __cplusplus
}}
#undef restrict
#endif
#endif
"""
_C = {"void": "void", "double": "double", "i64": "int64_t"}
_C_ATOMS: dict[Atom, str] = {
    "reals": "double *restrict ",
    "integers": "int64_t *restrict ",
    "real": "double ",
    "integer": "int64_t ",
}
_SIZES: dict[tuple[Atom, ...], tuple[str, ...]] = {
    ("reals", "integer"): ("", "_size"),
    ("integers", "integer"): ("", "_size"),
    ("reals", "integer", "integer"): ("", "_rows", "_columns"),
    ("integers", "reals", "integer"): ("_integers", "_reals", "_size"),
}
"""Endings of the names of an argument's parts, by its atoms."""


def _c(entry: Entry) -> str:
    """Return the parameters of an entry function in C."""
    out: list[str] = []
    for name, kind in entry.kinds.items():
        endings = _SIZES.get(kind.atoms) or ("", *(f"_{k}" for k in range(1, len(kind.atoms))))
        out += [f"{_C_ATOMS[atom]}{name}{ending}" for atom, ending in zip(kind.atoms, endings, strict=True)]
    return ", ".join(out) or "void"


def _interpreted(entry: Entry, members: bool) -> Callable[..., Any]:
    def run(*arguments: Any) -> Any:
        # An argument that fits without members is the same for all.
        wide = {
            name
            for (name, kind), value in zip(entry.kinds.items(), arguments, strict=False)
            if members and kind.split(value, ()) is None
        }
        parts = entry.split(arguments, lambda name: (None,) if name in wide else ())
        apart(entry, parts)
        made = [_made(atom, part, name in wide) for (name, atom), part in zip(entry.atoms, parts, strict=True)]
        with np.errstate(all="ignore"):
            result = entry.run(ARRAYS if members else PLAIN, iter(made))
        if result is None or isinstance(result, Batch):
            return result if result is None else result.values
        return float(result) if isinstance(result, float) else int(result)

    return run


def _made(atom: Atom, part: Any, wide: bool) -> Any:
    match atom:
        case "reals":
            return BatchCells(part.reshape(-1, part.shape[-1])) if wide else ArrayReals(part.reshape(-1))
        case "integers":
            return ArrayIntegers(part.reshape(-1))
        case "real":
            return Batch(part) if wide else np.float64(part)
        case "integer":
            return part


@cache
def _tangent(program: Program, directions: int) -> Program:
    made = {name: entry.tangent(directions=directions) for name, entry in program.entries.items()}
    return Program(f"{program.name}_along_{directions}", **made)


@cache
def _taped(program: Program) -> Program:
    taped = {name: entry.taped() for name, entry in program.entries.items()}
    return Program(f"{program.name}_taped", 0, **taped)


@cache
def _staged(program: Program, members: int, shared: tuple[str, ...]) -> tuple[str, str, dict[str, str]]:
    """Return the text of a program, that of its functions on blocks of memory, and the type of each entry's result."""
    of = (program.name, [(name, entry) for name, entry in program.entries.items()], members, shared)
    text, blocks, results = known(of, lambda: _emitted(program, members, shared))
    return text, blocks, results


def _emitted(program: Program, members: int, shared: tuple[str, ...]) -> tuple[str, str, dict[str, str]]:
    on = Machine(members)
    results: dict[str, str] = {}
    blocks: list[str] = []
    for name, entry in program.entries.items():
        parameters: list[tuple[str, Atom, bool]] = [
            (_parameter(atom, members > 1 and argument not in shared), atom, argument not in shared)
            for argument, atom in entry.atoms
        ]

        def body(
            to: FunctionWriter, entry: Entry = entry, parameters: list[tuple[str, Atom, bool]] = parameters
        ) -> object:
            made = (_symbol(to, atom, f"%a{k}", wide) for k, (_, atom, wide) in enumerate(parameters))
            return _result(on, entry, entry.run(on, made))

        texts = [f"{kind} %a{k}" for k, (kind, _, _) in enumerate(parameters)]
        with np.errstate(all="ignore"):
            results[name], _ = on.define(f"{program.name}_{name}", texts, body)
        blocks.append(packed(f"{program.name}_{name}", results[name], [kind for kind, _, _ in parameters]))
    return on.text, "\n\n".join(blocks) + "\n", results


@cache
def _compiled(program: Program, members: int, shared: tuple[str, ...]) -> Mapping[str, Call]:
    text, blocks, results = _staged(program, members, shared)
    library = compiled(text + blocks, program.name, program.level)

    def trail(name: str) -> tuple[int | None, ...]:
        return () if members == 1 or name in shared else (members,)

    calls = {
        name: Call(entry, library, f"{program.name}_{name}", results[name], trail)
        for name, entry in program.entries.items()
    }
    if members == 1:
        _PLACES.update({call.address: (program, name, call) for name, call in calls.items()})
    return MappingProxyType(calls)


def _parameter(atom: Atom, wide: bool) -> str:
    if atom == "integer":
        return "i64"
    return "double" if atom == "real" and not wide else "ptr noalias"


def _symbol(to: FunctionWriter, atom: Atom, name: str, wide: bool) -> Any:
    match atom:
        case "reals":
            return RealPointer(to, name, not wide)
        case "integers":
            return IntegerPointer(to, name)
        case "real":
            if to.width == 1:
                return Symbol(to, name)
            return RealPointer(to, name).load(0) if wide else Symbol(to, to.spread(name, "double"))
        case "integer":
            return WholeSymbol(to, name)


def _result(on: Machine, entry: Entry, result: object) -> object:
    """Return an entry's result as machine code hands it over."""
    if isinstance(result, bool | TruthSymbol):
        result = on.select(result, 1, 0)
    if isinstance(result, int):
        return WholeSymbol(on.to, str(result))
    if isinstance(result, float):
        result = Symbol(on.to, on.to.of_real(result))
    single = isinstance(result, Symbol) and on.width == 1
    if result is None or single or (isinstance(result, WholeSymbol) and not result.wide):
        return cast("object", result)
    raise StageError("result", where=entry.name, found=type(result).__name__)
