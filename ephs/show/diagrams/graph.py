"""Graph of a pattern's picture: nodes with sizes and edges, before layout."""

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, final

from ephs.operad import Nesting, Pattern
from ephs.show.diagrams.geometry import KINDS, Point, Points
from ephs.show.shared.errors import ShowError

if TYPE_CHECKING:
    from ephs.semantics import System

DOT = 3.0
TYPE = 11.0
SMALLEST, LARGEST = 20.0, 31.0
_WIDE = frozenset("mwMW")
_NARROW = frozenset("ijltfr.'|")


@final
@dataclass(frozen=True, slots=True)
class Disc:
    """A box before placement: its path, its kind, the lines of its name, their type size and its radius."""

    path: str
    kind: str
    lines: tuple[tuple[str, str], ...]
    type_size: float
    radius: float


@final
@dataclass(frozen=True, slots=True)
class UnplacedWire:
    """A line before placement: `ends` are node paths; an outer port has one."""

    title: str
    ends: tuple[str, ...]
    role: str
    power: bool
    port: str


@final
@dataclass(frozen=True, slots=True)
class Graph:
    """Boxes, junctions (path and name) and edges, in the pattern's order."""

    discs: tuple[Disc, ...]
    dots: tuple[tuple[str, tuple[str, str]], ...]
    edges: tuple[UnplacedWire, ...]

    def radii(self) -> dict[str, float]:
        """Radius of every node, by path."""
        return {disc.path: disc.radius for disc in self.discs} | {path: DOT for path, _ in self.dots}


def places_of(paths: Iterable[str], points: Points) -> dict[str, Point]:
    """Points (n, 2) by the paths of what they are of."""
    return {path: (float(x), float(y)) for path, (x, y) in zip(paths, points, strict=True)}


def width_of(base: str, sub: str, size: float) -> float:
    """Upper bound of the width of lettering of this size."""

    def reckon(text: str) -> float:
        return sum(0.86 if letter in _WIDE else 0.36 if letter in _NARROW else 0.6 for letter in text)

    return size * (reckon(base) + 0.72 * reckon(sub))


def subscripted(name: str) -> tuple[str, str]:
    """Split a short symbol such as ``q_r`` or ``b1.p_j1`` into its letter and its subscript."""
    base, _, sub = name.rpartition("_")
    symbol = base.rpartition(".")[2]
    return (base, sub) if 0 < len(symbol) <= 2 and 0 < len(sub) <= 3 else (name, "")


def short_names(paths: list[str]) -> dict[str, str]:
    """The shortest suffix of each dotted path that no other path ends in.

    >>> short_names(["b1.pe", "b2.pe", "env"])
    {'b1.pe': 'b1.pe', 'b2.pe': 'b2.pe', 'env': 'env'}
    """
    counts: dict[str, int] = {}
    suffixes = {path: _suffixes(path) for path in paths}
    for each in suffixes.values():
        for suffix in each:
            counts[suffix] = counts.get(suffix, 0) + 1
    return {path: next((s for s in each if counts[s] == 1), path) for path, each in suffixes.items()}


def _names(paths: list[str], inside: tuple[str, ...]) -> dict[str, str]:
    within = {path: path[len(top) + 1 :] for path in paths for top in inside if path.startswith(f"{top}.")}
    others = short_names([path for path in paths if path not in within])
    return {path: within.get(path) or others[path] for path in paths}


def _suffixes(path: str) -> list[str]:
    parts = path.split(".") if path != "." else [path]
    return [".".join(parts[-count:]) for count in range(1, len(parts) + 1)]


def read(
    source: "Pattern | Nesting | System", kinds: Mapping[str, str] | None = None, inside: Iterable[str] = ()
) -> Graph:
    """Read a pattern, or a system with the kinds of its fillings, as a graph.

    What lies below one of the paths `inside` is named relative to it.

    Raises
    ------
    ShowError
        If a kind is not one of storage, environment, reversible, irreversible, composite, unknown.
    """
    if isinstance(source, Pattern):
        pattern, found = source, {}
    elif isinstance(source, Nesting):
        pattern, found = source.pattern, {str(box): "composite" for box in source.children}
    else:
        pattern = source.pattern
        found = {str(path): str(filling.kind) for path, filling in source.fillings.items()}
    found |= {str(path): str(kind) for path, kind in (kinds or {}).items()}

    boxes = _names([str(path) for path in pattern.boxes], tuple(inside))
    dots = _names([str(path) for path in pattern.junctions], tuple(inside))
    edges: list[UnplacedWire] = []
    for box, content in pattern.boxes.items():
        for name, port in content.ports.items():
            here, there = str(name), str(port.junction)
            said = here.rpartition(".")[2] == there.rpartition(".")[2]
            title = f"port {_joined(str(box), here)} on junction {there}"
            edges.append(UnplacedWire(title, (str(box), there), "port", port.power, "" if said else here))
    for name, junction in pattern.junctions.items():
        if junction.exposed:
            edges.append(UnplacedWire(f"outer port {name}", (str(name),), "outer", junction.power, ""))
    for group in sorted(sorted(str(path) for path in members) for members in pattern.links):
        for first, second in itertools.pairwise(group):
            edges.append(UnplacedWire(f"{first} and {second} share their state", (first, second), "link", False, ""))
    return Graph(
        _alike(_disc(path, name, found.get(path, "unknown")) for path, name in boxes.items()),
        tuple((path, subscripted(name)) for path, name in dots.items()),
        tuple(edges),
    )


def _alike(discs: Iterable[Disc]) -> tuple[Disc, ...]:
    """The discs, those of one kind as large as the largest of them."""
    each = tuple(discs)
    largest = {kind: max(disc.radius for disc in each if disc.kind == kind) for kind in {d.kind for d in each}}
    return tuple(replace(disc, radius=largest[disc.kind]) for disc in each)


def _joined(box: str, port: str) -> str:
    return port if box == "." else f"{box}.{port}"


def _disc(path: str, name: str, kind: str) -> Disc:
    if kind not in KINDS:
        raise ShowError("kind", path=path, found=kind, expected=", ".join(KINDS))
    # A name that had to be qualified is set smaller, and broken at its last dot where that makes it larger.
    size = TYPE if "." not in name or name == "." else 0.86 * TYPE
    choices: list[tuple[tuple[str, str], ...]] = [(subscripted(name),)]
    if "." in name and name != ".":
        head, _, tail = name.rpartition(".")
        choices.append((subscripted(head + "."), subscripted(tail)))

    def fitting(lines: tuple[tuple[str, str], ...]) -> float:
        room = 2 * LARGEST * (0.84 if len(lines) == 1 else 0.74)
        return min(1.0, room / max(width_of(*line, size) for line in lines))

    lines = max(choices, key=fitting)
    scale = fitting(lines)
    widest = scale * max(width_of(*line, size) for line in lines)
    radius = min(LARGEST, max(SMALLEST, widest / (1.68 if len(lines) == 1 else 1.48)))
    return Disc(path, kind, lines, size * scale, radius)
