"""Staging to machine code: run with symbols, a function writes the LLVM function that it means."""

from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Final, cast, final

import numpy as np

from ephs.semantics.stage.elementary import COMPOSED
from ephs.semantics.stage.emission import (
    FunctionWriter,
    IntegerPointer,
    RealPointer,
    Symbol,
    TruthSymbol,
    WholeSymbol,
    operands,
)
from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.evaluator import Evaluator, Function, known
from ephs.semantics.stage.memory import Cells, IntegerCells, Integers, Matrix, RealCells, Variable, Vector
from ephs.semantics.stage.numbers import Integer, Real, StagedCondition, Truth
from ephs.semantics.stage.plain import elementary
from ephs.semantics.stage.reaching import Part, Reached
from ephs.semantics.stage.records import Record, Table

_INTRINSIC: Final[dict[Function, str]] = {
    "sqrt": "sqrt",
    "absolute": "fabs",
    "floor": "floor",
    "copysign": "copysign",
}


@final
@dataclass(frozen=True, slots=True)
class _Emitted:
    """A staged function of the module: its name and the form of its result."""

    name: str
    returns: str
    form: Any


class Machine(Evaluator):
    """The evaluator that writes a module of LLVM functions.

    Parameters
    ----------
    width
        Members side by side in a real number.
    """

    def __init__(self, width: int = 1) -> None:
        self.width = width
        self._functions: list[str] = []
        self._declared: dict[str, None] = {}
        self._emitted: dict[object, _Emitted | None] = {}
        self._tables: dict[str, str] = {}
        self._writers: list[FunctionWriter] = []

    @property
    def text(self) -> str:
        """The module's assembly text."""
        tables = [f"{name} = private unnamed_addr constant {text}" for text, name in self._tables.items()]
        return "\n\n".join([*tables, *self._declared, *self._functions]) + "\n"

    @property
    def to(self) -> FunctionWriter:
        """The function that is being written."""
        return self._writers[-1]

    @contextmanager
    def _writing(self, name: str) -> Generator[FunctionWriter]:
        writer = FunctionWriter(name, self.width)
        self._writers.append(writer)
        try:
            yield writer
        finally:
            self._writers.pop()

    def define(
        self, name: str, parameters: list[str], body: Callable[[FunctionWriter], object], linkage: str = ""
    ) -> tuple[str, Any]:
        """Write a function and return the type and the form of its result."""
        with self._writing(name) as to:
            result = body(to)
            leaves: list[tuple[str, str]] = []
            form = _flat(to, result, lambda kind, operand: leaves.append((kind, operand)))
            if not leaves:
                returns, last = "void", "ret void"
            elif len(leaves) == 1:
                (returns, operand), *_ = leaves
                last = f"ret {returns} {operand}"
            else:
                returns, value = f"{{ {', '.join(kind for kind, _ in leaves)} }}", "poison"
                for place, (kind, operand) in enumerate(leaves):
                    value = to.let(f"insertvalue {returns} {value}, {kind} {operand}, {place}")
                last = f"ret {returns} {value}"
            to.write(last)
            head = f"define {linkage}{returns} @{name}({', '.join(parameters)}) {{\nentry:"
            self._functions.append("\n".join([head, *to.slots, *to.lines, "}"]))
        return returns, form

    def declare(self, text: str) -> None:
        """Declare an external function."""
        self._declared[f"declare {text}"] = None

    # Functions of real numbers

    def _function(self, name: Function, *arguments: Real) -> Real:
        if known(*arguments):
            return elementary(name, *cast("tuple[float, ...]", arguments))
        if name in COMPOSED:
            return COMPOSED[name](self, *arguments)
        to, vector = self.to, "" if self.width == 1 else f"v{self.width}"
        called = f"@llvm.{_INTRINSIC[name]}.{vector}f64"
        self.declare(f"{to.real} {called}({', '.join([to.real] * len(arguments))})")
        operands = ", ".join(f"{to.real} {to.of_real(one)}" for one in arguments)
        return Symbol(to, to.let(f"call {to.real} {called}({operands})"))

    def real(self, integer: Integer) -> Real:
        if isinstance(integer, int):
            return np.float64(integer)
        to = self.to
        operand = to.of_integer(integer, wide=self.width > 1)
        return Symbol(to, to.let(f"sitofp {to.typed('i64')} {operand} to {to.real}"))

    def integer(self, real: Real) -> Integer:
        to = self.to
        vector = "" if self.width == 1 else f"v{self.width}"
        called = f"@llvm.fptosi.sat.{vector}i64.{vector}f64"
        self.declare(f"{to.typed('i64')} {called}({to.real})")
        return WholeSymbol(to, to.let(f"call {to.typed('i64')} {called}({to.real} {to.of_real(real)})"), self.width > 1)

    def scale(self, real: Real, power: Integer) -> Real:
        to = self.to
        kind, operand = to.typed("i64"), to.of_integer(power, wide=self.width > 1)
        biased = to.let(f"add {kind} {operand}, {to.of_integer(1023, wide=self.width > 1)}")
        shifted = to.let(f"shl {kind} {biased}, {to.of_integer(52, wide=self.width > 1)}")
        return real * Symbol(to, to.let(f"bitcast {kind} {shifted} to {to.real}"))

    # Conditions

    def _choose(self, truth: StagedCondition, one: Any, other: Any) -> Any:
        to, (chosen, wide) = self.to, self._truth(truth)

        def selected(kind: str, yes: str, no: str) -> str:
            return to.let(f"select {to.typed('i1', wide)} {chosen}, {kind} {yes}, {kind} {no}")

        if isinstance(one, bool | StagedCondition):
            kind, a, b, spread = self._truths(one, other, wide)
            return TruthSymbol(to, selected(kind, a, b), spread)
        if (
            isinstance(one, WholeSymbol)
            or isinstance(other, WholeSymbol)
            or (isinstance(one, int) and isinstance(other, int))
        ):
            _, kind, a, b, spread = operands(to, one, other, wide)
            return WholeSymbol(to, selected(kind, a, b), spread)
        return Symbol(to, selected(to.real, to.of_real(one), to.of_real(other)))

    def _truth(self, truth: object) -> tuple[str, bool]:
        assert isinstance(truth, TruthSymbol)
        self.to.own(truth.writer)
        return truth.name, truth.wide

    def _of_truth(self, truth: Truth, wide: bool) -> str:
        if isinstance(truth, TruthSymbol):
            name, spread = self._truth(truth)
            return name if spread or not wide else self.to.spread(name, "i1")
        text = "true" if truth else "false"
        return self.to.constant(text, "i1") if wide else text

    def _truths(self, one: Any, other: Any, wide: bool = False) -> tuple[str, str, str, bool]:
        """The type and the operands of two conditions, and whether there is one of each for each member."""
        wide = wide or any(isinstance(side, TruthSymbol) and side.wide for side in (one, other))
        return self.to.typed("i1", wide), self._of_truth(one, wide), self._of_truth(other, wide), wide

    def _both(self, one: Truth, other: Truth) -> Truth:
        kind, a, b, wide = self._truths(one, other)
        return TruthSymbol(self.to, self.to.let(f"and {kind} {a}, {b}"), wide)

    def _negate(self, truth: StagedCondition) -> Truth:
        kind, a, b, wide = self._truths(truth, True)
        return TruthSymbol(self.to, self.to.let(f"xor {kind} {a}, {b}"), wide)

    def _same(self, one: Integer, other: Integer) -> Truth:
        to, kind, a, b, wide = operands(self.to, one, other)
        return TruthSymbol(to, to.let(f"icmp eq {kind} {a}, {b}"), wide)

    def _single(self, truth: Truth, what: str) -> str:
        """Return the operand of a condition that is the same for all members."""
        if isinstance(truth, TruthSymbol) and truth.wide:
            raise StageError("undecided", what=what, found="for all members")
        return self._of_truth(truth, wide=False)

    # Control

    def loop(self, count: Integer, body: Callable[[Integer], None], start: Integer = 0, down: bool = False) -> None:
        to = self.to
        first, last = to.of_integer(start), to.of_integer(count)
        head, inner, out = to.label(), to.label(), to.label()
        before = to.block
        to.jump(head)
        to.begin(head)
        index, following = to.fresh(), to.fresh()
        to.write("")
        place = len(to.lines) - 1
        to.fork(to.let(f"icmp slt i64 {index}, {last}"), inner, out)
        to.begin(inner)
        if down:
            # start + count − 1 − index runs from count − 1 to start.
            ends = to.let(f"add i64 {first}, {last}")
            body(WholeSymbol(to, to.let(f"sub i64 {to.let(f'sub i64 {ends}, 1')}, {index}")))
        else:
            body(WholeSymbol(to, index))
        to.write(f"{following} = add nsw i64 {index}, 1")
        to.lines[place] = f"  {index} = phi i64 [ {first}, %{before} ], [ {following}, %{to.block} ]"
        to.jump(head)
        to.begin(out)

    def when(self, truth: Truth, yes: Callable[[], None], no: Callable[[], None] | None = None) -> None:
        if not isinstance(truth, StagedCondition):
            if truth:
                yes()
            elif no is not None:
                no()
            return
        to = self.to
        one, other, out = to.label(), to.label(), to.label()
        to.fork(self._single(truth, "on.when"), one, out if no is None else other)
        to.begin(one)
        yes()
        to.jump(out)
        if no is not None:
            to.begin(other)
            no()
            to.jump(out)
        to.begin(out)

    def repeat(self, body: Callable[[], Truth]) -> None:
        to = self.to
        inner, out = to.label(), to.label()
        to.jump(inner)
        to.begin(inner)
        truth = body()
        to.fork(self._single(truth, "on.repeat"), out, inner)
        to.begin(out)

    def _reals(self, size: int) -> RealCells:
        return RealPointer(self.to, self.to.slot(f"[{size} x {self.to.real}]"))

    def _wholes(self, size: int) -> IntegerCells:
        return IntegerPointer(self.to, self.to.slot(f"[{size} x i64]"))

    def _constants(self, values: list[Any], whole: bool) -> Cells[Any]:
        to, kind = self.to, "i64" if whole else "double"
        texts = ", ".join(f"{kind} {to.of_constant(value, whole)}" for value in values)
        text = f"[{len(values)} x {kind}] [{texts}]"
        name = self._tables.setdefault(text, f"@table.{len(self._tables)}")
        return IntegerPointer(to, name) if whole else RealPointer(to, name, shared=True)

    def _rehearse(self, body: Callable[[], None]) -> None:
        place, functions = self.to.copy(), len(self._functions)
        known = dict(self._declared), dict(self._tables), dict(self._emitted)
        body()
        self.to.restore(place)
        del self._functions[functions:]
        self._declared, self._tables, self._emitted = known

    # Functions of their own

    def _call(self, on: Evaluator, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        to = self.to
        passed: list[tuple[str, str]] = []
        form = _flat(to, arguments, lambda kind, operand: passed.append((kind, operand)))
        key = (function, on, form, tuple(kind for kind, _ in passed))
        emitted = self._emitted.get(key)
        if emitted is None:
            if key in self._emitted:
                raise StageError("recursion", found=function.__qualname__)
            self._emitted[key] = None
            emitted = self._emitted[key] = self._emit(on, function, form, [kind for kind, _ in passed])
        operands = ", ".join(f"{kind} {operand}" for kind, operand in passed)
        call = f"call fastcc {emitted.returns} @{emitted.name}({operands})"
        if emitted.returns == "void":
            to.write(call)
            return _shaped(to, emitted.form, iter(()))
        value = to.let(call)
        if not emitted.returns.startswith("{"):
            return _shaped(to, emitted.form, iter((value,)))
        return _shaped(to, emitted.form, (to.let(f"extractvalue {emitted.returns} {value}, {k}") for k in range(10**9)))

    def _reach(self, function: Reached, parts: list[Part]) -> Integer:
        to = self.to
        if self.width > 1:
            raise StageError("unreached", what="several members")
        operands: list[str] = []
        for atom, value in parts:
            if atom == "real":
                operands.append(f"double {to.of_real(value)}")
            elif atom == "integer":
                operands.append(f"i64 {to.of_integer(value)}")
            else:
                cells, start = value
                if not isinstance(cells, RealPointer | IntegerPointer):
                    raise StageError("unreached", what=type(cells).__name__)
                to.own(cells.writer)
                operands.append(f"ptr {to.let(f'getelementptr i64, ptr {cells.name}, i64 {to.of_integer(start)}')}")
        pointer = to.let(f"inttoptr i64 {to.of_integer(function.address)} to ptr")
        if function.signature.returns:
            return WholeSymbol(to, to.let(f"call i64 {pointer}({', '.join(operands)})"))
        to.write(f"call void {pointer}({', '.join(operands)})")
        return 0

    def _emit(self, on: Evaluator, function: Callable[..., Any], form: Any, kinds: list[str]) -> _Emitted:
        name = f"{function.__name__}.{len(self._emitted)}"
        names = [f"%a{place}" for place in range(len(kinds))]

        def body(to: FunctionWriter) -> object:
            return function(on, *_shaped(to, form, iter(names)))

        parameters = [f"{kind} {name}" for kind, name in zip(kinds, names, strict=True)]
        returns, form = self.define(name, parameters, body, "internal fastcc ")
        return _Emitted(name, returns, form)


_PASSED: Final[dict[type, str]] = {Vector: "start", Integers: "start", Matrix: "start", Table: "size"}
"""Integers that are handed over also where they are known: one function then serves all windows of memory."""


def _counted(to: FunctionWriter, value: Integer, leaf: Callable[[str, str], None]) -> Any:
    """Hand over an integer, known or not."""
    if isinstance(value, int):
        leaf("i64", to.of_integer(value))
        return (WholeSymbol, False)
    return _flat(to, value, leaf)


def _flat(to: FunctionWriter, value: Any, leaf: Callable[[str, str], None]) -> Any:
    """Hand over the operands in a value, and return its form: a hashable picture with holes for them."""
    match value:
        case Symbol():
            leaf(to.real, to.of_real(value))
            return (Symbol,)
        case WholeSymbol():
            leaf(to.typed("i64", value.wide), to.of_integer(value))
            return (WholeSymbol, value.wide)
        case TruthSymbol():
            to.own(value.writer)
            leaf(to.typed("i1", value.wide), value.name)
            return (TruthSymbol, value.wide)
        case RealPointer() | IntegerPointer():
            to.own(value.writer)
            leaf("ptr", value.name)
            return (type(value), value.shared) if isinstance(value, RealPointer) else (IntegerPointer,)
        case list() | tuple():
            entries = cast("list[Any]", value)
            return (list if isinstance(value, list) else tuple, *(_flat(to, entry, leaf) for entry in entries))
        case Variable():
            return (Variable, _flat(to, cast("Variable[Any]", value).cells, leaf))
        case Record():
            parts = (value.integers, value.integer_start, value.reals, value.real_start)
            return (Record, type(value), *(_flat(to, part, leaf) for part in parts))
        case _ if is_dataclass(value) and not isinstance(value, type):
            parts = {field.name: getattr(value, field.name) for field in fields(value)}
            passed = _PASSED.get(type(value))
            forms = [_counted(to, x, leaf) if name == passed else _flat(to, x, leaf) for name, x in parts.items()]
            return (is_dataclass, type(value), *forms)
        case float():
            return (float, type(value), float(value).hex())
        case _:
            return (None, type(value), value)


def _shaped(to: FunctionWriter, form: Any, leaves: Iterator[str]) -> Any:
    """Return the value of a form, its holes filled."""
    kind, *rest = form
    if kind is Symbol:
        return Symbol(to, next(leaves))
    if kind is WholeSymbol or kind is TruthSymbol:
        return kind(to, next(leaves), rest[0])
    if kind is RealPointer or kind is IntegerPointer:
        return kind(to, next(leaves), *rest)
    if kind is list or kind is tuple:
        parts: list[Any] = [_shaped(to, part, leaves) for part in rest]
        return parts if kind is list else tuple(parts)
    if kind is Variable:
        return Variable[Any](_shaped(to, rest[0], leaves))
    if kind is Record or kind is is_dataclass:
        return rest[0](*[_shaped(to, part, leaves) for part in rest[1:]])
    return rest[0](float.fromhex(rest[1])) if kind is float else rest[1]
