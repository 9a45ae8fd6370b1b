"""Strategies for names, quantities, interfaces, patterns and nestings of patterns."""

from collections.abc import Iterable

from hypothesis import strategies as st
from hypothesis.errors import InvalidArgument

from ephs.operad import (
    ROOT,
    Directory,
    Interface,
    Junction,
    Nesting,
    Path,
    Pattern,
    Port,
    PortType,
    Quantity,
    Space,
    quantity,
)

_KNOWN = (
    quantity.momentum,
    quantity.displacement,
    quantity.entropy,
    quantity.angle,
    quantity.angular_momentum,
    quantity.charge,
    quantity.flux_linkage,
    quantity.volume,
    quantity.amount,
    quantity.species("H2O", H=2, O=1),
    quantity.magnetic_flux,
    quantity.liquid,
    quantity.pressure_impulse,
    Quantity("dose", Space("real", 2, 2), 1, domain=(0.5, 4.0), charges=(("water", (1.0, 0.5)),), unit="mg"),
    quantity.pose,
    quantity.body_momentum,
    quantity.direct_pose,
    quantity.direct_momentum,
)
CHAIN = st.sampled_from((0, 0, 0, 0, 0, 1, 2, 3))
"""How many identities there are around a level."""
_PAIRS = ("revolute", "prismatic", "cylindrical", "planar", "spherical", "fixed", "free")


@st.composite
def paths(draw: st.DrawFn, *, min_size: int = 1, max_size: int = 2) -> Path:
    """Paths of short names, by default not the root."""
    _require(0 <= min_size <= max_size, f"min_size={min_size} and max_size={max_size}: expected 0 <= min <= max")
    name = st.text("abpq", min_size=1, max_size=2)
    return Path(draw(st.lists(name, min_size=min_size, max_size=max_size)))


@st.composite
def quantities(draw: st.DrawFn, *, frames: bool = True) -> Quantity:
    """The quantities of this package, joint quantities of any kind, one of our own, with or without a frame."""
    found = draw(st.sampled_from(_KNOWN))
    if draw(st.booleans()):
        kind = draw(st.sampled_from(_PAIRS))
        found = draw(st.sampled_from([quantity.relative_pose(kind), quantity.joint_momentum(kind)]))
    if frames and draw(st.booleans()):
        found = found.in_frame(draw(st.sampled_from(["B", "C1", "C2"])))
    return found


@st.composite
def interfaces(
    draw: st.DrawFn,
    *,
    min_ports: int = 0,
    max_ports: int = 4,
    state_ports: bool = True,
    of: st.SearchStrategy[Quantity] | None = None,
) -> Interface:
    """Interfaces, the empty one included.

    Parameters
    ----------
    of
        Quantities of the ports; any where not given.
    state_ports
        Whether ports may be state ports.
    """
    _require(0 <= min_ports <= max_ports, f"min_ports={min_ports}, max_ports={max_ports}: expected 0 <= min <= max")
    names = fresh_paths(draw, draw(st.integers(min_ports, max_ports)), ())
    power = st.just(True) if not state_ports else st.booleans().map(lambda flag: not flag)
    kinds = quantities() if of is None else of
    found: dict[Path, PortType] = {}
    for name in names:
        found[name] = PortType(draw(_again(draw, [port.quantity for port in found.values()], kinds)), draw(power))
    return Directory(found)


def _again(draw: st.DrawFn, present: list[Quantity], kinds: st.SearchStrategy[Quantity]) -> st.SearchStrategy[Quantity]:
    """Half of the time a quantity that there is, or few junctions could be linked."""
    return st.sampled_from(present) if present and draw(st.booleans()) else kinds


@st.composite
def patterns(
    draw: st.DrawFn,
    *,
    interface: Interface | None = None,
    min_boxes: int = 0,
    max_boxes: int = 3,
    max_inner_junctions: int = 3,
    state_ports: bool = True,
    links: bool = True,
    identities: bool = True,
    of: st.SearchStrategy[Quantity] | None = None,
) -> Pattern:
    """Patterns of every well-formed shape.

    Among them are patterns with two ports of one box on a junction, junctions with state ports only,
    junctions with a single port, boxes without ports, exposed junctions whose ports are all on a linked one,
    and identities.

    Parameters
    ----------
    interface
        The outer interface; any if it is not given.
    min_boxes, max_boxes, max_inner_junctions
        How many boxes and unexposed junctions there may be.
    state_ports
        Whether inner ports, and outer ones of an interface not given, may be state ports.
    links
        Whether junctions may be linked.
    identities
        Whether identities are among them; they have one box.
    of
        Quantities of the junctions; any where not given.

    Raises
    ------
    hypothesis.errors.InvalidArgument
        When drawn, if there is no such pattern.
    """
    _require(0 <= min_boxes <= max_boxes, f"min_boxes={min_boxes}, max_boxes={max_boxes}: expected 0 <= min <= max")
    _require(max_boxes > 0 or not interface, "an outer port needs an inner one: expected max_boxes >= 1")
    most = 3 if max_boxes else 0
    kinds = quantities() if of is None else of
    outer = draw(interfaces(max_ports=most, state_ports=state_ports, of=of)) if interface is None else interface
    has_state = any(not port.power for port in outer.values())
    unary = identities and min_boxes <= 1 <= max_boxes and (state_ports or not has_state)
    # Behind the highest of a few numbers, so that shrinking leaves it.
    if unary and draw(st.integers(0, 7)) == 7:
        return Pattern.identity(outer)
    count = draw(st.integers(max(min_boxes, 1 if outer else 0), max_boxes))
    boxes = fresh_paths(draw, count, outer)
    inner = draw(st.integers(0, max_inner_junctions)) if boxes else 0
    junctions = {path: Junction(port.quantity, True, port.power) for path, port in outer.items()}
    for path in fresh_paths(draw, inner, [*outer, *boxes]):
        present = [junction.quantity for junction in junctions.values()]
        junctions[path] = Junction(draw(_again(draw, present, kinds)))
    groups = _groups(draw, junctions) if links else []
    wires = _wires(draw, junctions, boxes, groups, state_ports)
    return Pattern(junctions, wires, groups)


