"""Matching: the places in a pattern at which a rule can be applied."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import final

from ephs.operad.canonical import canonical
from ephs.operad.errors import PatternError
from ephs.operad.isomorphism import Renaming
from ephs.operad.names import Path
from ephs.operad.parts import Port
from ephs.operad.pattern import Pattern
from examples.rewriting.elements import Elements
from examples.rewriting.gluing import require_gluing
from examples.rewriting.rules import Rule


def matches(rule: Rule, pattern: Pattern, *, injective: bool = True) -> Iterator[Renaming]:
    """All places at which a rule can be applied; see `Rule.matches`."""
    if pattern.is_identity:
        return
    host = Elements.of(canonical(pattern))
    for found in _Search(rule, host, injective).all():
        try:
            require_gluing(rule, found, host)
        except PatternError:
            continue
        yield found


@final
@dataclass(slots=True)
class _Search:
    """Backtracking search over the left side's boxes, their ports, and the junctions without ports."""

    rule: Rule
    host: Elements
    injective: bool
    boxes: dict[Path, Path] = field(default_factory=dict[Path, Path])
    ports: dict[Path, dict[Path, Path]] = field(default_factory=dict[Path, dict[Path, Path]])
    junctions: dict[Path, Path] = field(default_factory=dict[Path, Path])
    states: dict[frozenset[Path], int] = field(default_factory=dict[frozenset[Path], int])
    around: dict[Path, set[Path]] = field(default_factory=dict[Path, set[Path]])

    def __post_init__(self) -> None:
        for (box, _), junction in self.host.power.items():
            self.around.setdefault(junction, set()).add(box)

    def all(self) -> Iterator[Renaming]:
        left = self.rule.left
        known, reads = self.host.ports(), self.host.state_at()
        classes = left.classes
        places = [(box, name, port) for box, content in self._connected() for name, port in content]

        def junction(path: Path, image: Path) -> Iterator[None]:
            """The junction at an image, if compatible."""
            if path in self.junctions:
                if self.junctions[path] == image:
                    yield
                return
            quantity = left.junctions[path].quantity
            if not self.host.junctions[image][0].matches(quantity):
                return
            if self.injective and image in self._taken():
                return
            self.junctions[path] = image
            yield from state(path, self.host.state_of[image])
            del self.junctions[path]

        def state(path: Path, number: int) -> Iterator[None]:
            group = classes[path]
            if group in self.states:
                if self.states[group] == number:
                    yield
                return
            if not self.host.states[number].quantity.matches(left.junctions[path].quantity):
                return
            self.states[group] = number
            yield
            del self.states[group]

        def port(at: int) -> Iterator[None]:
            if at == len(places):
                yield from rest(sorted(left.junctions))
                return
            box, name, where = places[at]
            for there in [self.boxes[box]] if box in self.boxes else self._candidates(box):
                fresh = box not in self.boxes
                if fresh:
                    self.boxes[box], self.ports[box] = there, {}
                for image in sorted(known[there]):
                    if known[there][image] != where.power or (self.injective and image in self.ports[box].values()):
                        continue
                    self.ports[box][name] = image
                    if where.power:
                        below = junction(where.junction, self.host.power[there, image])
                    else:
                        below = state(where.junction, reads[there, image])
                    for _ in below:
                        yield from port(at + 1)
                    del self.ports[box][name]
                if fresh:
                    del self.boxes[box], self.ports[box]

        def rest(paths: list[Path]) -> Iterator[None]:
            """Junctions on which no power port of the left side lies."""
            if not paths:
                yield from lonely([box for box in left.boxes if box not in self.boxes])
                return
            path, *others = paths
            if path in self.rule.powered:
                for image in [self.junctions[path]] if path in self.junctions else sorted(self.host.junctions):
                    for _ in junction(path, image):
                        yield from rest(others)
            else:
                for number in range(len(self.host.states)):
                    for _ in state(path, number):
                        yield from rest(others)

        def lonely(boxes: list[Path]) -> Iterator[None]:
            """Boxes of which the left side names no port."""
            if not boxes:
                yield
                return
            for there in self._candidates(boxes[0]):
                self.boxes[boxes[0]], self.ports[boxes[0]] = there, {}
                yield from lonely(boxes[1:])
                del self.boxes[boxes[0]], self.ports[boxes[0]]

        for _ in port(0):
            yield self._found()

    def _connected(self) -> "list[tuple[Path, list[tuple[Path, Port]]]]":
        """The boxes with ports, each after a neighbour if it has one."""
        waiting = {box: sorted(c.ports.items()) for box, c in sorted(self.rule.left.boxes.items()) if c.ports}
        out: list[tuple[Path, list[tuple[Path, Port]]]] = []
        reached: set[Path] = set()
        while waiting:
            box = max(waiting, key=lambda b: (sum(p.junction in reached for _, p in waiting[b]), len(waiting[b])))
            reached |= {port.junction for _, port in waiting[box]}
            out.append((box, sorted(waiting.pop(box), key=lambda item: item[1].junction not in reached)))
        return out

    def _candidates(self, box: Path) -> list[Path]:
        taken = set(self.boxes.values()) if self.injective else set[Path]()
        ports = self.rule.left.boxes[box].ports.values()
        known = {self.junctions[port.junction] for port in ports if port.power and port.junction in self.junctions}
        boxes = self.host.boxes
        for junction in known:
            boxes = boxes & self.around[junction]
        return sorted(boxes - taken)

    def _taken(self) -> set[Path]:
        return set(self.junctions.values())

    def _found(self) -> Renaming:
        classes = self.rule.left.classes
        handles = {path: self.host.handle(self.states[group]) for path, group in classes.items()}
        junctions = {path: self.junctions.get(path, handles[path]) for path in sorted(classes)}
        ports = {box: dict(names) for box, names in sorted(self.ports.items())}
        return Renaming(dict(sorted(self.boxes.items())), junctions, ports)
