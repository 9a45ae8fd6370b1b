"""Negative controls: of any algebra a copy that is none, so that a check of a law is seen to fail where it should.

A copy composes other patterns than it is given: a box is doubled, junctions of one quantity are linked, or a port has
another name, each where one of the laws forbids it.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeAlias, final

from hypothesis import HealthCheck, Phase, given, settings

from ephs.operad import ALGEBRA_LAWS, Algebra, AlgebraMap, Law, Path, Pattern
from ephs.testing.algebras import algebra_inputs
from ephs.testing.elements import ELEMENTS, FEW, Elements

Filled: TypeAlias = tuple[Pattern, Mapping[Path, Any]]


def spoiled(algebra: Algebra[Any], law: Law) -> Algebra[Any]:
    """An algebra of the same elements for which the law fails."""
    spoil = _SPOILS[law.name]
    return replace(
        algebra, name=f"{algebra.name} spoiled", compose=lambda pattern, parts: algebra.compose(*spoil(pattern, parts))
    )


def _doubled(f: Pattern, parts: Mapping[Path, Any], box: Path | None, joined: Iterable[Path]) -> Filled:
    """The pattern with a box twice, and like ones among some junctions linked; an identity with its box named."""
    if f.is_identity:
        named = Pattern(f.junctions, {_fresh(f): next(iter(f.boxes.values())).ports})
        return _doubled(named, dict.fromkeys(named.boxes, *parts.values()), next(iter(named.boxes)), joined)
    boxes, filled = dict(f.boxes), dict(parts)
    if box is not None:
        copy = _fresh(f)
        boxes[copy], filled[copy] = f.boxes[box], parts[box]
    groups: dict[Any, list[Path]] = {}
    for path in joined:
        groups.setdefault(f.junctions[path].quantity, []).append(path)
    more = [group for group in groups.values() if len(group) > 1]
    return Pattern(f.junctions, boxes, [*f.links, *more]), filled


def _fresh(f: Pattern) -> Path:
    taken = {path[0] for path in (*f.boxes, *f.junctions) if path}
    return next(path for k in range(len(taken) + 1) if (path := Path((f"copy{k}",)))[0] not in taken)


def _kept_interface(f: Pattern, parts: Mapping[Path, Any]) -> Filled:
    if f.is_identity or not f.interface:
        return f, parts
    return f.rename(junctions={min(f.interface): _fresh(f)}), parts


def _identity(f: Pattern, parts: Mapping[Path, Any]) -> Filled:
    return _doubled(f, parts, None, f.junctions) if f.is_identity else (f, parts)


def _substitution(f: Pattern, parts: Mapping[Path, Any]) -> Filled:
    if f.is_identity or not f.boxes:
        return f, parts
    return _doubled(f, parts, min(f.boxes), f.junctions if len(f.boxes) == 1 else ())


def _levels(f: Pattern, parts: Mapping[Path, Any]) -> Filled:
    return _identity(f, parts) if f.is_identity else _substitution(f, parts)


def _nullary(f: Pattern, parts: Mapping[Path, Any]) -> Filled:
    if f.is_identity or all(box.ports for box in f.boxes.values()):
        return f, parts
    return _doubled(f, parts, max(f.boxes, key=lambda box: (len(f.boxes[box].ports), box)), f.junctions)


def _presentation(f: Pattern, parts: Mapping[Path, Any]) -> Filled:
    if f.is_identity or not f.boxes:
        return f, parts
    first = next(iter(f.junctions), None)
    return _doubled(f, parts, next(iter(f.boxes)), f.junctions if first in f.interface else ())


def _boxes(f: Pattern, parts: Mapping[Path, Any]) -> Filled:
    if f.is_identity or not f.boxes:
        return f, parts
    least = min(f.boxes)
    return _doubled(f, parts, least, f.junctions if len(f.boxes[least].ports) % 2 else ())


def _junctions(f: Pattern, parts: Mapping[Path, Any]) -> Filled:
    if f.is_identity or not f.junctions:
        return f, parts
    least = min(f.junctions)
    on = [box for box, of in f.boxes.items() if any(port.junction == least for port in of.ports.values())]
    return _doubled(f, parts, min(on, default=None), f.junctions if least in f.interface else ())


def _ports(f: Pattern, parts: Mapping[Path, Any]) -> Filled:
    if f.is_identity:
        return f, parts
    order = sorted(f.junctions)
    least = {box: order.index(of.ports[min(of.ports)].junction) for box, of in f.boxes.items() if of.ports}
    odd = sum(least.values()) % 2
    return _doubled(f, parts, min(least, default=None) if odd else None, f.junctions if odd else ())


_SPOILS: dict[str, Callable[[Pattern, Mapping[Path, Any]], Filled]] = {
    "kept interface": _kept_interface,
    "identity": _identity,
    "substitution": _substitution,
    "levels": _levels,
    "nullary": _nullary,
    "presentation": _presentation,
    "equivariance in names of boxes": _boxes,
    "equivariance in names of junctions": _junctions,
    "equivariance in names of ports": _ports,
}


@final
@dataclass(frozen=True, slots=True)
class LawCell:
    """Result of a law for an algebra.

    Parameters
    ----------
    holds
        Whether no instance failed.
    refuted
        Whether one of the spoiled copy did.
    """

    holds: bool
    refuted: bool


def law_cell(law: Law, algebra: Algebra[Any], elements: Elements, *, max_examples: int = 50) -> LawCell:
    """Try a law on an algebra, and on its spoiled copy until it fails."""
    holds = not refuted(law, algebra, elements, max_examples=max_examples)
    return LawCell(holds, refuted(law, spoiled(algebra, law), elements, max_examples=400 * max_examples))


def refuted(
    law: Law, subject: Algebra[Any] | AlgebraMap[Any, Any], elements: Elements, *, max_examples: int = 500
) -> bool:
    """Whether some instance of a law of algebras or maps is found to fail; the first is enough."""
    limits = settings(
        max_examples=max_examples,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[Phase.generate],
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example],
    )
    found: list[tuple[object, ...]] = []

    def holds(inputs: tuple[object, ...]) -> None:
        if not law(*inputs).holds:
            found.append(inputs)
            raise AssertionError(law.name)

    try:
        limits(given(algebra_inputs(law, subject, elements, quantities=FEW))(holds))()
    except AssertionError:
        return True
    return bool(found)


def law_table(*, max_examples: int = 10) -> str:
    """All algebras that the package ships and all laws of algebras, tried: a table in Markdown.

    ``=`` holds as an equation, ``≤`` as an inclusion; ``!`` and the law failed on the spoiled copy, as it should.
    """
    lines = ["| | " + " | ".join(algebra.name for algebra in ELEMENTS) + " |", "| --- |" + " --- |" * len(ELEMENTS)]
    for law in ALGEBRA_LAWS:
        words: list[str] = []
        for algebra, elements in ELEMENTS.items():
            cell = law_cell(law, algebra, elements, max_examples=max_examples)
            sign = ("=" if algebra.lax is None else "≤") if cell.holds else "fails"
            words.append(sign + (" !" if cell.refuted else ""))
        lines.append(f"| {law.name} | " + " | ".join(words) + " |")
    return "\n".join(lines)
