"""The laws of algebras of the operad, and of maps between algebras, as values.

They run on any `Algebra`. Of one whose elements enclose exact ones, both sides enclose what either gives for exact
elements: each law then is an inclusion, as the widths depend on the bracketing.
"""

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from ephs.operad.algebra import Algebra, AlgebraMap
from ephs.operad.equations import Equation, Law
from ephs.operad.matching import interfaces_match
from ephs.operad.names import ROOT, Path
from ephs.operad.nesting import Nesting
from ephs.operad.parts import Junction, Port
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import Interface

Elements: TypeAlias = Mapping[Path, Any]
Names: TypeAlias = Mapping[Path, Path]


def _equation(
    algebra: Algebra[Any], elements: Elements, left: Callable[[Elements], Any], right: Callable[[Elements], Any]
) -> Equation:
    """Both sides at these elements; of a lax algebra, each side at exact elements in the other at these."""
    lax = algebra.lax
    if lax is None:
        return Equation(left(elements), right(elements), same=algebra.equal)
    inside = {box: lax.points(element) for box, element in elements.items()}
    count = min((len(points) for points in inside.values()), default=0)
    exact = [{box: points[k] for box, points in inside.items()} for k in range(count)]
    enclosing = left(elements), right(elements)

    def enclosed(points: tuple[Any, ...], around: tuple[Any, ...]) -> bool:
        return all(lax.below(point, wide) for pair in points for point, wide in zip(pair, around, strict=True))

    return Equation(tuple((right(at), left(at)) for at in exact), enclosing, same=enclosed)


def _interface(algebra: Algebra[Any], f: Pattern, elements: Elements) -> Equation:
    found = algebra.interface_of(f.apply(algebra, elements))
    return Equation(found, f.interface, same=_known_match)


def _known_match(found: Interface | None, wanted: Interface) -> bool:
    return found is not None and interfaces_match(wanted, found)


def _identity(algebra: Algebra[Any], f: Pattern, a: Path, elements: Elements) -> Equation:
    unit = Pattern.identity(f.boxes[a].interface)
    return _equation(algebra, elements, lambda s: unit.apply(algebra, {ROOT: s[a]}), lambda s: s[a])


def _substitution(algebra: Algebra[Any], f: Pattern, a: Path, g: Pattern, elements: Elements) -> Equation:
    def nested(s: Elements) -> Any:
        inner = g.apply(algebra, {box: s[a / box] for box in g.boxes})
        return f.apply(algebra, {box: inner if box == a else s[box] for box in f.boxes})

    return _equation(algebra, elements, lambda s: f.substitute({a: g}).apply(algebra, s), nested)


def _levels(algebra: Algebra[Any], nesting: Nesting, elements: Elements) -> Equation:
    return _equation(
        algebra, elements, lambda s: nesting.flatten().apply(algebra, s), lambda s: nesting.fold(algebra, s)
    )


def _nullary(algebra: Algebra[Any], f: Pattern, a: Path, elements: Elements) -> Equation:
    nothing = Pattern({}, {})
    whole = f.substitute({a: nothing})
    return _equation(
        algebra,
        elements,
        lambda s: whole.apply(algebra, {box: s[box] for box in whole.boxes}),
        lambda s: f.apply(algebra, {box: s[box] if box != a else nothing.apply(algebra, {}) for box in f.boxes}),
    )


def _again(algebra: Algebra[Any], f: Pattern, again: Pattern, elements: Elements) -> Equation:
    return _equation(algebra, elements, lambda s: f.apply(algebra, s), lambda s: again.apply(algebra, s))


def _boxes(algebra: Algebra[Any], f: Pattern, boxes: Names, elements: Elements) -> Equation:
    renamed = f.rename(boxes=boxes)
    return _equation(
        algebra,
        elements,
        lambda s: renamed.apply(algebra, {boxes.get(box, box): s[box] for box in f.boxes}),
        lambda s: algebra.rename(f.apply(algebra, s), boxes),
    )


