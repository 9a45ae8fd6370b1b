"""All mutants of a file, in a fixed order, each with a name that edits elsewhere do not change."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

COMPARED: dict[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
}
ORDERED = re.compile(r"cross|compose|matmul|multiply|product|commutator|quotient|relative", re.IGNORECASE)
"""Names of functions whose first two arguments are not to be exchanged."""
EXTREMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum"}
TINY = re.compile(rb"e-\d", re.IGNORECASE)
"""Tolerances: that one is twice as large nobody should see."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change of a file: the bytes from ``start`` to ``stop`` become others.

    ``name`` holds the file, the function, the kind of change and its number among those of that kind in the function;
    ``lines`` are those of the statement's head, ``change`` says what becomes what, ``loading`` whether it runs when the
    module is loaded.
    """

    file: str
    function: str
    kind: str
    number: int
    start: int = field(repr=False)
    stop: int = field(repr=False)
    new: bytes = field(repr=False)
    lines: tuple[int, int]
    change: str
    loading: bool = False

    @property
    def name(self) -> str:
        """File, function, kind, number."""
        return f"{self.file} {self.function} {self.kind} {self.number}"

    def text(self, source: bytes) -> bytes:
        """The file's text with the change."""
        return source[: self.start] + self.new + source[self.stop :]


@dataclass(slots=True)
class _Place:
    """Where the walk is: the function's name, the lines of the statement, whether it runs when the module is loaded."""

    function: str
    lines: tuple[int, int]
    loading: bool


class _Source:
    """A file's bytes, its tree, and where nodes begin and end in it."""

    def __init__(self, text: bytes) -> None:
        self.text = text
        self.tree = ast.parse(self.text)
        self.starts = [0]
        for line in self.text.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))
        self.code = self._without_comments()
        self.found: list[tuple[_Place, str, int, int, bytes]] = []

    def _without_comments(self) -> bytes:
        """The text with blanks in place of comments: they are not part of what a mutant changes."""
        code = bytearray(self.text)
        for token in tokenize.tokenize(io.BytesIO(self.text).readline):
            if token.type == tokenize.COMMENT:
                start = self.starts[token.start[0] - 1] + len(token.line[: token.start[1]].encode())
                size = len(token.string.encode())
                code[start : start + size] = b" " * size
        return bytes(code)

    def span(self, node: ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None and node.end_col_offset is not None
        return self.starts[node.lineno - 1] + node.col_offset, self.starts[node.end_lineno - 1] + node.end_col_offset

    def of(self, node: ast.expr) -> bytes:
        start, stop = self.span(node)
        return self.text[start:stop]

    def add(self, place: _Place, kind: str, start: int, stop: int, new: bytes) -> None:
        self.found.append((place, kind, start, stop, new))

    def between(self, left: ast.expr, right: ast.expr, old: str) -> tuple[int, int]:
        """Where an operator stands between two operands, comments apart."""
        start, stop = self.span(left)[1], self.span(right)[0]
        gap = self.code[start:stop]
        word = re.escape(old.encode()).replace(rb"\ ", rb"\s+")
        found = re.search(rb"\b" + word + rb"\b" if old[0].isalpha() else word, gap)
        assert found is not None
        return start + found.start(), start + found.end()


def mutants_of(file: str) -> list[Mutant]:
    """The mutants of a file, by its path from the root."""
    return mutants_in(file, (ROOT / file).read_bytes())


def mutants_in(file: str, text: bytes) -> list[Mutant]:
    """The mutants of a file that has this text."""
    source = _Source(text)
    for node in source.tree.body:
        _statement(source, node, "module", True)
    numbers: dict[tuple[str, str], int] = {}
    out: list[Mutant] = []
    for place, kind, start, stop, new in source.found:
        number = numbers[place.function, kind] = numbers.get((place.function, kind), 0) + 1
        out.append(
            Mutant(
                file,
                place.function,
                kind,
                number,
                start,
                stop,
                new,
                place.lines,
                _change(source, start, stop, new),
                place.loading,
            )
        )
    return out


def _change(source: _Source, start: int, stop: int, new: bytes) -> str:
    """The change with what stands around it on its line, comments apart."""
    first = source.code.rfind(b"\n", 0, start) + 1
    last = source.code.find(b"\n", stop)
    before, after = source.code[first:start], source.code[stop : last if last >= 0 else None]
    old = source.code[start:stop]
    return " ".join(f"{before.decode()}⟦{old.decode()} → {new.decode()}⟧{after.decode()}".split())


def _statement(source: _Source, node: ast.stmt, function: str, loading: bool) -> None:
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
            inner = node.name if function == "module" else f"{function}.{node.name}"
            place = _Place(inner, (node.lineno, node.body[0].lineno - 1), loading)
            if not isinstance(node, ast.ClassDef):
                for default in [*node.args.defaults, *(d for d in node.args.kw_defaults if d is not None)]:
                    _expression(source, default, place)
            for child in node.body:
                _statement(source, child, inner, loading and isinstance(node, ast.ClassDef))
            return
        case ast.Raise() | ast.Import() | ast.ImportFrom() | ast.Assert() | ast.Pass() | ast.Global():
            return
        case ast.Expr(value=ast.Constant()) | ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return
        case _:
            pass
    blocks = [block for name in ("body", "orelse", "finalbody") if (block := getattr(node, name, None))]
    handlers = getattr(node, "handlers", [])
    cases = getattr(node, "cases", [])
    bodies = [*blocks, *(h.body for h in handlers), *(c.body for c in cases)]
    last = min((body[0].lineno for body in bodies), default=(node.end_lineno or node.lineno) + 1) - 1
    place = _Place(function, (node.lineno, max(last, node.lineno)), loading)
    match node:
        case ast.AugAssign(op=ast.Add() | ast.Sub() as op):
            old = "+=" if isinstance(op, ast.Add) else "-="
            start, stop = source.between(node.target, node.value, old)
            source.add(place, "sign", start, stop, b"-=" if old == "+=" else b"+=")
        case _:
            pass
    for name, value in ast.iter_fields(node):
        if name in {"annotation", "type_comment", "decorator_list"}:
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.expr):
                _expression(source, child, place)
            elif isinstance(child, ast.withitem):
                _expression(source, child.context_expr, place)
            elif isinstance(child, ast.match_case) and child.guard is not None:
                _expression(source, child.guard, place)
    for body in bodies:
        for child in body:
            _statement(source, child, function, loading)


