"""Patterns as graphs: isomorphism up to renaming, symmetries, and a hash independent of names.

Two graphs are used. The bipartite one, `to_networkx`, has boxes and junctions as nodes and ports as edges, for people.
The incidence graph makes nodes of ports and state classes too, so that it is simple and all that counts is a label
of a node: this is what isomorphisms are sought on, by VF2++.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from typing import TYPE_CHECKING, Any, cast, final

from ephs.operad.canonical import rank
from ephs.operad.names import Path
from ephs.operad.normal import powered
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import Quantity

if TYPE_CHECKING:
    import networkx as nx

Node = tuple[str, Any]
"""Kind and name of each vertex, to read the isomorphism from."""


@final
@dataclass(frozen=True, slots=True)
class Renaming:
    """New names for boxes, junctions and ports, as `Pattern.rename` takes them; names that stay are among them."""

    boxes: Mapping[Path, Path] = field(default_factory=dict[Path, Path])
    junctions: Mapping[Path, Path] = field(default_factory=dict[Path, Path])
    ports: Mapping[Path, Mapping[Path, Path]] = field(default_factory=dict[Path, Mapping[Path, Path]])

    def __call__(self, pattern: Pattern) -> Pattern:
        """Rename a pattern."""
        return pattern.rename(boxes=self.boxes, junctions=self.junctions, ports=self.ports)

    def __str__(self) -> str:
        kinds = {"box": self.boxes, "junction": self.junctions}
        lines = [f"{kind} {old} → {new}" for kind, names in kinds.items() for old, new in names.items()]
        lines += [f"port {box}.{old} → {new}" for box, names in self.ports.items() for old, new in names.items()]
        return "\n".join(lines) or "nothing to rename"


def to_networkx(pattern: Pattern) -> "nx.MultiGraph[Any]":
    """The bipartite graph of boxes and junctions; see `Pattern.to_networkx`."""
    import networkx as nx

    graph: nx.MultiGraph[Any] = nx.MultiGraph()
    bearing = powered(pattern.junctions, pattern.boxes)
    for box in pattern.boxes:
        graph.add_node(("box", box), bipartite=0)
    for path, junction in pattern.junctions.items():
        exposed = None if not junction.exposed else "power" if junction.power else "state"
        graph.add_node(
            ("junction", path),
            bipartite=1,
            quantity=junction.quantity,
            exposed=exposed,
            power=path in bearing,
            state_class=pattern.state_class(path),
        )
    for box, content in pattern.boxes.items():
        for name, port in content.ports.items():
            graph.add_edge(("box", box), ("junction", port.junction), key=name, power=port.power)
    return graph


def isomorphism(first: Pattern, second: Pattern, *, fix_interface: bool) -> Renaming | None:
    """A renaming that makes the first pattern equal to the second; see `Pattern.isomorphic`."""
    if first.is_identity != second.is_identity:
        return None
    one, two = _incidence(first, fix_interface), _incidence(second, fix_interface)
    found = _search(one, two, _refined(one), _refined(two))
    return None if found is None else _renaming(first, second, found)


def automorphisms(pattern: Pattern, *, fix_interface: bool) -> int:
    """Number of renamings that preserve the pattern; see `Pattern.automorphisms`.

    By orbits and stabilisers: fix one node after the other, and multiply by the number of places that it could take.
    """
    graph = _incidence(pattern, fix_interface)
    colours = _refined(graph)
    count, fixed = 1, 0
    while True:
        sizes = Counter(colours.values())
        crowded = [node for node in graph.nodes if sizes[colours[node]] > 1]
        if not crowded:
            return count
        pivot = min(crowded, key=lambda node: sizes[colours[node]])  # the smallest orbits first
        orbit = 0
        cell = [node for node in graph.nodes if colours[node] == colours[pivot]]
        mark = f"fixed {fixed}"
        held = _refined(graph, colours | {pivot: mark}, pivot)
        for node in cell:
            image = held if node == pivot else _refined(graph, colours | {node: mark}, node)
            orbit += node == pivot or _search(graph, graph, held, image) is not None
        count *= orbit
        colours, fixed = held, fixed + 1


def canonical_hash(pattern: Pattern) -> str:
    """A hash that isomorphic patterns share; see `Pattern.canonical_hash`."""
    colours = _refined(_incidence(pattern, False))
    return sha256(repr(sorted(colours.values())).encode()).hexdigest()


def _incidence(pattern: Pattern, fix_interface: bool) -> "nx.Graph[Any]":
    """Boxes, ports, power junctions, state classes and outer ports as nodes, with all that counts as their label."""
    import networkx as nx

    graph: nx.Graph[Any] = nx.Graph()
    form = pattern.normal_form
    for box in sorted(form.boxes):  # sorted, so that the same renaming is found each time
        graph.add_node(("box", box), label="box")
    for path, junction in sorted(form.junctions.items(), key=lambda item: item[0]):
        name = str(path) if fix_interface and junction.exposed else ""
        graph.add_node(("junction", path), label=f"junction {junction.exposed} {_words(junction.quantity)} {name}")
        for port in sorted(junction.ports):
            _add_port(graph, port, "power", ("junction", path))
    for each in sorted(form.classes, key=rank):
        graph.add_node(("class", each), label=f"class {_words(each.quantity)}")
        for member in each.members:
            graph.add_edge(("class", each), ("junction", member))
        for port in sorted(each.ports):
            _add_port(graph, port, "state", ("class", each))
        for path, quantity in each.outer:
            name = str(path) if fix_interface else ""
            graph.add_node(("outer", path), label=f"outer state port {_words(quantity)} {name}")
            graph.add_edge(("outer", path), ("class", each))
            if path in form.junctions:  # the outer port and the junction have one name
                graph.add_edge(("outer", path), ("junction", path))
    return graph


def _add_port(graph: "nx.Graph[Any]", port: tuple[Path, Path], kind: str, end: Node) -> None:
    graph.add_node(("port", port), label=f"{kind} port")
    graph.add_edge(("port", port), ("box", port[0]))
    graph.add_edge(("port", port), end)


def _words(quantity: Quantity) -> str:
    """Full definition of a quantity as text, the same in every process."""
    return f"{quantity.kind!r} {quantity.space!r} {quantity.parity} {quantity.frame!r}"


def _refined(
    graph: "nx.Graph[Any]", colours: Mapping[Node, str] | None = None, pivot: Node | None = None
) -> dict[Node, str]:
    """Colour refinement: split colours by those of the neighbours until the partition is stable.

    Colours are digests, so they do not depend on names, order or process. Only neighbours of what changed are looked
    at again: a node none of whose neighbours changed keeps its colour, which no changed one can have.

    Parameters
    ----------
    colours, pivot
        Refined colours to go on from, but for the pivot's.
    """
    now = dict(colours) if colours is not None else {node: str(data["label"]) for node, data in graph.nodes(data=True)}
    sizes = Counter(now.values())
    affected: Iterable[Node] = graph if colours is None else graph[pivot]
    while affected:
        parts: dict[str, dict[str, list[Node]]] = {}
        for node in affected:
            signature = _digest(now[node], *sorted(now[other] for other in graph[node]))
            parts.setdefault(now[node], {}).setdefault(signature, []).append(node)
        changed: list[Node] = []
        for colour, split in parts.items():
            if len(split) == 1 and sum(map(len, split.values())) == sizes[colour]:
                continue
            for signature, nodes in split.items():
                sizes[colour] -= len(nodes)
                sizes[signature] += len(nodes)
                changed += nodes
                now |= dict.fromkeys(nodes, signature)
        affected = {other for node in changed for other in graph[node]}
    return now


def _digest(*words: str) -> str:
    return sha256("\x00".join(words).encode()).hexdigest()[:32]


def _search(
    one: "nx.Graph[Any]", two: "nx.Graph[Any]", first: Mapping[Node, str], second: Mapping[Node, str]
) -> dict[Node, Node] | None:
    import networkx as nx

    if Counter(first.values()) != Counter(second.values()):
        return None
    if not first:
        return {}
    for graph, colours in ((a := one.copy(), first), (b := two.copy(), second)):
        for node, colour in colours.items():
            graph.nodes[node]["colour"] = colour
    found: object = nx.vf2pp_isomorphism(a, b, node_label="colour")  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]
    return cast("dict[Node, Node] | None", found)


def _renaming(first: Pattern, second: Pattern, found: Mapping[Node, Node]) -> Renaming:
    boxes: dict[Path, Path] = {}
    junctions: dict[Path, Path] = {}
    ports: dict[Path, dict[Path, Path]] = {box: {} for box in first.boxes}
    for (kind, old), (_, new) in found.items():
        match kind:
            case "box":
                boxes[old] = new
            case "port":
                ports[old[0]][old[1]] = new[1]
            case "junction" | "outer":
                junctions[old] = new
            case _:
                pass
    fresh = _fresh(second)
    # Only handles remain; neither their number nor their names matter.
    junctions |= {path: next(fresh) for path in first.junctions if path not in junctions}
    return Renaming(
        dict(sorted(boxes.items())),
        dict(sorted(junctions.items())),
        {box: dict(sorted(names.items())) for box, names in sorted(ports.items())},
    )


def _fresh(pattern: Pattern) -> Iterator[Path]:
    taken = {path[0] for path in (*pattern.boxes, *pattern.junctions) if path}
    number = 0
    while True:
        name = f"state{number}"
        number += 1
        if name not in taken:
            yield Path((name,))
