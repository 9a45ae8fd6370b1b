"""Patterns in a compact text form, to be written by hand.

One statement a line, or several with ``;`` between; ``#`` starts a comment::

    q: displacement
    p: momentum, exposed             # or: exposed as state
    r: relative_pose(screw, pitch=0.1) @ C1
    pe(q); ke(p); pkc(q, p)
    hc(q_r=~r, p)                    # port=junction; ~ makes a state port; alike names once
    q ~ x                            # these share their state

A quantity without a name is written as the object of the JSON document. A name with other characters than letters,
digits and ``_ + - * / ' ^`` is written in double quotes, as in JSON.
"""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NoReturn, TypeAlias, final

from ephs.operad.directory import Directory
from ephs.operad.documents import quantity_from, quantity_record
from ephs.operad.errors import PatternError
from ephs.operad.messages import nearest_of
from ephs.operad.names import MOST_NAMES, ROOT, Path, PathLike
from ephs.operad.parts import Junction, Port
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import PortType, Quantity, known_quantity, quantity_names, quantity_word

_BARE = re.compile(r"[\w+\-*/'^]+")
_TOKEN = re.compile(r"[ \t\r\f\v]*(?:#[^\n]*)?(\n|[;:,()~@=.]|\"(?:[^\"\\\n]|\\.)*\"|\{|[\w+\-*/'^]+|\S|$)")


def to_text(pattern: Pattern) -> str:
    """The pattern in the compact form, in its own order; see `Pattern.to_text`."""
    lines = [f"{_path(path)}: {_junction_text(j)}" for path, j in pattern.junctions.items()]
    for box, content in pattern.boxes.items():
        ports = ", ".join(_port_text(name, port) for name, port in content.ports.items())
        lines.append(f"{_path(box)}({ports})")
    lines += [" ~ ".join(_path(path) for path in group) for group in sorted(sorted(g) for g in pattern.links)]
    return "".join(f"{line}\n" for line in lines)


def _path(path: Path) -> str:
    return ".".join(_quoted(name) for name in path) or "."


def _quoted(name: str) -> str:
    return name if _BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def _port_text(name: Path, port: Port) -> str:
    state = "" if port.power else "~"
    if name == port.junction:
        return f"{state}{_path(name)}"
    return f"{_path(name)}={state}{_path(port.junction)}"


def _junction_text(junction: Junction) -> str:
    role = "" if not junction.exposed else ", exposed" if junction.power else ", exposed as state"
    return f"{quantity_text(junction.quantity)}{role}"


def quantity_text(quantity: Quantity) -> str:
    """A quantity in the compact form, with its frame."""
    frame = "" if quantity.frame is None else f" @ {_quoted(quantity.frame)}"
    known = quantity_word(quantity)
    if known is None:
        record = quantity_record(quantity.in_frame(None))["quantity"]
        return json.dumps(record, ensure_ascii=False, allow_nan=False) + frame
    word, arguments, parameters = known
    given = [*arguments, *(f"{name}={value!r}" for name, value in parameters.items())]
    return f"{word}({', '.join(given)}){frame}" if given else f"{word}{frame}"


Statements: TypeAlias = tuple[list[tuple[PathLike, Junction]], list[tuple[PathLike, Directory[Port]]], list[list[Path]]]
"""Junctions, boxes and links, as a `Pattern` takes them."""


def from_text(text: str) -> Pattern:
    """Read the compact form; see `Pattern.from_text`."""
    reader = _TokenReader(text)
    junctions, boxes, links = reader.statements()
    if any(box == ROOT for box, _ in boxes):
        return _identity(reader, junctions, boxes, links)
    return Pattern(*_wired(junctions, boxes, links))


def statements(text: str) -> Statements:
    """Read the compact form of a pattern or a part of one."""
    return _wired(*_TokenReader(text).statements())


def quantity_from_text(text: str) -> Quantity:
    """Read a quantity in the compact form; the inverse of `quantity_text`."""
    reader = _TokenReader(text)
    found = reader.quantity()
    return found if reader.peek() == "" else reader.refuse(reader.take(), "the end of the quantity")


def _wired(
    junctions: list[tuple[Path, Junction]], boxes: list[tuple[Path, list[tuple[Path, Port]]]], links: list[list[Path]]
) -> Statements:
    """Objects as lists of pairs, to detect repeated keys."""
    return [*junctions], [(box, Directory(ports, what=f"ports of box {box}")) for box, ports in boxes], links


def _identity(
    reader: "_TokenReader",
    junctions: Iterable[tuple[Path, Junction]],
    boxes: list[tuple[Path, list[tuple[Path, Port]]]],
    links: list[list[Path]],
) -> Pattern:
    """A box at the root path means the identity: its ports are exposed under their names."""
    found = Pattern.identity([(path, PortType(j.quantity, j.power)) for path, j in junctions if j.exposed])
    wires = [(box, sorted(ports, key=lambda each: each[0])) for box, ports in boxes]
    meant = [(ROOT, sorted(found.boxes[ROOT].ports.items(), key=lambda each: each[0]))]
    if links or wires != meant:
        reader.refuse("a box at the root", "an identity: one box, its ports named like the exposed junctions")
    return found


