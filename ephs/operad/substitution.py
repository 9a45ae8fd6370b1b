"""Substitution: patterns into boxes of a pattern. This is the one place where names of levels are joined."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

from ephs.operad.directory import Directory
from ephs.operad.errors import PatternError
from ephs.operad.frames import in_united_frames, met, retyped, with_junctions
from ephs.operad.links import closure
from ephs.operad.matching import require_interface
from ephs.operad.names import ROOT, Path, paths_text
from ephs.operad.nesting import Nesting
from ephs.operad.normal import powered
from ephs.operad.parts import Box, Junction, Port
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import Quantity
from ephs.operad.wellformed import box_of, require_one_quantity


def substitute(pattern: Pattern, fillings: Mapping[Path, object]) -> Pattern:
    """Put patterns into boxes; see `Pattern.substitute`."""
    inner = {box: Nesting(_require_pattern(pattern, box, filling)) for box, filling in fillings.items()}
    return flatten(Nesting(pattern, inner))


def flatten(nesting: Nesting) -> Pattern:
    """Substitute the patterns of all levels in one pass; see `Nesting.flatten`."""
    while nesting.pattern.is_identity and nesting.children:
        nesting = _through_identity(ROOT, nesting)
    if not nesting.children:
        return nesting.pattern
    whole = _Whole(dict(nesting.pattern.junctions), {}, [tuple(group) for group in nesting.pattern.links], set())
    # Each level knows what its junctions are called in the whole. A list, as recursion would bound the depth;
    # of iterators, as boxes keep their order.
    top = _FlatteningLevel(ROOT, nesting, {path: path for path in nesting.pattern.junctions}, same=False)
    changed = False
    pending = [(top, iter(nesting.pattern.boxes.items()))]
    while pending:
        level, boxes = pending[-1]
        for box, content in boxes:
            path = level.path / box if level.path else box
            child = level.nesting.children.get(box)
            if child is not None:
                require_interface(path, content.interface, child.pattern.interface)
                while child.pattern.is_identity and child.children:
                    child = _through_identity(path, child)
            if child is None or child.pattern.is_identity:  # an identity gives frames alone: its box keeps the name
                for port, kind in child.pattern.interface.items() if child is not None else ():
                    changed |= whole.met(level.target[content.ports[port].junction], kind.quantity, path, port)
                whole.boxes[path] = _moved(content, level, whole.junctions)
                continue
            changed = True
            pending.append((_opened(path, content, child, level, whole), iter(child.pattern.boxes.items())))
            break
        else:
            pending.pop()
    return _tidied(whole) if changed else nesting.pattern


@final
@dataclass(frozen=True, slots=True)
class _Whole:
    """Parts of the flattened pattern under construction, and its junctions that gained a frame."""

    junctions: dict[Path, Junction]
    boxes: dict[Path, Box]
    links: list[tuple[Path, ...]]
    gained: set[Path]

    def met(self, junction: Path, quantity: Quantity, box: Path, port: Path) -> bool:
        """Unite the frame of a port of a filling with that of its junction; whether the junction gained one."""
        found = met(self.junctions, junction, quantity, box, port)
        if found:
            self.gained.add(junction)
        return found


@final
@dataclass(frozen=True, slots=True)
class _FlatteningLevel:
    """State of the flattening of a nesting: its path, and the names of its junctions in the whole."""

    path: Path
    nesting: Nesting
    target: Mapping[Path, Path]
    same: bool
    """Whether its junctions have their own quantities in the whole: then interfaces of boxes stay the same objects."""


def _opened(box: Path, content: Box, child: Nesting, outer: _FlatteningLevel, whole: _Whole) -> _FlatteningLevel:
    """Add the child's own junctions and links to the whole."""
    filling = child.pattern
    target: dict[Path, Path] = {}
    for path, inner in filling.junctions.items():
        if inner.exposed and inner.power:
            target[path] = outer.target[content.ports[path].junction]  # absorbed
            whole.met(target[path], inner.quantity, box, path)
            continue
        target[path] = kept = box / path
        whole.junctions[kept] = Junction(inner.quantity) if inner.exposed else inner
        if inner.exposed:
            # Its power balance stays its own; only the state is shared.
            whole.links.append((kept, outer.target[content.ports[path].junction]))
    whole.links.extend(tuple(target[path] for path in group) for group in filling.links)
    same = all(whole.junctions[target[path]].quantity is inner.quantity for path, inner in filling.junctions.items())
    return _FlatteningLevel(box, child, target, same)


