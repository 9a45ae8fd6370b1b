"""Well-formed patterns: reading of user input, and the conditions P1 to P5."""

from collections.abc import Iterable, Mapping
from typing import Any, cast

from ephs.operad.directory import Directory, Entries, first_clash
from ephs.operad.errors import PatternError
from ephs.operad.links import closure
from ephs.operad.messages import nearest_of
from ephs.operad.names import ROOT, Path, PathLike, paths_text
from ephs.operad.parts import Box, Junction, Port
from ephs.operad.pattern import Boxes
from ephs.operad.quantities import PortType

_PORTS = 'port name -> junction name, "~name" for a state port'


def read_junctions(junctions: Entries[Junction]) -> Directory[Junction]:
    """The junctions of a pattern."""
    found = Directory(junctions, what="junctions")
    for path, value in cast("Directory[object]", found).items():
        if not isinstance(value, Junction):
            expected = "a junction; write junction(quantity)"
            raise PatternError("junction-type", junction=path, found=repr(value), expected=expected)
    return found


def read_boxes(boxes: Boxes, junctions: Mapping[Path, Junction]) -> Directory[Box]:
    """The boxes of a pattern; each port is on exactly one junction and has its quantity (P1, P2)."""
    found = Directory(cast("Entries[object]", boxes), what="boxes")
    return Directory.trusted({path: _read_box(path, value, junctions) for path, value in found.items()})


def _read_box(box: Path, value: object, junctions: Mapping[Path, Junction]) -> Box:
    if isinstance(value, Box):
        value = value.ports
    if not isinstance(value, Mapping):
        raise PatternError("box-type", box=box, found=repr(value), expected=f"a mapping: {_PORTS}")
    wires = Directory(cast("Mapping[Path, object]", value), what=f"ports of box {box}")
    ports = Directory.trusted({name: _read_port(box, name, wire) for name, wire in wires.items()})
    if ROOT in ports:
        raise PatternError("root-port", box=box, port=ROOT, found="a port at the root path", expected="a name")
    for name, port in ports.items():
        if port.junction not in junctions:
            expected = paths_text(junctions) + nearest_of(port.junction, map(str, junctions))
            raise PatternError("unknown-junction", box=box, port=name, junction=port.junction, expected=expected)
    return box_of(ports, junctions)


def _read_port(box: Path, name: Path, wire: object) -> Port:
    if isinstance(wire, Port):
        return wire
    if not isinstance(wire, str | tuple):
        raise PatternError("port-type", box=box, port=name, found=repr(wire), expected='"name" or "~name"')
    name_of = cast("PathLike", wire)
    if isinstance(name_of, str) and name_of.startswith("~"):
        return Port(Path.of(name_of[1:]), False)
    return Port(Path.of(name_of), True)


def box_of(ports: Directory[Port], junctions: Mapping[Path, Junction]) -> Box:
    """A box with its interface, which follows from its ports and their junctions."""
    types = {name: PortType(junctions[port.junction].quantity, port.power) for name, port in ports.items()}
    return Box(ports, Directory.trusted(types))


def read_links(links: Iterable[Iterable[PathLike]], junctions: Mapping[Path, Junction]) -> list[list[Path]]:
    """The groups of junctions that share their state."""
    groups: list[list[Path]] = []
    for link in cast("Iterable[Any]", links):
        if isinstance(link, str | Path):
            raise PatternError("link-size", found=repr(link))
        group = list(dict.fromkeys(Path.of(name) for name in link))
        for path in group:
            if path not in junctions:
                found, expected = " ~ ".join(map(str, group)), paths_text(junctions)
                raise PatternError("link-junction", found=found, junction=path, expected=expected)
        if len(group) < 2:
            raise PatternError("link-size", found=" ~ ".join(map(str, group)) or "()")
        groups.append(group)
    return groups


def read_fillings(mapping: Mapping[Any, Any] | None, named: Mapping[str, Any]) -> dict[Path, Any]:
    """Fillings of boxes by path: a mapping, and keywords for names without dots."""
    pairs = cast("list[tuple[PathLike, object]]", [*(mapping or {}).items(), *named.items()])
    out: dict[Path, Any] = {}
    for name, filling in pairs:
        path = Path.of(name)
        if path in out:
            raise PatternError("duplicate", found=str(path), expected="expected each box once", what="fillings")
        out[path] = filling
    return out


def require_named_boxes(boxes: Mapping[Path, Box]) -> None:
    """Refuse a box at the root path: the identity alone has one."""
    if ROOT in boxes:
        raise PatternError("root-box", box=ROOT, found=paths_text(boxes), expected="named boxes")


def require_pattern(
    junctions: Directory[Junction], boxes: Directory[Box], links: Iterable[Iterable[Path]]
) -> Mapping[Path, frozenset[Path]]:
    """Check the conditions, and return the classes under "same state", by each junction that is linked."""
    if ROOT in junctions:
        raise PatternError("root-junction", junction=ROOT, found="a junction at the root path", expected="a name")
    if ROOT not in boxes:
        _require_disjoint(junctions, boxes)
    classes = closure(links)
    require_one_quantity(junctions, classes)
    _require_inner_ports(junctions, boxes, classes)
    return classes


def _require_disjoint(junctions: Mapping[Path, Junction], boxes: Mapping[Path, Box]) -> None:
    """P5: no junction's path equals, starts or continues a box's path."""
    if not junctions.keys().isdisjoint(boxes):
        path = min(junctions.keys() & boxes.keys())
        raise PatternError("p5", box=path, junction=path, found=str(path), expected="prefix-free paths")
    for paths, others in ((boxes, junctions), (junctions, boxes)):
        if clash := first_clash(paths, others):
            box, other = clash if paths is boxes else reversed(clash)
            found = f"{clash[0]}, {clash[1]}"
            raise PatternError("p5", box=box, junction=other, found=found, expected="prefix-free paths")


def require_one_quantity(junctions: Mapping[Path, Junction], classes: Mapping[Path, frozenset[Path]]) -> None:
    """P1 for linked junctions: they share a state, so they have one quantity."""
    for members in sorted(set(classes.values()), key=min):
        paths = sorted(members)
        quantities = [junctions[path].quantity for path in paths]
        for path, quantity in zip(paths, quantities, strict=True):
            if not quantity.matches(quantities[0]):
                found = f"{quantity} at {path}, {quantities[0]} at {paths[0]}"
                names = " and ".join(map(str, paths))
                raise PatternError("link-quantity", junction=names, found=found, expected="one quantity")


def _require_inner_ports(
    junctions: Mapping[Path, Junction], boxes: Mapping[Path, Box], classes: Mapping[Path, frozenset[Path]]
) -> None:
    """P4; an exposed junction may instead be linked to one with an inner port, as substitution makes them."""
    wired = {port.junction for box in boxes.values() for port in box.ports.values()}
    for path, junction in junctions.items():
        if path not in wired and not (junction.exposed and classes.get(path, frozenset()) & wired):
            raise PatternError("no-inner-port", junction=path, found=str(junction), expected="an inner port")
