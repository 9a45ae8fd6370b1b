"""Numbers and memory that write LLVM's assembly text while a staged function runs.

Arithmetic carries no flags, so that LLVM neither contracts nor reorders it.
"""

import struct
from dataclasses import dataclass
from typing import Final, final

from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.memory import IntegerCells, RealCells
from ephs.semantics.stage.numbers import (
    Count,
    Integer,
    IntegerOperation,
    Number,
    Operation,
    Order,
    Real,
    StagedCondition,
    Truth,
)

LIMIT: Final = 300_000
"""Lines above which a function counts as traced without end; LLVM takes a minute for as many."""
_REAL: Final[dict[Operation, str]] = {"+": "fadd", "-": "fsub", "*": "fmul", "/": "fdiv"}
_ORDER: Final[dict[Order, str]] = {"<": "lt", "<=": "le", ">": "gt", ">=": "ge"}
_WHOLE: Final[dict[IntegerOperation, str]] = {"+": "add", "-": "sub", "*": "mul"}


@final
class FunctionWriter:
    """The text of one LLVM function while it is written.

    Parameters
    ----------
    name
        Its name, for errors.
    width
        Members side by side in a real number: 1, or 2, 4, 8 for vectors.
    """

    def __init__(self, name: str, width: int = 1) -> None:
        self.name, self.width = name, width
        self.lines: list[str] = []
        self.slots: list[str] = []
        self.block = "entry"
        self._count = 0

    @property
    def real(self) -> str:
        """The type of a real number."""
        return self.typed("double")

    def typed(self, scalar: str, wide: bool = True) -> str:
        """Return the type of so many numbers of a scalar type as there are members; of one where it is not wide."""
        return f"<{self.width} x {scalar}>" if wide and self.width > 1 else scalar

    def fresh(self) -> str:
        """Return a name that was not used yet."""
        self._count += 1
        return f"%v{self._count}"

    def let(self, text: str) -> str:
        """Write an instruction and return the name of its result."""
        name = self.fresh()
        self.write(f"{name} = {text}")
        return name

    def write(self, text: str) -> None:
        """Write an instruction."""
        if len(self.lines) >= LIMIT:
            raise StageError("endless", limit=LIMIT)
        self.lines.append(f"  {text}")

    def slot(self, kind: str) -> str:
        """Return the address of a variable of the function."""
        name = self.fresh()
        self.slots.append(f"  {name} = alloca {kind}")
        return name

    def label(self) -> str:
        """Return a name for a block."""
        return self.fresh()[1:]

    def jump(self, label: str) -> None:
        """Branch to a block."""
        self.write(f"br label %{label}")

    def fork(self, condition: str, yes: str, no: str) -> None:
        """Branch to one of two blocks."""
        self.write(f"br i1 {condition}, label %{yes}, label %{no}")

    def begin(self, label: str) -> None:
        """Begin a block."""
        self.lines.append(f"{label}:")
        self.block = label

    def copy(self) -> tuple[int, int, str]:
        """Return where the text is now."""
        return len(self.lines), len(self.slots), self.block

    def restore(self, place: tuple[int, int, str]) -> None:
        """Discard the text written since."""
        lines, slots, self.block = place
        del self.lines[lines:], self.slots[slots:]

    def own(self, writer: "FunctionWriter") -> None:
        """Refuse numbers of another function."""
        if writer is not self:
            raise StageError("stranger", found=writer.name, expected=self.name)

    def of_real(self, value: Real) -> str:
        """Return the operand of a real number."""
        if isinstance(value, Symbol):
            self.own(value.writer)
            return value.name
        return self.constant(hexadecimal(_plain(value)), "double")

    def of_constant(self, value: float, whole: bool) -> str:
        """Return the operand of one known number, whatever the number of members."""
        return str(_whole(int(value))) if whole else hexadecimal(float(value))

    def of_integer(self, value: Integer, wide: bool = False) -> str:
        """Return the operand of an integer, one for each member where `wide`."""
        if isinstance(value, WholeSymbol):
            self.own(value.writer)
            if wide and not value.wide:
                return self.spread(value.name, "i64")
            return value.name
        return self.constant(str(_whole(value)), "i64") if wide else str(_whole(value))

    def constant(self, text: str, scalar: str) -> str:
        """Return a constant operand, the same for each member."""
        return text if self.width == 1 else f"<{', '.join([f'{scalar} {text}'] * self.width)}>"

    def spread(self, name: str, scalar: str) -> str:
        """Return a vector with a number in all members."""
        if self.width == 1:
            return name
        kind = self.typed(scalar)
        first = self.let(f"insertelement {kind} poison, {scalar} {name}, i64 0")
        return self.let(f"shufflevector {kind} {first}, {kind} poison, <{self.width} x i32> zeroinitializer")


def _plain(value: Real) -> float:
    if isinstance(value, Number):
        raise StageError("operand", what="machine code", left=type(value).__name__, right="Symbol")
    return float(value)


def _whole(value: Integer) -> int:
    if isinstance(value, Count):
        raise StageError("operand", what="machine code", left=type(value).__name__, right="WholeSymbol")
    return int(value)


