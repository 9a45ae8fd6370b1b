"""Intervals: networks of conductors of which bounds are known, reduced to their ports.

Interval arithmetic takes what occurs twice for two things, so that bounds depend on the order of eliminations, and
with it on the bracketing of patterns. By every bracketing they enclose what exact conductances give.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import inf
from typing import TypeAlias, final

from ephs.operad import ROOT, Algebra, AlgebraMap, Interface, Lax, Path, Pattern
from ephs.operad.names import PathLike
from ephs.semantics.algebra.interfaces import interface_of
from ephs.semantics.algebra.rational import Coordinate, ExactRelation, exact_relations
from ephs.semantics.bundles.errors import SemanticsError

Node: TypeAlias = tuple[Path, int]
"""A port or junction, and the place in its vectors of flows and efforts."""
Interval: TypeAlias = tuple[Fraction, Fraction]
Edges: TypeAlias = dict[tuple[Node, Node], Interval]
GROUND: Node = (ROOT, 0)
"""State of zero effort."""


@final
@dataclass(frozen=True, slots=True)
class Conductors:
    """Conductors between ports, and from ports to the ground: flow = Σ conductance · difference of efforts.

    Parameters
    ----------
    interface
        The ports; state ports have no conductors.
    bounds
        ((node, node), (lower, upper)), each pair once, sorted; without those that are zero.
    """

    interface: Interface
    bounds: tuple[tuple[tuple[Node, Node], Interval], ...]

    @staticmethod
    def of(
        interface: Interface,
        conductances: Iterable[tuple[PathLike, PathLike, float | Fraction, float | Fraction]] = (),
    ) -> "Conductors":
        """Conductors between scalar ports: (port, port, lower, upper); the port ``"."`` is the ground.

        Raises
        ------
        SemanticsError
            Bounds that are negative or in the wrong order, or no such power port.

        >>> from ephs.operad import Directory, PortType, quantity
        >>> wire = Directory({"a": PortType(quantity.entropy), "b": PortType(quantity.entropy)})
        >>> series = Pattern.from_text("x: entropy, exposed; m: entropy; y: entropy, exposed; l(a=x, b=m); r(a=m, b=y)")
        >>> part = Conductors.of(wire, [("a", "b", 1, 3)])
        >>> print(series.apply(intervals, {"l": part, "r": part}))
        x - y: [1/2, 3/2]
        """
        edges: Edges = {}
        for one, other, low, high in conductances:
            first, second = Path.of(one), Path.of(other)
            for port in (first, second):
                if port and not (port in interface and interface[port].power):
                    raise SemanticsError("unknown-port", port, expected=", ".join(map(str, sorted(interface))))
            if not 0 <= low <= high < inf:
                raise SemanticsError("bounds", first, found=(low, high), expected="0 ≤ lower ≤ upper < ∞")
            _add(edges, (first, 0), (second, 0), (Fraction(low), Fraction(high)))
        return _made(interface, edges)

    def __str__(self) -> str:
        lines = (f"{_name(a)} - {_name(b)}: [{low}, {high}]" for (a, b), (low, high) in self.bounds)
        return "\n".join(lines) or "(nothing conducts)"


def _name(node: Node) -> str:
    path, i = node
    return "ground" if node == GROUND else f"{path}[{i}]" if i else str(path)


def _add(edges: Edges, one: Node, other: Node, bounds: Interval) -> None:
    if one != other and bounds[1]:
        key = (one, other) if other == GROUND or (one != GROUND and one < other) else (other, one)
        low, high = edges.get(key, (Fraction(0), Fraction(0)))
        edges[key] = (low + bounds[0], high + bounds[1])


def _made(interface: Interface, edges: Edges) -> Conductors:
    return Conductors(interface, tuple(sorted(edges.items())))


def _without(edges: Edges, node: Node) -> Edges:
    """Eliminate a node on which flows add up to zero: the star of its conductors becomes a mesh.

    A conductance of the mesh grows with the two of the star that it joins and falls with the others, so that its
    bounds are exact; those of several are not independent of each other.
    """
    star = {b if a == node else a: bounds for (a, b), bounds in edges.items() if node in (a, b)}
    out = {key: bounds for key, bounds in edges.items() if node not in key}
    low, high = (sum((bounds[side] for bounds in star.values()), Fraction(0)) for side in (0, 1))
    ends = sorted(star)
    for k, one in enumerate(ends):
        for other in ends[k + 1 :]:
            (a, b), (c, d) = star[one], star[other]
            least = a * c / (a + c + high - b - d) if a * c else Fraction(0)
            _add(out, one, other, (least, b * d / (b + d + low - a - c)))
    return out


def _compose(pattern: Pattern, parts: Mapping[Path, Conductors]) -> Conductors:
    edges: Edges = {}
    for box, part in parts.items():
        ports = pattern.boxes[box].ports
        for (a, b), bounds in part.bounds:
            one, other = (node if node == GROUND else (ports[node[0]].junction, node[1]) for node in (a, b))
            _add(edges, one, other, bounds)
    outer = {path for path, of in pattern.interface.items() if of.power}
    for node in sorted({node for key in edges for node in key if node != GROUND and node[0] not in outer}):
        edges = _without(edges, node)
    return _made(pattern.interface, edges)


def _below(inner: Conductors, wide: Conductors) -> bool:
    bounds, around = dict(inner.bounds), dict(wide.bounds)
    zero = (Fraction(0), Fraction(0))
    pairs = ((bounds.get(key, zero), around.get(key, zero)) for key in bounds.keys() | around.keys())
    return all(a <= low <= high <= b for (low, high), (a, b) in pairs)


def _points(element: Conductors) -> tuple[Conductors, ...]:
    """All conductances at their lower bounds, at their upper ones, and in between by turns."""

    def chosen(weights: tuple[Fraction, ...]) -> Conductors:
        edges: Edges = {}
        for k, ((a, b), (low, high)) in enumerate(element.bounds):
            value = low + weights[k % len(weights)] * (high - low)
            _add(edges, a, b, (value, value))
        return _made(element.interface, edges)

    zero, one = Fraction(0), Fraction(1)
    return tuple(map(chosen, ((zero,), (one,), (zero, one), (one, one / 3, zero))))


intervals: Algebra[Conductors] = Algebra("intervals", interface_of(Conductors), _compose, lax=Lax(_below, _points))
"""Bounds of conductances; a lax algebra, whose laws are inclusions."""


def _conduction(element: Conductors) -> ExactRelation:
    rows: dict[Node, dict[Coordinate, Fraction]] = {}
    for port, of in element.interface.items():
        if of.power:
            for i in range(of.quantity.space.dim):
                rows[port, i] = {("flow", port, i): Fraction(-1)}
    for (a, b), (low, high) in element.bounds:
        middle = (low + high) / 2
        for one, other in ((a, b), (b, a)):
            if one != GROUND:
                for node, sign in ((one, 1), (other, -1)):
                    if node != GROUND:
                        key: Coordinate = ("effort", *node)
                        rows[one][key] = rows[one].get(key, Fraction(0)) + sign * middle
    return ExactRelation.of(element.interface, rows.values())


exact_intervals: Algebra[Conductors] = Algebra("exact intervals", interface_of(Conductors), _compose)
"""Intervals whose bounds agree: exact conductances, for which the laws are equations."""

conduction: AlgebraMap[Conductors, ExactRelation] = AlgebraMap(
    exact_intervals, exact_relations, _conduction, "conduction"
)
"""The relation of exact conductances."""
