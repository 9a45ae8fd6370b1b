"""Translation of patterns to and from diagrams of other programs, with the list of lost elements."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Generic, TypeVar, final

from ephs.operad.errors import PatternError
from ephs.operad.names import ROOT, Path
from ephs.operad.parts import Junction, Port
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import Quantity
from ephs.operad.reading import Reader
from ephs.operad.text import quantity_from_text

T = TypeVar("T")


@final
@dataclass(frozen=True, slots=True)
class Translation(Generic[T]):
    """Result of a translation.

    Parameters
    ----------
    result
        The translation.
    lost
        What it does not say, a sentence each; empty where the way back gives the same again.
    """

    result: T
    lost: tuple[str, ...]


def box_name(box: Path) -> str:
    """The exported name of a box; the box of an identity pattern has none."""
    return str(box) if box else "identity"


def lost_of(pattern: Pattern) -> list[str]:
    """Features without a counterpart in undirected wiring diagrams and hypergraphs: state ports, and shared states."""
    lost = [
        f"port {box}.{name} reads the state of junction {port.junction} and bears no power"
        for box, content in pattern.boxes.items()
        for name, port in content.ports.items()
        if not port.power
    ]
    lost += [f"outer port {name} bears no power" for name, kind in pattern.interface.items() if not kind.power]
    lost += [
        f"junctions {' and '.join(map(str, group))} share their state" for group in sorted(map(sorted, pattern.links))
    ]
    return lost + ["the box of the identity has no name"] * (ROOT in pattern.boxes)


@final
@dataclass(slots=True)
class _UniqueNames:
    """Names handed out, each once."""

    taken: set[Path] = field(default_factory=set[Path])

    def fresh(self, name: Path) -> Path:
        number, found = 1, name
        while any(found.is_prefix_of(other) or other.is_prefix_of(found) for other in self.taken):
            number += 1
            found = Path((*name[:-1], f"{name[-1]}{number}"))
        self.taken.add(found)
        return found


@final
@dataclass(frozen=True, slots=True)
class Wiring:
    """Numbered wiring diagram of another program, from which a pattern is made.

    Parameters
    ----------
    what
        Of which kind the diagram is, for messages.
    junctions
        The type of each, and its name where it has one.
    boxes
        The name of each where it has one, and its ports: names, and numbers of junctions.
    outer
        Outer ports: names where they have some, and numbers of junctions.
    """

    what: str
    junctions: list[tuple[str | None, str | None]]
    boxes: list[tuple[str | None, list[tuple[str, int]]]]
    outer: list[tuple[str | None, int]]

    def pattern(self, quantities: Mapping[str, Quantity] | Quantity | None) -> Translation[Pattern]:
        """The pattern of the diagram; see `from_catlab`."""
        reader, lost = Reader(self.what), list[str]()
        exposed: dict[int, str | None] = {}
        for k, (name, junction) in enumerate(self.outer):
            if junction in exposed:
                found = f"a second outer port on junction {junction + 1}"
                reader.refuse(f"outer port {k + 1}", found, "one; fork outside, where the pattern is used")
            exposed[junction] = name
        used = {junction for _, ports in self.boxes for _, junction in ports}
        names, called = _UniqueNames(), dict[int, Path]()
        junctions: dict[Path, Junction] = {}
        # exposed junctions first: they keep the names of outer ports
        for k in sorted(range(len(self.junctions)), key=lambda k: k not in exposed):
            kind, own = self.junctions[k]
            wanted = exposed.get(k) or own
            if k not in used and k not in exposed:
                lost.append(f"junction {own or k + 1} has no port")
                continue
            called[k] = self._name(reader, names, "junction", k, wanted, lost)
            if own is not None and wanted != own:
                lost.append(f"the junction of outer port {wanted} was called {own}")
            junctions[called[k]] = Junction(self._quantity(reader, k, kind, quantities), k in exposed)
        boxes: dict[Path, dict[Path, Port]] = {}
        for k, (name, ports) in enumerate(self.boxes):
            box = self._name(reader, names, "box", k, name, lost)
            boxes[box] = wires = {}
            for port, junction in ports:
                path = _path(reader, f"box {k + 1}, port {port}", port)
                if path in wires:
                    reader.refuse(f"box {k + 1}, port {port}", "two ports of this name", "names of their own")
                wires[path] = Port(called[junction], True)
        try:
            return Translation(Pattern(junctions, boxes), tuple(lost))
        except PatternError as error:
            reader.refuse("diagram", str(error), "a pattern")

    def _name(self, reader: Reader, names: _UniqueNames, what: str, k: int, name: str | None, lost: list[str]) -> Path:
        wanted = Path((f"{what}{k + 1}",)) if name is None else _path(reader, f"{what} {k + 1}", name)
        found = names.fresh(wanted)
        if found != wanted and name is not None:
            lost.append(f"{what} {k + 1} is called {found} in place of {wanted}, which is taken")
        return found

    @staticmethod
    def _quantity(
        reader: Reader, k: int, kind: str | None, quantities: Mapping[str, Quantity] | Quantity | None
    ) -> Quantity:
        if isinstance(quantities, Quantity):
            return quantities
        if kind is not None and quantities is not None and kind in quantities:
            return quantities[kind]
        try:
            return quantity_from_text(kind or "")
        except PatternError:
            shown = "no type" if kind is None else f"the type {kind}"
            reader.refuse(f"junction {k + 1}", shown, "the name of a quantity, or one in quantities=")


def _path(reader: Reader, where: str, name: str) -> Path:
    try:
        found = Path.parse(name)
    except PatternError as error:
        reader.refuse(where, str(error), "a dotted name")
    return found if found else reader.refuse(where, name, "a name")


def numbered(names: Iterable[str]) -> list[str]:
    """Unique names: repeated ones get a number."""
    seen: dict[str, int] = {}
    out: list[str] = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name}{seen[name]}")
    return out
