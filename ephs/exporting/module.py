"""The module of an exported mechanism: its functions with all tables in one text of LLVM.

The memory of one instance is one block: real numbers first, then integers. Four functions work on it, see `header`.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from ephs.exporting.errors import ExportError
from ephs.exporting.image import Image, ImageNumber
from ephs.semantics.stage import Program
from ephs.semantics.stage.calling import Bound
from ephs.semantics.stage.emission import hexadecimal
from ephs.semantics.stage.programs import located
from ephs.solve.march.records import Ending, MarchControl

_DEFINED: Final = re.compile(r"^define (?:internal )?(?:fastcc )?\S+ @([\w.]+)\(", re.MULTILINE)
_DECLARED: Final = re.compile(r"^declare .*$\n?", re.MULTILINE)
_ADDRESSES: Final = 2**32
"""Least integer of tables that is an address of a function: counts and indices are smaller."""


@final
@dataclass(frozen=True, slots=True)
class Exported:
    """A mechanism as a module.

    Attributes
    ----------
    text
        Assembly text of LLVM.
    bytes
        Size of the memory of one instance.
    functions
        Places in bytes of the addresses in it: what else it holds says the same in another process.
    """

    name: str
    text: str
    bytes: int
    inputs: tuple[ImageNumber, ...]
    outputs: tuple[ImageNumber, ...]
    parameters: tuple[ImageNumber, ...]
    accelerations: int
    functions: tuple[int, ...]

    def chosen(self, names: Sequence[str]) -> list[ImageNumber]:
        """The outputs of these names, or whose names begin so.

        Raises
        ------
        ExportError
            There is none of some name.
        """
        for name in names:
            if not any(_within(each.name, name) for each in self.outputs):
                raise ExportError("output", found=name, expected=", ".join(each.name for each in self.outputs))
        return [each for each in self.outputs if any(_within(each.name, name) for name in names)]

    def header(self) -> str:
        """Return declarations in C."""

        def table(kind: str, variables: tuple[ImageNumber, ...]) -> str:
            rows = "".join(
                f"\n * {k:4} {each.name}{each.unit and f' [{each.unit}]'}" for k, each in enumerate(variables)
            )
            return f"/* {kind}:{rows or ' none'}\n */"

        return _HEADER.format(
            guard=f"{self.name.upper()}_H", name=self.name, upper=self.name.upper(), bytes=self.bytes,
            n_inputs=len(self.inputs), n_outputs=len(self.outputs), n_accelerations=self.accelerations,
            n_parameters=len(self.parameters), parameters=table("Parameters", self.parameters),
            inputs=table("Inputs", self.inputs), outputs=table("Outputs", self.outputs), paused=int(Ending.PAUSED),
            careful=int(Ending.CAREFUL), short=int(Ending.SHORT), refused=int(Ending.REFUSED),
        )  # fmt: skip


def _within(name: str, beginning: str) -> bool:
    return name == beginning or name.startswith(f"{beginning}.")


def exported(image: Image, name: str) -> Exported:
    """Return the module of a run.

    Raises
    ------
    ExportError
        A component is evaluated by Python, or the name is none of C.
    """
    if not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
        raise ExportError("name", found=name)
    writer = _ModuleText(name)
    return writer.write(image)


@final
class _ModuleText:
    """The text under construction."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.programs: dict[Program, int] = {}
        self.texts: list[str] = []
        self.declared: dict[str, None] = {}
        self.at: dict[int, tuple[str, int]] = {}
        self.reals: list[np.ndarray[Any, Any]] = []
        self.integers: list[np.ndarray[Any, Any]] = []
        self.functions: list[tuple[str, int, str]] = []

    def symbol(self, program: Program, entry: str) -> str:
        """Return the name of an entry function in the module, its program written once."""
        if program not in self.programs:
            self.programs[program] = number = len(self.programs)
            text = program.text(blocks=False)
            for line in _DECLARED.findall(text):
                self.declared[line.strip()] = None
            text = _DECLARED.sub("", text)
            names = set(_DEFINED.findall(text))
            text = re.sub(r"@([\w.]+)", lambda m: f"@p{number}.{m[1]}" if m[1] in names else m[0], text)
            self.texts.append(re.sub(r"^define (?!internal)", "define internal ", text, flags=re.MULTILINE))
        return f"@p{self.programs[program]}.{program.name}_{entry}"

    def place(self, array: np.ndarray[Any, Any]) -> tuple[str, int]:
        """Return the kind of an array and the place of its first number; arrays keep their order."""
        if id(array) not in self.at:
            kind, held = ("i64", self.integers) if array.dtype == np.int64 else ("double", self.reals)
            first = sum(each.size for each in held)
            self.at[id(array)] = kind, first
            held.append(array)
            self._functions(array, kind, first)
        return self.at[id(array)]

    def _functions(self, array: np.ndarray[Any, Any], kind: str, first: int) -> None:
        for k, value in enumerate(array.ravel().tolist()):
            if not (_ADDRESSES <= value < 2**62 and float(value).is_integer()):
                continue
            found = located(int(value))
            if found is not None:
                self.functions.append((kind, first + k, self.symbol(*found)))
            elif kind == "i64":
                raise ExportError("python", where=self.name)

    def pointer(self, kind: str, place: int, lines: list[str]) -> str:
        """Write the address of a number in the memory; return its name."""
        offset = 8 * place + (0 if kind == "double" else 8 * self.base)
        found = f"%g{len(lines)}"
        lines.append(f"  {found} = getelementptr i8, ptr %memory, i64 {offset}")
        return found

    def call(self, bound: Bound, lines: list[str], own: dict[int, str], last: int | None = None) -> str:
        """Write a call with its arrays in the memory, or those of ``own`` by identity; return its result's name."""
        program, entry = located(bound.call.address) or (None, "")
        assert program is not None
        found: list[str] = []
        for part in bound.parts:
            if isinstance(part, np.ndarray):
                found.append(f"ptr {own.get(id(part)) or self.pointer(*self.place(part), lines)}")
            elif isinstance(part, float):
                found.append(f"double {hexadecimal(part)}")
            else:
                found.append(f"i64 {int(part)}")
        if last is not None:
            found[-1] = f"i64 {last}"
        name = f"%r{len(lines)}"
        lines.append(f"  {name} = call i64 {self.symbol(program, entry)}({', '.join(found)})")
        return name

    def write(self, image: Image) -> Exported:
        """Write the module."""
        for bound in (image.march, image.read, image.rates):
            for part in bound.parts:
                if isinstance(part, np.ndarray):
                    self.place(part)
            self.symbol(*(located(bound.call.address) or (None, "")))  # pyright: ignore[reportArgumentType]
        counts, numbers = image.control.arrays
        self.base = sum(each.size for each in self.reals)
        size = 8 * (self.base + sum(each.size for each in self.integers))
        functions = [
            self._start(size),
            self._advance(image, numbers, counts),
            self._outputs(image),
            self._inputs(image),
            self._parameters(image),
            self._accelerations(image),
            self._time(numbers),
        ]
        text = "\n".join([
            *self.declared, "declare void @llvm.memcpy.p0.p0.i64(ptr, ptr, i64, i1)", *self._data(), *self.texts,
            *functions,
        ])  # fmt: skip
        places = tuple(8 * (at if kind == "double" else self.base + at) for kind, at, _ in self.functions)
        return Exported(
            self.name, text, size, image.inputs, image.outputs, image.parameters, image.acceleration[2], places
        )

    def _data(self) -> list[str]:
        reals = np.concatenate([np.zeros(0), *(each.ravel() for each in self.reals)])
        integers = np.concatenate([np.zeros(0, dtype=np.int64), *(each.ravel() for each in self.integers)])
        for kind, at, _ in self.functions:
            (reals if kind == "double" else integers)[at] = 0
        real = ", ".join(f"double {hexadecimal(value)}" for value in reals.tolist())
        whole = ", ".join(f"i64 {value}" for value in integers.tolist())
        return [
            f"@reals = internal constant [{reals.size} x double] [{real}]",
            f"@integers = internal constant [{integers.size} x i64] [{whole}]",
        ]

    def _start(self, size: int) -> str:
        lines: list[str] = []
        for kind, at, symbol in self.functions:
            where = self.pointer(kind, at, lines)
            if kind == "double":
                lines.append(f"  %n{len(lines)} = uitofp i64 ptrtoint (ptr {symbol} to i64) to double")
                lines.append(f"  store double %n{len(lines) - 1}, ptr {where}")
            else:
                lines.append(f"  store i64 ptrtoint (ptr {symbol} to i64), ptr {where}")
        return "\n".join([
            f"define void @{self.name}_start(ptr %memory) {{",
            f"  call void @llvm.memcpy.p0.p0.i64(ptr %memory, ptr @reals, i64 {8 * self.base}, i1 false)",
            f"  %whole = getelementptr i8, ptr %memory, i64 {8 * self.base}",
            f"  call void @llvm.memcpy.p0.p0.i64(ptr %whole, ptr @integers, i64 {size - 8 * self.base}, i1 false)",
            *lines, "  ret void", "}",
        ])  # fmt: skip

    def _keep(self, array: np.ndarray[Any, Any], entry: int, value: str, lines: list[str]) -> None:
        """Write that a number of an array gets a value."""
        kind, first = self.place(array)
        lines.append(f"  store double {value}, ptr {self.pointer(kind, first + entry, lines)}")

    def _field(self, name: str, array: np.ndarray[Any, Any], lines: list[str]) -> str:
        kind, first = self.place(array)
        return self.pointer(kind, first + getattr(MarchControl, name).offset, lines)

    def _advance(self, image: Image, numbers: Any, counts: Any) -> str:
        lines: list[str] = []
        end, fresh, kept = (
            self._field("end", numbers, lines), self._field("fresh", counts, lines), self._field("rows", counts, lines)
        )  # fmt: skip
        lines += [f"  store double %until, ptr {end}", f"  store i64 0, ptr {fresh}", f"  store i64 0, ptr {kept}"]
        result = self.call(image.march, lines, {}, last=2**40)
        return _function("i64", f"{self.name}_advance", "ptr %memory, double %until", [*lines, f"  ret i64 {result}"])

    def _outputs(self, image: Image) -> str:
        lines: list[str] = []
        result = self.call(image.read, lines, {id(image.out): "%values"})
        return _function("i64", f"{self.name}_outputs", "ptr %memory, ptr %values", [*lines, f"  ret i64 {result}"])

    def _inputs(self, image: Image) -> str:
        lines: list[str] = []
        sums: dict[tuple[bool, int], list[tuple[str, float]]] = {}
        for k, each in enumerate(image.inputs):
            name = _read(k, lines)
            for word, limit in zip(("ogt", "olt"), each.limits, strict=True):
                if math.isfinite(limit):
                    bound = hexadecimal(limit)
                    lines.append(f"  {name}{word} = fcmp {word} double {name}, {bound}")
                    lines.append(f"  {name}.{word} = select i1 {name}{word}, double {name}, double {bound}")
                    name = f"{name}.{word}"
            for share in each.shares:
                sums.setdefault((share.supplied, share.place), []).append((name, share.ratio))
        for (supplied, place), terms in sums.items():
            array = image.supply if supplied else image.drive
            at = [(each.clipped(each.start), s) for each in image.inputs for s in each.shares]
            base = float(array[place]) - sum(
                s.ratio * value for value, s in at if (s.supplied, s.place) == (supplied, place)
            )
            total = hexadecimal(base)
            for name, ratio in terms:
                count = len(lines)
                lines.append(f"  %m{count} = fmul double {name}, {hexadecimal(ratio)}")
                lines.append(f"  %s{count} = fadd double {total}, %m{count}")
                total = f"%s{count}"
            self._keep(array, place, total, lines)
        return _function("void", f"{self.name}_inputs", "ptr %memory, ptr %values", [*lines, "  ret void"])

    def _parameters(self, image: Image) -> str:
        """Write the numbers that depend on parameters, by their polynomials in the changes %d0, %d1, …"""
        lines: list[str] = []
        for k, each in enumerate(image.parameters):
            lines.append(f"  %d{k} = fsub double {_read(k, lines)}, {hexadecimal(each.start)}")
        for each in image.dependences:
            total = hexadecimal(each.constant)
            for key, coefficient in each.terms.items():
                term = hexadecimal(coefficient)
                for k in key:
                    lines.append(f"  %m{len(lines)} = fmul double {term}, %d{k}")
                    term = f"%m{len(lines) - 1}"
                lines.append(f"  %a{len(lines)} = fadd double {total}, {term}")
                total = f"%a{len(lines) - 1}"
            if each.reciprocal:
                lines.append(f"  %a{len(lines)} = fdiv double {hexadecimal(1.0)}, {total}")
                total = f"%a{len(lines) - 1}"
            self._keep(image.numbers[each.array], each.entry, total, lines)
        return _function("void", f"{self.name}_parameters", "ptr %memory, ptr %values", [*lines, "  ret void"])

    def _accelerations(self, image: Image) -> str:
        lines: list[str] = []
        array, first, count = image.acceleration
        result = self.call(image.rates, lines, {})
        kind, at = self.place(array)
        where = self.pointer(kind, at + first, lines)
        lines.append(f"  call void @llvm.memcpy.p0.p0.i64(ptr %values, ptr {where}, i64 {8 * count}, i1 false)")
        arguments = "ptr %memory, ptr %values"
        return _function("i64", f"{self.name}_accelerations", arguments, [*lines, f"  ret i64 {result}"])

    def _time(self, numbers: Any) -> str:
        lines: list[str] = []
        where = self._field("time", numbers, lines)
        return _function(
            "double",
            f"{self.name}_time",
            "ptr %memory",
            [*lines, f"  %t = load double, ptr {where}", "  ret double %t"],
        )