def _moved(content: Box, level: _FlatteningLevel, new: Mapping[Path, Junction]) -> Box:
    """The box with its ports on the junctions of the whole."""
    target, old = level.target, level.nesting.pattern.junctions
    ports: dict[Path, Port] = {}
    same = True
    for name, port in content.ports.items():
        junction = target[port.junction]
        ports[name] = port if junction is port.junction else Port(junction, port.power)
        # Where no frame was gained or lost the interface stays the same object.
        same = level.same or (same and new[junction].quantity is old[port.junction].quantity)
    found = Directory.trusted(ports)
    return Box(found, content.interface) if same else box_of(found, new)


def _tidied(whole: _Whole) -> Pattern:
    """The pattern without redundant handles: junctions whose state another junction of their class has, too."""
    classes = closure(whole.links)
    require_one_quantity(whole.junctions, classes)
    if whole.gained:
        whole.boxes.update(retyped(whole.boxes, whole.junctions, whole.gained))
    junctions, found = in_united_frames(Directory.trusted(whole.junctions), Directory.trusted(whole.boxes), classes)
    if not whole.links:
        return Pattern.trusted(junctions, found, {})
    bearing = powered(whole.junctions, whole.boxes)
    moved: dict[Path, Path] = {}
    for members in set(classes.values()):
        handles = {path for path in members if path not in bearing and not junctions[path].exposed}
        if handles:
            first = _representative(members, bearing, junctions)
            moved.update({path: first for path in handles if path != first})
    if moved:
        junctions = Directory.trusted({path: value for path, value in junctions.items() if path not in moved})
        classes = closure([path for path in group if path not in moved] for group in set(classes.values()))
    boxes = dict(found)
    for box, content in found.items():
        if not moved.keys().isdisjoint(port.junction for port in content.ports.values()):
            boxes[box] = box_of(_redirected(content.ports, moved), junctions)
    return Pattern.trusted(junctions, Directory.trusted(boxes), classes)


def _representative(members: frozenset[Path], bearing: frozenset[Path], junctions: Mapping[Path, Junction]) -> Path:
    if power := members & bearing:
        return min(power)
    if exposed := [path for path in members if junctions[path].exposed]:
        return min(exposed)
    return min(members, key=lambda path: (len(path), path))


def _redirected(ports: Mapping[Path, Port], moved: Mapping[Path, Path]) -> Directory[Port]:
    return Directory.trusted(
        {name: Port(moved.get(port.junction, port.junction), port.power) for name, port in ports.items()}
    )


def _through_identity(box: Path, nesting: Nesting) -> Nesting:
    """Filling of an identity's box, in the frames of both."""
    (child,) = nesting.children.values()
    interface, filling = nesting.pattern.interface, child.pattern
    require_interface(box, interface, filling.interface)
    junctions = dict(filling.junctions)
    if any([met(junctions, path, kind.quantity, box, path) for path, kind in interface.items()]):
        filling = with_junctions(filling, junctions)
    return Nesting(filling, child.children)


def _require_pattern(pattern: Pattern, box: Path, filling: object) -> Pattern:
    if box not in pattern.boxes:
        raise PatternError("unknown-box", box=box, found=str(box), expected=paths_text(pattern.boxes))
    if not isinstance(filling, Pattern):
        expected = "a Pattern; call the pattern to fill boxes with systems or primitives"
        raise PatternError("filling-type", box=box, found=type(filling).__name__, expected=expected)
    return filling