def _junctions(algebra: Algebra[Any], f: Pattern, junctions: Names, elements: Elements) -> Equation:
    new = {path: junctions.get(path, path) for path in f.junctions}
    renamed, around = f.rename(junctions=junctions), _around(f.interface, new)
    # the contents of the box in the outer pattern
    (box,) = around.boxes
    inside = {path: box / path for path in f.boxes}
    inside |= {new[path]: box / path for path, junction in f.junctions.items() if not junction.exposed}
    return _equation(
        algebra,
        elements,
        lambda s: algebra.rename(renamed.apply(algebra, s), inside),
        lambda s: around.apply(algebra, {box: f.apply(algebra, s)}),
    )


def _ports(algebra: Algebra[Any], f: Pattern, a: Path, ports: Names, elements: Elements) -> Equation:
    interface = f.boxes[a].interface
    renamed, around = (
        f.rename(ports={a: ports}),
        _around(interface, {port: ports.get(port, port) for port in interface}),
    )
    (box,) = around.boxes
    return _equation(
        algebra,
        elements,
        lambda s: algebra.rename(f.apply(algebra, s), {a: a / box}),
        lambda s: renamed.apply(algebra, {**s, a: around.apply(algebra, {box: s[a]})}),
    )


def _around(interface: Interface, new: Names) -> Pattern:
    """The pattern with one box that renames the ports of an interface."""
    taken = {new[port][0] for port in interface}
    box = next(name for k in range(len(taken) + 1) if (name := f"box{k}") not in taken)
    ports = {port: Port(new[port], of.power) for port, of in interface.items()}
    return Pattern([(new[port], Junction(of.quantity, True, of.power)) for port, of in interface.items()], {box: ports})


def _kept(alpha: AlgebraMap[Any, Any], f: Pattern, a: Path, elements: Elements) -> Equation:
    found = alpha.target.interface_of(alpha(elements[a]))
    return Equation(found, f.boxes[a].interface, same=_known_match)


def _naturality(alpha: AlgebraMap[Any, Any], f: Pattern, elements: Elements) -> Equation:
    whole = alpha(f.apply(alpha.source, elements))
    parts = f.apply(alpha.target, {box: alpha(element) for box, element in elements.items()})
    lax = alpha.target.lax
    return Equation(whole, parts, same=alpha.target.equal if lax is None else lax.below)


ALGEBRA_LAWS: tuple[Law, ...] = (
    Law("kept interface", "f_A(s) has the interface of f", ("algebra", "f", "elements"), _interface),
    Law("identity", "id_A(s) = s", ("algebra", "f", "a", "elements"), _identity),
    Law(
        "substitution",
        "flatten, then fill = fill, then compose: (f ∘ₐ g)_A(s) = f_A(…, g_A(s), …)",
        ("algebra", "f", "a", "g", "elements"),
        _substitution,
    ),
    Law(
        "levels",
        "flattened, then filled = folded level by level",
        ("algebra", "nesting", "elements"),
        _levels,
    ),
    Law("nullary", "(f ∘ₐ ∅)_A(s) = f_A(…, ∅_A, …)", ("algebra", "f", "a", "elements"), _nullary),
    Law(
        "presentation",
        "f = f′ implies f_A = f′_A: order means nothing",
        ("algebra", "f", "again", "elements"),
        _again,
    ),
    Law(
        "equivariance in names of boxes",
        "(σf)_A(σs) = σ(f_A(s)), σ acting on names inside",
        ("algebra", "f", "boxes", "elements"),
        _boxes,
    ),
    Law(
        "equivariance in names of junctions",
        "(σf)_A(s) = f_A(s) with σ on its ports",
        ("algebra", "f", "junctions", "elements"),
        _junctions,
    ),
    Law(
        "equivariance in names of ports",
        "f with σ on the ports of a, filled with s with σ on its ports, = f_A(s)",
        ("algebra", "f", "a", "ports", "elements"),
        _ports,
    ),
)
"""Laws of any algebra."""

MAP_LAWS: tuple[Law, ...] = (
    Law("interface kept by a map", "α(s) has the interface of s", ("map", "f", "a", "elements"), _kept),
    Law("naturality", "α(f_A(s)) = f_B(α(s)); below, where B is lax", ("map", "f", "elements"), _naturality),
)
"""Laws of any map of algebras."""