def hexadecimal(value: float) -> str:
    """Return the operand of a known real number."""
    return "0x" + struct.pack(">d", value).hex().upper()


@final
@dataclass(frozen=True, slots=True, eq=False)
class Symbol(Number):
    """A real number in machine code, or one for each member."""

    writer: FunctionWriter
    name: str

    def _apply(self, operation: Operation, left: Real, right: Real) -> Real:
        to = self.writer
        a, b = to.of_real(left), to.of_real(right)
        return Symbol(to, to.let(f"{_REAL[operation]} {to.real} {a}, {b}"))

    def _order(self, order: Order, left: Real, right: Real) -> Truth:
        to = self.writer
        a, b = to.of_real(left), to.of_real(right)
        return TruthSymbol(to, to.let(f"fcmp o{_ORDER[order]} {to.real} {a}, {b}"), to.width > 1)

    def _negative(self) -> Real:
        to = self.writer
        return Symbol(to, to.let(f"fneg {to.real} {to.of_real(self)}"))


@final
@dataclass(frozen=True, slots=True, eq=False)
class WholeSymbol(Count):
    """An integer in machine code; `wide`: one for each member."""

    writer: FunctionWriter
    name: str
    wide: bool = False

    def _apply(self, operation: IntegerOperation, left: Integer, right: Integer) -> Integer:
        to, kind, a, b, wide = operands(self.writer, left, right)
        if operation in _WHOLE:
            return WholeSymbol(to, to.let(f"{_WHOLE[operation]} {kind} {a}, {b}"), wide)
        # The machine rounds towards zero: one less where the remainder's sign is not the divisor's.
        rest = to.let(f"srem {kind} {a}, {b}")
        zero = to.of_integer(0, wide)
        truth = to.typed("i1", wide)
        some = to.let(f"icmp ne {kind} {rest}, {zero}")
        mixed = to.let(f"icmp slt {kind} {to.let(f'xor {kind} {rest}, {b}')}, {zero}")
        less = to.let(f"and {truth} {some}, {mixed}")
        if operation == "%":
            return WholeSymbol(
                to, to.let(f"select {truth} {less}, {kind} {to.let(f'add {kind} {rest}, {b}')}, {kind} {rest}"), wide
            )
        quotient = to.let(f"sdiv {kind} {a}, {b}")
        return WholeSymbol(to, to.let(f"add {kind} {quotient}, {to.let(f'sext {truth} {less} to {kind}')}"), wide)

    def _order(self, order: Order, left: Integer, right: Integer) -> Truth:
        to, kind, a, b, wide = operands(self.writer, left, right)
        return TruthSymbol(to, to.let(f"icmp s{_ORDER[order]} {kind} {a}, {b}"), wide)


def operands(
    to: FunctionWriter, left: Integer, right: Integer, wide: bool = False
) -> tuple[FunctionWriter, str, str, str, bool]:
    """The writer, the type and the operands of two integers, and whether there is one of each for each member."""
    wide = wide or any(isinstance(side, WholeSymbol) and side.wide for side in (left, right))
    return to, to.typed("i64", wide), to.of_integer(left, wide), to.of_integer(right, wide), wide


@final
@dataclass(frozen=True, slots=True, eq=False)
class TruthSymbol(StagedCondition):
    """A truth value in machine code; `wide`: one for each member."""

    writer: FunctionWriter
    name: str
    wide: bool = False


@final
@dataclass(frozen=True, slots=True, eq=False)
class RealPointer(RealCells):
    """Real numbers in the memory of the machine: those of all members side by side, or shared by them."""

    writer: FunctionWriter
    name: str
    shared: bool = False

    def _address(self, kind: str, index: Integer) -> str:
        to = self.writer
        return to.let(f"getelementptr inbounds {kind}, ptr {self.name}, i64 {to.of_integer(index)}")

    def load(self, index: Integer) -> Real:
        """Return the number at an index."""
        to, kind = self.writer, "double" if self.shared else self.writer.real
        found = to.let(f"load {kind}, ptr {self._address(kind, index)}, align 8")
        return Symbol(to, to.spread(found, "double") if self.shared else found)

    def store(self, index: Integer, value: Real) -> None:
        """Keep a number at an index."""
        to = self.writer
        if self.shared and to.width > 1:
            raise StageError("shared")
        operand = to.of_real(value)
        to.write(f"store {to.real} {operand}, ptr {self._address(to.real, index)}, align 8")


@final
@dataclass(frozen=True, slots=True, eq=False)
class IntegerPointer(IntegerCells):
    """Integers in the memory of the machine."""

    writer: FunctionWriter
    name: str

    def _address(self, index: Integer) -> str:
        to = self.writer
        return to.let(f"getelementptr inbounds i64, ptr {self.name}, i64 {to.of_integer(index)}")

    def load(self, index: Integer) -> Integer:
        to = self.writer
        return WholeSymbol(to, to.let(f"load i64, ptr {self._address(index)}, align 8"))

    def store(self, index: Integer, value: Integer) -> None:
        to = self.writer
        operand = to.of_integer(value)
        to.write(f"store i64 {operand}, ptr {self._address(index)}, align 8")
