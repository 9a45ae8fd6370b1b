"""The laws of the operad of patterns, as values.

Each law is stated once, here; tests and documentation run the same objects. The laws hold as equality of
data, not up to isomorphism, because paths concatenate associatively and boxes are named.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ephs.operad.algebra_laws import ALGEBRA_LAWS, MAP_LAWS
from ephs.operad.directory import Directory
from ephs.operad.equations import Equation, Law
from ephs.operad.names import ROOT, Path
from ephs.operad.nesting import Nesting
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import PortType

__all__ = ["ALGEBRA_LAWS", "LAWS", "MAP_LAWS", "law"]

Names = Mapping[Path, Path]


def _left_unit(g: Pattern) -> Equation:
    return Equation(Pattern.identity(g.interface).substitute({ROOT: g}), g)


def _right_unit(f: Pattern, a: Path) -> Equation:
    return Equation(f.substitute({a: Pattern.identity(f.boxes[a].interface)}), f)


def _sequential(f: Pattern, a: Path, g: Pattern, b: Path, h: Pattern) -> Equation:
    left = f.substitute({a: g}).substitute({a / b: h})
    return Equation(left, f.substitute({a: g.substitute({b: h})}))


def _parallel(f: Pattern, a: Path, g: Pattern, c: Path, h: Pattern) -> Equation:
    return Equation(f.substitute({a: g}).substitute({c: h}), f.substitute({c: h}).substitute({a: g}))


def _full(f: Pattern, fillings: Mapping[Path, Pattern]) -> Equation:
    """Fillings in the order of the mapping, one after the other, against all at once."""
    result = f
    for box, filling in fillings.items():
        result = result.substitute({box: filling})
    return Equation(f.substitute(fillings), result)


def _moved(paths: Directory[Any], old: Path, new: Path) -> Names:
    """Rename all nodes below a path."""
    return {path: new / path.relative_to(old) for path in paths if old.is_prefix_of(path)}


def _box_names(f: Pattern, a: Path, g: Pattern, names: Names) -> Equation:
    whole = f.substitute({a: g})
    boxes: dict[Path, Path] = {}
    junctions: dict[Path, Path] = {}
    for old, new in names.items():
        boxes |= _moved(whole.boxes, old, new)
        junctions |= _moved(whole.junctions, old, new)
    left = f.rename(boxes=names).substitute({names.get(a, a): g})
    return Equation(left, whole.rename(boxes=boxes, junctions=junctions))


def _junction_names(f: Pattern, a: Path, g: Pattern, names: Names) -> Equation:
    whole = f.substitute({a: g})
    kept = {old: new for old, new in names.items() if old in whole.junctions}
    return Equation(f.rename(junctions=names).substitute({a: g}), whole.rename(junctions=kept))


def _port_names(f: Pattern, a: Path, g: Pattern, names: Names) -> Equation:
    whole = f.substitute({a: g})
    kept = {a / old: a / new for old, new in names.items() if a / old in whole.junctions}
    left = f.rename(ports={a: names}).substitute({a: g.rename(junctions=names)})
    return Equation(left, whole.rename(junctions=kept))


def _interface(f: Pattern, fillings: Mapping[Path, Pattern]) -> Equation:
    found, given = f.substitute(fillings).interface, f.interface
    return Equation(found.map(_without_frame), given.map(_without_frame))


def _without_frame(port: PortType) -> PortType:
    return replace(port, quantity=port.quantity.in_frame(None))


def _nested(nesting: Nesting) -> Equation:
    return Equation(nesting.flatten(), nesting.bottom_up())


def _from_above(nesting: Nesting) -> Equation:
    return Equation(nesting.flatten(), nesting.top_down())


LAWS: tuple[Law, ...] = (
    Law("left unit", "id ∘. g = g", ("g",), _left_unit),
    Law("right unit", "f ∘ₐ id = f", ("f", "a"), _right_unit),
    Law(
        "sequential associativity",
        "(f ∘ₐ g) ∘_{a.b} h = f ∘ₐ (g ∘_b h)",
        ("f", "a", "g", "b", "h"),
        _sequential,
    ),
    Law(
        "parallel associativity",
        "(f ∘ₐ g) ∘_c h = (f ∘_c h) ∘ₐ g where a ≠ c",
        ("f", "a", "g", "c", "h"),
        _parallel,
    ),
    Law("full substitution", "all at once = one after the other, in any order", ("f", "fillings"), _full),
    Law(
        "equivariance in boxes",
        "σ(f) ∘_{σa} g = σ(f ∘ₐ g), σ acting on prefixes",
        ("f", "a", "g", "boxes"),
        _box_names,
    ),
    Law("equivariance in junctions", "σ(f) ∘ₐ g = σ(f ∘ₐ g)", ("f", "a", "g", "junctions"), _junction_names),
    Law(
        "equivariance in ports",
        "f with σ on the ports of a, ∘ₐ σ(g) = f ∘ₐ g, a.j renamed a.σj",
        ("f", "a", "g", "ports"),
        _port_names,
    ),
    Law("flattening from below", "all levels at once = innermost patterns first", ("nesting",), _nested),
    Law("flattening from above", "all levels at once = outermost patterns first", ("nesting",), _from_above),
    Law("interface", "f ∘ (g) has the interface of f, but for frames that it gains", ("f", "fillings"), _interface),
)


def law(name: str) -> Law:
    """The law of this name, of patterns, algebras or their maps.

    Raises
    ------
    KeyError
        If there is none.
    """
    return {each.name: each for each in (*LAWS, *ALGEBRA_LAWS, *MAP_LAWS)}[name]
