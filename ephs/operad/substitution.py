"""Substitution: patterns into boxes of a pattern. This is the one place where names of levels are joined."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

from ephs.operad.directory import Directory
from ephs.operad.errors import PatternError
from ephs.operad.links import closure
from ephs.operad.names import Path, PathLike, paths_text
from ephs.operad.normal import powered
from ephs.operad.pattern import Box, Junction, Pattern, Port
from ephs.operad.quantities import Interface, interface_text
from ephs.operad.wellformed import box_of

__all__ = ["substitute"]

Wires = dict[Path, dict[Path, Port]]
Links = list[tuple[Path, ...]]


def substitute(pattern: Pattern, fillings: Mapping[Path, object]) -> Pattern:
    """Put patterns into boxes; see `Pattern.substitute`."""
    inner = {box: _require_filling(pattern, box, filling) for box, filling in fillings.items()}
    if pattern.is_identity:
        return next((_adopt(filling, pattern.interface) for filling in inner.values()), pattern)
    # An identity changes nothing: its box at the root path keeps the box' name.
    inner = {box: filling for box, filling in inner.items() if not filling.is_identity}
    if not inner:
        return pattern
    junctions: dict[Path, Junction] = dict(pattern.junctions)
    wires: Wires = {}
    links: Links = [tuple(group) for group in pattern.links]
    for box, content in pattern.boxes.items():
        filling = inner.get(box)
        if filling is None:
            wires[box] = dict(content.ports)
        else:
            _insert(box, content, filling, junctions, wires, links)
    return _tidied(junctions, wires, links)


def _insert(
    box: Path, content: Box, filling: Pattern, junctions: dict[Path, Junction], wires: Wires, links: Links
) -> None:
    """Add the filling's junctions, boxes and links, renamed."""
    target: dict[Path, Path] = {}
    for path, inner in filling.junctions.items():
        if inner.exposed and inner.power:
            target[path] = content.ports[path].junction  # absorbed
            continue
        target[path] = box / path
        junctions[box / path] = Junction(inner.quantity)
        if inner.exposed:
            # Its power balance stays its own; only the state is shared.
            links.append((box / path, content.ports[path].junction))
    links += [tuple(target[path] for path in group) for group in filling.links]
    for name, lower in filling.boxes.items():
        wires[box / name] = {p: Port(target[port.junction], port.power) for p, port in lower.ports.items()}


def _tidied(junctions: Mapping[Path, Junction], wires: Wires, links: Iterable[tuple[Path, ...]]) -> Pattern:
    """Drop the junctions that are mere handles on a state which another junction of their class has, too."""
    boxes = {box: box_of(Directory(ports), junctions) for box, ports in wires.items()}
    bearing = powered(junctions, boxes)
    moved: dict[Path, Path] = {}
    for members in set(closure(junctions, links).values()):
        handles = {path for path in members if path not in bearing and not junctions[path].exposed}
        if len(members) > 1 and handles:
            first = _representative(members, bearing, junctions)
            moved.update({path: first for path in handles if path != first})
    if not moved:
        return _checked(junctions, boxes, links)
    kept = {path: junction for path, junction in junctions.items() if path not in moved}
    redirected = [(box, _redirect(ports, moved)) for box, ports in wires.items()]
    remaining = [tuple(moved.get(path, path) for path in group) for group in links]
    return _checked(kept, {box: box_of(ports, kept) for box, ports in redirected}, remaining)


def _representative(members: frozenset[Path], bearing: frozenset[Path], junctions: Mapping[Path, Junction]) -> Path:
    if power := members & bearing:
        return min(power)
    if exposed := [path for path in members if junctions[path].exposed]:
        return min(exposed)
    return min(members, key=lambda path: (len(path), path))


def _redirect(ports: Mapping[Path, Port], moved: Mapping[Path, Path]) -> Directory[Port]:
    return Directory([(p, Port(moved.get(port.junction, port.junction), port.power)) for p, port in ports.items()])


def _checked(
    junctions: Mapping[Path, Junction], boxes: Mapping[Path, Box], links: Iterable[tuple[Path, ...]]
) -> Pattern:
    groups = [group for group in links if len(set(group)) > 1]
    return Pattern(junctions, boxes, groups)


def _adopt(filling: Pattern, interface: Interface) -> Pattern:
    """The filling of an identity's box: the filling itself, in the frames of the outer interface."""
    if filling.interface == interface:
        return filling
    pairs: list[tuple[PathLike, Junction]] = [
        (path, replace(inner, quantity=interface[path].quantity) if inner.exposed else inner)
        for path, inner in filling.junctions.items()
    ]
    return Pattern.identity(interface) if filling.is_identity else Pattern(pairs, filling.boxes, filling.links)


def _require_filling(pattern: Pattern, box: Path, filling: object) -> Pattern:
    if box not in pattern.boxes:
        raise PatternError("unknown-box", box=box, found=str(box), expected=paths_text(pattern.boxes))
    if not isinstance(filling, Pattern):
        expected = "a Pattern; call the pattern to fill boxes with systems or primitives"
        raise PatternError("filling-type", box=box, found=type(filling).__name__, expected=expected)
    wanted, given = pattern.boxes[box].interface, filling.interface
    if faults := _differences(wanted, given):
        found, expected = interface_text(given), interface_text(wanted)
        first = min(wanted.keys() ^ given.keys() or _differing(wanted, given))
        raise PatternError("interface", box=box, port=first, found=found, expected=expected, ports="; ".join(faults))
    return filling


def _differing(wanted: Interface, given: Interface) -> list[Path]:
    return [
        port
        for port in sorted(wanted.keys() & given.keys())
        if wanted[port].power != given[port].power or not wanted[port].quantity.matches(given[port].quantity)
    ]


def _differences(wanted: Interface, given: Interface) -> list[str]:
    faults: list[str] = []
    if missing := wanted.keys() - given.keys():
        faults.append(f"missing {paths_text(missing)}")
    if extra := given.keys() - wanted.keys():
        faults.append(f"extra {paths_text(extra)}")
    if differing := _differing(wanted, given):
        faults.append(f"differing {paths_text(differing)}")
    return faults