def _expression(source: _Source, node: ast.expr, place: _Place) -> None:
    for kind, start, stop, new in _changes(source, node):
        source.add(place, kind, start, stop, new)
    for child in _inner(node):
        _expression(source, child, place)


def _inner(node: ast.AST) -> Iterator[ast.expr]:
    """Expressions directly inside, but those that others change, and texts."""
    if isinstance(node, ast.JoinedStr):
        return
    if _is_view(node):
        return  # its length is changed by the call itself
    for child in ast.iter_child_nodes(node):
        if isinstance(node, ast.Subscript) and child is node.slice:
            yield from _beside_constants(child)
        elif isinstance(node, ast.UnaryOp) and isinstance(child, ast.Constant):
            continue
        elif isinstance(child, ast.keyword) and child.arg == "strict":
            continue  # of zip: lengths are equal by construction
        elif isinstance(child, ast.expr):
            yield child
        elif isinstance(child, ast.comprehension | ast.keyword | ast.arguments | ast.Slice):
            yield from _inner(child)


def _beside_constants(index: ast.AST) -> Iterator[ast.expr]:
    match index:
        case ast.Constant() | ast.UnaryOp(operand=ast.Constant()):
            return
        case ast.Tuple(elts=parts):
            for part in parts:
                yield from _beside_constants(part)
        case ast.Slice(lower=lower, upper=upper, step=step):
            for part in (lower, upper, step):
                if part is not None:
                    yield from _beside_constants(part)
        case ast.expr():
            yield index
        case _:
            pass