@final
@dataclass(slots=True)
class _TokenReader:
    """Takes one token after the other."""

    text: str
    at: int = 0
    line: int = 1

    def __post_init__(self) -> None:
        if not isinstance(self.text, str):  # pyright: ignore[reportUnnecessaryIsInstance]  # user input
            raise PatternError("text", where="1", found=type(self.text).__name__, expected="text")

    def statements(
        self,
    ) -> tuple[list[tuple[Path, Junction]], list[tuple[Path, list[tuple[Path, Port]]]], list[list[Path]]]:
        """All statements: junctions, boxes, links."""
        junctions: list[tuple[Path, Junction]] = []
        boxes: list[tuple[Path, list[tuple[Path, Port]]]] = []
        links: list[list[Path]] = []
        while (token := self.peek()) != "":
            if token in ("\n", ";"):
                self.take()
                continue
            path = self.path()
            match self.take():
                case ":":
                    junctions.append((path, self.junction()))
                case "(":
                    boxes.append((path, self.ports()))
                case "~":
                    links.append(self.link(path))
                case other:
                    self.refuse(other, '":" of a junction, "(" of a box or "~" of a link')
            if self.peek() not in ("\n", ";", ""):
                self.refuse(self.take(), "the end of the line")
        return junctions, boxes, links

    def peek(self) -> str:
        found = _TOKEN.match(self.text, self.at)
        return found[1] if found else ""

    def take(self) -> str:
        found = _TOKEN.match(self.text, self.at)
        if found is None:
            return ""
        self.at = found.end()
        self.line += found[1] == "\n"
        return found[1]

    def refuse(self, found: str, expected: str) -> NoReturn:
        shown = {"": "the end of the text", "\n": "the end of the line"}.get(found, found)
        raise PatternError("text", where=str(self.line), found=shown, expected=expected)

    def want(self, token: str) -> None:
        if (found := self.take()) != token:
            self.refuse(found, f'"{token}"')

    def name(self, what: str) -> str:
        found = self.take()
        if found.startswith('"') and len(found) > 1:
            try:
                return json.loads(found)
            except json.JSONDecodeError:
                self.refuse(found, "a name in double quotes, as in JSON")
        if not _BARE.fullmatch(found):
            self.refuse(found, what)
        return found

    def path(self) -> Path:
        if self.peek() == ".":
            self.take()
            return ROOT
        names = [self.name("a name")]
        while self.peek() == "." and len(names) <= MOST_NAMES:
            self.take()
            names.append(self.name("a name"))
        return Path(names)  # which refuses too many

    def junction(self) -> Junction:
        quantity = self.quantity()
        if self.peek() != ",":
            return Junction(quantity)
        self.take()
        if (word := self.take()) != "exposed":
            self.refuse(word, '"exposed" or "exposed as state"')
        if self.peek() != "as":
            return Junction(quantity, True)
        self.take()
        self.want("state")
        return Junction(quantity, True, False)

    def quantity(self) -> Quantity:
        if self.peek() == "{":
            start = self.text.index("{", self.at)
            try:
                described, self.at = json.JSONDecoder().raw_decode(self.text, start)
            except (ValueError, RecursionError):  # no JSON, or a number of too many digits
                self.refuse("{", "the object of a quantity, as in JSON")
            found = quantity_from(f"line {self.line}", {"quantity": described})
        else:
            word = self.name("a quantity")
            arguments, parameters = self.arguments() if self.peek() == "(" else ((), {})
            known = known_quantity(word, arguments, **parameters)
            if known is None:
                near = nearest_of(word, quantity_names())
                self.refuse(word, f"the name of a quantity, with a pair where it has one{near}")
            found = known
        if self.peek() == "@":
            self.take()
            return found.in_frame(self.name("the name of a frame"))
        return found

    def arguments(self) -> tuple[tuple[str, ...], dict[str, float]]:
        self.want("(")
        given: list[str] = []
        parameters: dict[str, float] = {}
        while True:
            name = self.name("an argument")
            if self.peek() == "=":
                self.take()
                parameters[name] = self.number()
            else:
                given.append(name)
            if (token := self.take()) == ")":
                return tuple(given), parameters
            if token != ",":
                self.refuse(token, '"," or ")"')

    def number(self) -> float:
        words = [self.take()]
        while self.peek() == "." or _BARE.fullmatch(self.peek()):
            words.append(self.take())
        try:
            return float("".join(words))
        except ValueError:
            self.refuse("".join(words), "a number")

    def ports(self) -> list[tuple[Path, Port]]:
        found: list[tuple[Path, Port]] = []
        if self.peek() == ")":
            self.take()
            return found
        while True:
            power = not self._tilde()
            name = self.path()
            if power and self.peek() == "=":
                self.take()
                power = not self._tilde()
                found.append((name, Port(self.path(), power)))
            else:
                found.append((name, Port(name, power)))
            if (token := self.take()) == ")":
                return found
            if token != ",":
                self.refuse(token, '"," or ")"')

    def _tilde(self) -> bool:
        if self.peek() == "~":
            self.take()
            return True
        return False

    def link(self, first: Path) -> list[Path]:
        group = [first, self.path()]
        while self._tilde():
            group.append(self.path())
        return group
