"""C text from assembly text of LLVM: of the instructions that staged functions are written in.

Each value is a variable, each block a label. Integers wrap, and nothing is contracted, as in the text.
"""

import re
import struct
from collections.abc import Callable
from typing import Final, final

from ephs.semantics.stage.errors import StageError

_TYPES: Final = {"double": "double", "i64": "int64_t", "i1": "int", "ptr": "char *", "void": "void", "i8": "char"}
_PLAIN: Final = {"fadd": "+", "fsub": "-", "fmul": "*", "fdiv": "/", "sdiv": "/", "srem": "%", "ashr": ">>"}
_WRAPPING: Final = {"add": "+", "sub": "-", "mul": "*", "and": "&", "or": "|", "xor": "^", "shl": "<<", "lshr": ">>"}
_CASTS: Final = {
    "sitofp": "(double){}", "uitofp": "(double)(uint64_t){}", "sext": "-(int64_t){}", "zext": "(int64_t){}",
    "inttoptr": "(char *)(intptr_t){}",
}  # fmt: skip
_BITS: Final = {"double": "bits_to_double({})", "i64": "double_to_bits({})"}
"""Cast of the bits of a number, by the type that it becomes."""
_ORDER: Final = {"eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">="}
_BUILT: Final = {
    "llvm.fabs.f64": "fabs", "llvm.sqrt.f64": "sqrt", "llvm.floor.f64": "floor", "llvm.copysign.f64": "copysign",
    "llvm.fptosi.sat.i64.f64": "saturated",
}  # fmt: skip
_FUNCTION: Final = re.compile(r"^define (internal )?(?:fastcc )?(\S+) @([\w.]+)\((.*?)\) \{\n(.*?)^\}", re.M | re.S)
_GLOBAL: Final = re.compile(r"^@([\w.]+) = internal constant \[(\d+) x (double|i64)\] \[(.*)\]$", re.M)
_LINE: Final = re.compile(r"^\s*(?:(%[\w.]+) = )?(\S+)\s*(.*?)(?:, align \d+)?$")


def c_text(text: str) -> str:
    """Return a module of LLVM as C of 1999, that needs ``math.h`` and ``string.h``.

    Parameters
    ----------
    text
        What `Program.text` returns, for one member.

    Raises
    ------
    StageError
        The text has an instruction that staged functions do not write.
    """
    functions = [_Function(*found) for found in _FUNCTION.findall(text)]
    tables = [
        f"static const {_TYPES[kind]} {_name(name)}[{max(int(size), 1)}] = {{{_entries(kind, entries)}}};"
        for name, size, kind, entries in _GLOBAL.findall(text)
    ]
    return "\n".join(
        [_PROLOGUE, *tables, *(f"{each.declaration};" for each in functions), *(each.text() for each in functions), ""]
    )


_PROLOGUE: Final = """\
#include <math.h>
#include <stdint.h>
#include <string.h>
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif
static int64_t saturated(double x) {
  if (x >= 9223372036854775808.0) return INT64_MAX;
  if (x <= -9223372036854775808.0) return INT64_MIN;
  return x == x ? (int64_t)x : 0;
}
static double bits_to_double(int64_t x) { double y; memcpy(&y, &x, 8); return y; }
static int64_t double_to_bits(double x) { int64_t y; memcpy(&y, &x, 8); return y; }"""


def _name(name: str) -> str:
    return re.sub(r"\W", "_", name.lstrip("%@"))


def _entries(kind: str, entries: str) -> str:
    return ", ".join(_constant(entry.split()[1], kind) for entry in entries.split(", ")) if entries else "0"


def _constant(word: str, kind: str) -> str:
    if kind == "double":
        value: float = struct.unpack(">d", bytes.fromhex(word[2:].zfill(16)))[0]
        if value != value:
            return "NAN"
        return value.hex() if abs(value) < float("inf") else ("INFINITY" if value > 0.0 else "-INFINITY")
    if kind == "i1":
        return {"true": "1", "false": "0"}.get(word, word)
    if kind == "i64":
        return "INT64_MIN" if int(word) == -(2**63) else f"INT64_C({word})"
    return word


def _split(words: str) -> list[str]:
    """Parts between top-level commas."""
    out, depth, start = list[str](), 0, 0
    for k, letter in enumerate(words):
        depth += (letter in "([") - (letter in ")]")
        if letter == "," and depth == 0:
            out.append(words[start:k].strip())
            start = k + 1
    return [*out, words[start:].strip()] if words.strip() else out


@final
class _Function:
    """One function, as C."""

    def __init__(self, internal: str, result: str, name: str, parameters: str, body: str) -> None:
        self.result, self.body = result, body
        self.kinds: dict[str, str] = {}
        found: list[str] = []
        for parameter in _split(parameters):
            kind, *_, word = parameter.split()
            self.kinds[word] = kind
            found.append(f"{_TYPES[kind]} {_name(word)}")
        scope = "static " if internal else ""
        self.declaration = f"{scope}{_TYPES[result]} {_name(name)}({', '.join(found) or 'void'})"
        self.given = set(self.kinds)
        self.entering: dict[str, list[tuple[str, str, str]]] = {}
        self.lines: list[str] = []
        self._operations: dict[str, Callable[[str | None, str], None]] = {
            "fneg": self._negate, "fcmp": self._compare, "icmp": self._compare, "select": self._select,
            "load": self._load, "store": self._store, "getelementptr": self._step, "alloca": self._allocate,
            "ret": self._return, "call": self._call,
        }  # fmt: skip

    def text(self) -> str:
        """Return the definition."""
        lines = [line for line in self.body.split("\n") if line.strip()]
        self._find_phis(lines)
        block = "entry"
        for line in lines:
            if line.endswith(":"):
                block = line[:-1].strip()
                self.lines.append(f"{_label(block)}:;")
                self.lines += [f"  {_name(x)} = {_name(x)}_in;" for x in self._joined.get(block, [])]
            else:
                self._line(line, block)
        variables = [f"  {_TYPES[kind]} {_name(word)};" for word, kind in self.kinds.items() if word not in self.given]
        variables += [f"  {_TYPES[self.kinds[x]]} {_name(x)}_in;" for found in self._joined.values() for x in found]
        return "\n".join([f"{self.declaration} {{", *variables, *self.slots, *self.lines, "}"])

    def _find_phis(self, lines: list[str]) -> None:
        """Record the values that each block passes to its successors' variables."""
        self._joined: dict[str, list[str]] = {}
        self.slots: list[str] = []
        self._handed: dict[tuple[str, str], list[tuple[str, str, str]]] = {}
        block = "entry"
        for line in lines:
            if line.endswith(":"):
                block = line[:-1].strip()
            elif (found := re.match(r"\s*(%\S+) = phi (\S+) (.*)$", line)) is not None:
                word, kind, sources = found.groups()
                self._joined.setdefault(block, []).append(word)
                self.kinds[word] = kind
                for value, source in re.findall(r"\[ (\S+), %(\S+) \]", sources):
                    self._handed.setdefault((source, block), []).append((word, kind, value))

    def _value(self, word: str, kind: str) -> str:
        word = word.strip()
        if word.startswith("%"):
            return _name(word)
        if word.startswith("@"):
            return f"(char *){_name(word)}"
        if (found := re.match(r"ptrtoint \(ptr (@\S+) to i64\)", word)) is not None:
            return f"(int64_t)(intptr_t){_name(found[1])}"
        return _constant(word, kind)

    def _typed(self, words: str) -> tuple[str, str]:
        kind, _, word = words.partition(" ")
        return kind, self._value(word.replace("noalias ", ""), kind)

    def _write(self, word: str | None, kind: str, value: str) -> None:
        if word is None or kind == "void":
            self.lines.append(f"  {value};")
        else:
            self.kinds[word] = kind
            self.lines.append(f"  {_name(word)} = {value};")

    def _jump(self, block: str, target: str) -> str:
        given = "".join(f"{_name(x)}_in = {self._value(v, k)}; " for x, k, v in self._handed.get((block, target), []))
        return f"{given}goto {_label(target)};"

    def _line(self, line: str, block: str) -> None:
        found = _LINE.match(line)
        word, operation, rest = found.groups() if found else (None, "", "")
        rest = re.sub(r"^(nsw |nuw |inbounds |fastcc |tail )+", "", rest)
        if operation in _PLAIN:
            self._binary(word, rest, f"{{}} {_PLAIN[operation]} {{}}")
        elif operation in _WRAPPING:
            self._binary(word, rest, _wrapping(_WRAPPING[operation], rest))
        elif operation in _CASTS or operation == "bitcast":
            value, _, kind = rest.rpartition(" to ")
            self._write(word, kind, (_CASTS.get(operation) or _BITS[kind]).format(self._typed(value)[1]))
        elif operation in self._operations:
            self._operations[operation](word, rest)
        elif operation == "br":
            self._branch(rest, block)
        elif operation != "phi":  # whose value was handed over where the block was entered
            raise StageError("machine", where="c_text", found=line.strip())

    def _binary(self, word: str | None, rest: str, form: str) -> None:
        kind, _, operands = rest.partition(" ")
        one, other = _split(operands)
        self._write(word, kind, form.format(self._value(one, kind), self._value(other, kind)))

    def _negate(self, word: str | None, rest: str) -> None:
        kind, value = self._typed(rest)
        self._write(word, kind, f"-{value}")

    def _compare(self, word: str | None, rest: str) -> None:
        order, kind, operands = rest.split(" ", 2)
        one, other = _split(operands)
        sign = _ORDER.get(order) or _ORDER[order[1:]]  # ordered, or signed
        self._write(word, "i1", f"{self._value(one, kind)} {sign} {self._value(other, kind)}")

    def _select(self, word: str | None, rest: str) -> None:
        (_, truth), (kind, one), (_, other) = map(self._typed, _split(rest))
        self._write(word, kind, f"{truth} ? {one} : {other}")

    def _load(self, word: str | None, rest: str) -> None:
        kind, pointer, *_ = _split(rest)
        self._write(word, kind, f"*({_TYPES[kind]} *){self._typed(pointer)[1]}")

    def _store(self, word: str | None, rest: str) -> None:
        value, pointer, *_ = _split(rest)
        kind, written = self._typed(value)
        self._write(None, "void", f"*({_TYPES[kind]} *){self._typed(pointer)[1]} = {written}")

    def _step(self, word: str | None, rest: str) -> None:
        kind, pointer, index = _split(rest)
        size = 1 if kind == "i8" else 8
        self._write(word, "ptr", f"{self._typed(pointer)[1]} + {size} * {self._typed(index)[1]}")

    def _allocate(self, word: str | None, rest: str) -> None:
        found = re.match(r"\[(\d+) x (\w+)\]|(\w+)", rest)
        size, kind = (found[1] or "1", found[2] or found[3]) if found else ("1", "i64")
        name = _name(word or "")
        self.slots.append(f"  {_TYPES[kind]} {name}_slot[{max(int(size), 1)}];")
        self._write(word, "ptr", f"(char *){name}_slot")

    def _branch(self, rest: str, block: str) -> None:
        parts = _split(rest)
        if len(parts) == 1:
            self.lines.append(f"  {self._jump(block, parts[0].split('%')[1])}")
            return
        yes, no = (part.split("%")[1] for part in parts[1:])
        truth = self._typed(parts[0])[1]
        self.lines.append(f"  if ({truth}) {{ {self._jump(block, yes)} }} else {{ {self._jump(block, no)} }}")

    def _return(self, word: str | None, rest: str) -> None:
        self.lines.append("  return;" if rest == "void" else f"  return {self._typed(rest)[1]};")

    def _call(self, word: str | None, rest: str) -> None:
        found = re.match(r"(\S+) ([@%][\w.]+)\((.*)\)$", rest)
        if found is None:
            raise StageError("machine", where="c_text", found=rest)
        result, name, words = found.groups()
        arguments = [self._typed(each) for each in _split(words)]
        values = ", ".join(value for _, value in arguments)
        if name.startswith("%"):
            kinds = ", ".join(_TYPES[kind] for kind, _ in arguments)
            self._write(word, result, f"(({_TYPES[result]} (*)({kinds})){_name(name)})({values})")
        elif name[1:] in _BUILT:
            self._write(word, result, f"{_BUILT[name[1:]]}({values})")
        elif name.startswith("@llvm.memcpy"):
            self._write(None, "void", f"memcpy({', '.join(value for _, value in arguments[:3])})")
        else:
            self._write(word, result, f"{_name(name)}({values})")


def _wrapping(sign: str, rest: str) -> str:
    """Return how two operands are joined: conditions as they are, integers without sign."""
    return f"{{}} {sign} {{}}" if rest.startswith("i1 ") else f"(int64_t)((uint64_t){{}} {sign} (uint64_t){{}})"


def _label(block: str) -> str:
    return f"at_{_name(block)}"