def _changes(source: _Source, node: ast.expr) -> Iterator[tuple[str, int, int, bytes]]:
    match node:
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as op, right=right):
            if not any(isinstance(side, ast.JoinedStr) or _is_text(side) for side in (left, right)):
                old = "+" if isinstance(op, ast.Add) else "-"
                yield "sign", *source.between(left, right, old), b"-" if old == "+" else b"+"
        case ast.BinOp(left=left, op=ast.MatMult(), right=right) if source.of(left) != source.of(right):
            yield "order", *source.span(node), b"(%b) @ (%b)" % (source.of(right), source.of(left))
        case ast.UnaryOp(op=ast.USub()):
            yield "sign", (at := source.span(node)[0]), at + len("-"), b""
        case ast.UnaryOp(op=ast.Not()):
            yield "logic", (at := source.span(node)[0]), at + len("not "), b""
        case ast.BoolOp(op=op, values=values):
            old, new = ("and", b"or") if isinstance(op, ast.And) else ("or", b"and")
            first, second = values[0], values[1]
            yield "logic", *source.between(first, second, old), new
        case ast.Compare(left=left, ops=ops, comparators=comparators):
            for (a, b), op in zip(pairwise([left, *comparators]), ops, strict=True):
                old, others = COMPARED[type(op)]
                for new in others:
                    yield "comparison", *source.between(a, b, old), new.encode()
        case ast.Subscript(value=ast.Attribute(attr="small"), slice=ast.Slice(upper=upper)):
            if isinstance(upper, ast.Constant):  # scratch memory: a view that begins earlier is no mistake
                yield "index", *source.span(upper), str(upper.value - 1).encode()
        case ast.Subscript(slice=index):
            yield from _indices(source, index)
        case ast.Attribute(value=value, attr="T"):
            yield "transpose", source.span(value)[1], source.span(node)[1], b""
        case ast.Call(func=function, args=args):
            yield from _call(source, node, function, args)
        case ast.Constant(value=bool(value)):
            yield "logic", *source.span(node), str(not value).encode()
        case ast.Constant(value=int(value)):
            yield "constant", *source.span(node), str(value + 1).encode()
        case ast.Constant(value=float(value)) if not TINY.search(source.of(node)):
            yield "constant", *source.span(node), repr(2.0 * value if value else 1.0).encode()
        case _:
            pass


def _is_view(node: ast.AST) -> bool:
    """Whether a kernel looks at memory here: a view that is too long is no mistake, one that is too short is."""
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "carray"


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _indices(source: _Source, index: ast.expr) -> Iterator[tuple[str, int, int, bytes]]:
    match index:
        case ast.Constant(value=int(value)):
            yield "index", *source.span(index), str(value + 1).encode()
            if value:
                yield "index", *source.span(index), str(value - 1).encode()
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int(value))):
            yield "index", *source.span(index), str(-value - 1).encode()
        case ast.Tuple(elts=parts):
            for part in parts:
                yield from _indices(source, part)
        case ast.Slice(lower=lower, upper=upper):
            for part in (lower, upper):
                if part is not None:
                    yield from _indices(source, part)
        case _:
            pass


def _call(
    source: _Source, node: ast.Call, function: ast.expr, args: list[ast.expr]
) -> Iterator[tuple[str, int, int, bytes]]:
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    starred = any(isinstance(arg, ast.Starred) for arg in args)
    if name == "range" and args and not starred:
        stop = args[0] if len(args) == 1 else args[1]
        yield "range", *source.span(stop), b"(%b) - 1" % source.of(stop)
    if _is_view(node) and getattr(args[0], "id", "") != "work":  # scratch memory is as long as it is
        for length in ast.walk(args[1]):
            if isinstance(length, ast.Constant) and length.value:
                yield "length", *source.span(length), str(length.value - 1).encode()
    if name in EXTREMES:
        start, stop_at = source.span(function)
        yield "extreme", stop_at - len(name), stop_at, EXTREMES[name].encode()
    if ORDERED.search(name) and len(args) >= 2 and not starred:
        (start, first_stop), (second, stop_at) = source.span(args[0]), source.span(args[1])
        gap = source.text[first_stop:second]
        yield "order", start, stop_at, source.of(args[1]) + gap + source.of(args[0])