def _read(place: int, lines: list[str]) -> str:
    """Write that one of the given values is read; return its name."""
    lines.append(f"  %i{place} = getelementptr double, ptr %values, i64 {place}")
    lines.append(f"  %x{place} = load double, ptr %i{place}")
    return f"%x{place}"


def _function(result: str, name: str, arguments: str, lines: list[str]) -> str:
    return "\n".join([f"define {result} @{name}({arguments}) {{", *lines, "}"])


_HEADER: Final = """\
#ifndef {guard}
#define {guard}
#include <stdint.h>
#ifdef __cplusplus
extern "C" {{
#endif
/* A mechanism that moves in memory of its caller: {upper}_BYTES bytes an instance, aligned to 8. Calls for several
 * instances are independent. Functions that return a number return 0 where all is well; else
 * {careful}: constraints nearly repeat each other; {short}: steps get too short; {refused} or more: a component
 * cannot be evaluated, or loops do not close. */
#define {upper}_BYTES {bytes}
#define {upper}_INPUTS {n_inputs}
#define {upper}_OUTPUTS {n_outputs}
#define {upper}_PARAMETERS {n_parameters}
#define {upper}_ACCELERATIONS {n_accelerations}
/* Begin at the initial state, at 0 s. */
void {name}_start(void *memory);
/* Give other values to the parameters: right after the start. */
void {name}_parameters(void *memory, const double *values);
/* Forces or torques, in N or N m, that act until they are given anew. */
void {name}_inputs(void *memory, const double *values);
/* Take steps until a time in s, with an error within the tolerances of the export. */
int64_t {name}_advance(void *memory, double until);
/* Time in s. */
double {name}_time(const void *memory);
/* Outputs at the state. */
int64_t {name}_outputs(void *memory, double *values);
/* Accelerations of the joints of the spanning tree at the state, in the order of the rates among the outputs. */
int64_t {name}_accelerations(void *memory, double *values);
{inputs}
{outputs}
{parameters}
#ifdef __cplusplus
}}
#endif
#endif
"""