def _groups(draw: st.DrawFn, junctions: dict[Path, Junction]) -> list[list[Path]]:
    alike: dict[Quantity, list[Path]] = {}
    for path, junction in junctions.items():
        alike.setdefault(junction.quantity, []).append(path)
    return [
        draw(st.one_of(st.lists(st.sampled_from(members), min_size=2, unique=True), st.just(members)))
        for members in alike.values()
        if len(members) > 1 and draw(st.booleans())
    ]


def _wires(
    draw: st.DrawFn,
    junctions: dict[Path, Junction],
    boxes: list[Path],
    groups: list[list[Path]],
    state_ports: bool,
) -> list[tuple[Path, Directory[Port]]]:
    ends: dict[Path, list[Port]] = {box: [] for box in boxes}
    power = st.just(True) if not state_ports else st.booleans().map(lambda flag: not flag)
    bare: set[Path] = set()
    for path, junction in junctions.items():
        partners = {other for group in groups if path in group for other in group}
        # One of a group may do without inner ports, the others then have some.
        if junction.exposed and partners and not partners & bare and draw(st.booleans()):
            bare.add(path)
            continue
        for _ in range(draw(st.integers(1, 3))):
            ends[draw(st.sampled_from(boxes))].append(Port(path, draw(power)))
    return [
        (box, Directory(list(zip(fresh_paths(draw, len(ports), ()), ports, strict=True))))
        for box, ports in ends.items()
    ]


def fresh_paths(draw: st.DrawFn, count: int, taken: Iterable[Path]) -> list[Path]:
    """Draw so many paths that clash neither with each other nor with those taken."""
    found: list[Path] = []
    known = list(taken)
    for _ in range(count):
        path = draw(paths())
        number = 0
        # Clashes are mended, not rejected: a new first name ends them.
        while any(path.is_prefix_of(other) or other.is_prefix_of(path) for other in (*known, *found)):
            path = Path((f"{path[0].rstrip('0123456789')}{number}", *path[1:]))
            number += 1
        found.append(path)
    return found


@st.composite
def nestings(
    draw: st.DrawFn,
    *,
    max_depth: int = 3,
    interface: Interface | None = None,
    max_boxes: int = 3,
    of: st.SearchStrategy[Quantity] | None = None,
) -> Nesting:
    """Trees of patterns that fit into each other, of at most so many levels, and chains of identities around them.

    Parameters
    ----------
    max_depth
        How many levels, identities around others not counted.
    interface
        The outer interface; any if it is not given.
    max_boxes
        How many boxes a pattern may have.
    of
        Quantities of the junctions; any where not given.
    """
    _require(max_depth >= 1, f"max_depth={max_depth}: expected at least one level")
    pattern = draw(patterns(interface=interface, max_boxes=max_boxes, of=of))
    children: dict[Path, Nesting] = {}
    for box, content in pattern.boxes.items():
        if max_depth > 1 and draw(st.booleans()):
            inner = nestings(max_depth=max_depth - 1, interface=content.interface, max_boxes=max_boxes, of=of)
            children[box] = draw(inner)
    found = Nesting(pattern, children)
    for _ in range(draw(CHAIN)):
        found = Nesting(Pattern.identity(pattern.interface), {ROOT: found})
    return found


@st.composite
def fresh_names(draw: st.DrawFn, old: Iterable[Path]) -> dict[Path, Path]:
    """A renaming of all these paths: some swapped among themselves, the others new; none clash."""
    paths = list(old)
    if draw(st.booleans()):
        return dict(zip(paths, draw(st.permutations(paths)), strict=True))
    return dict(zip(paths, fresh_paths(draw, len(paths), ()), strict=True))


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise InvalidArgument(message)
