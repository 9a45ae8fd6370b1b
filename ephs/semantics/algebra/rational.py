"""Linear relations over ℚ, exactly: flows and efforts of linear systems, with their states beside them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal, TypeAlias, final

from ephs.operad import ROOT, Algebra, AlgebraMap, Interface, Path, Pattern
from ephs.semantics.algebra.elimination import RATIONAL, Row, eliminated, reduced
from ephs.semantics.meaning import LinearRelation, glued, variables
from ephs.semantics.meaning.variables import Variable

Number: TypeAlias = int | Fraction
Kind: TypeAlias = Literal["effort", "flow", "one", "rate", "state", "before", "after"]
Coordinate: TypeAlias = tuple[Kind, Path, int]
"""Key of an unknown: its kind, port or state, and its place in a vector; ``("one", ROOT, 0)`` is constantly one."""
ONE: Coordinate = ("one", ROOT, 0)


@final
@dataclass(frozen=True, slots=True)
class ExactRelation:
    """An affine relation between states, rates, outer flows and outer efforts, over ℚ.

    Parameters
    ----------
    interface
        The outer ports; state ports carry nothing.
    inner
        Names of the states inside, sorted, with their dimensions.
    equations
        In reduced row echelon form, so that equal relations are equal data; the one equation 1 = 0 if it is empty.
    """

    interface: Interface
    inner: tuple[tuple[Path, int], ...]
    equations: tuple[Row[Coordinate], ...]

    @staticmethod
    def of(
        interface: Interface,
        equations: Iterable[Mapping[Coordinate, Number]],
        inner: Mapping[Path, int] | None = None,
    ) -> "ExactRelation":
        """The relation of some linear forms that vanish.

        >>> from ephs.operad import Directory, PortType, quantity
        >>> port = Directory({"q": PortType(quantity.displacement)})
        >>> q = Path.parse("q")
        >>> spring = ExactRelation.of(
        ...     port,
        ...     [{("flow", q, 0): 1, ("rate", q, 0): -1}, {("effort", q, 0): 1, ("state", q, 0): -3}],
        ...     {q: 1},
        ... )
        >>> print(spring)
        effort q - 3 state q = 0
        flow q - rate q = 0
        """
        return _made(interface, dict(inner or {}), reduced(equations, _order))

    @property
    def empty(self) -> bool:
        """Whether it is empty."""
        return self.equations == (((ONE, Fraction(1)),),)

    def __str__(self) -> str:
        return "\n".join(map(_text, self.equations)) or "(no equation)"


def _order(key: Coordinate) -> tuple[bool, str, Path, int]:
    return (key == ONE, *key)


def _made(interface: Interface, inner: Mapping[Path, int], rows: list[dict[Coordinate, Fraction]]) -> ExactRelation:
    if any(row.keys() == {ONE} for row in rows):
        rows = [{ONE: Fraction(1)}]
    equations = tuple(tuple(sorted(row.items(), key=lambda item: _order(item[0]))) for row in rows)
    return ExactRelation(interface, tuple(sorted(inner.items())), equations)


def _text(row: Row[Coordinate]) -> str:
    words: list[str] = []
    for (kind, path, i), value in row:
        name = "" if kind == "one" else f"{kind} {path}" + (f"[{i}]" if i else "")
        size = "" if abs(value) == 1 and name else f"{abs(value)}{' ' if name else ''}"
        words.append(("- " if value < 0 else "+ ") + size + name)
    return " ".join(words).removeprefix("+ ") + " = 0"


def _interface(element: object) -> Interface | None:
    return element.interface if isinstance(element, ExactRelation) else None


def _linear(element: ExactRelation, box: Path) -> LinearRelation:
    """The relation of what fills a box; states inside have their names in the whole."""

    def variable(key: Coordinate) -> Variable:
        kind, path, i = key
        if key == ONE:
            return variables.ONE
        outer = kind in ("flow", "effort")
        return Variable("outer" if outer else "own", kind, ROOT, path if outer else box / path, i)

    rows = [{variable(key): value for key, value in row} for row in element.equations]
    return LinearRelation.of(RATIONAL, {name for row in rows for name in row}, rows)


def _compose(pattern: Pattern, parts: Mapping[Path, ExactRelation]) -> ExactRelation:
    found = glued(RATIONAL, pattern, {box: _linear(part, box) for box, part in parts.items()})
    rows: list[dict[Any, Fraction]] = [
        {(v.kind, v.port, v.place): n for v, n in row.items()} for row in found.equations
    ]
    return ExactRelation.of(pattern.interface, rows, {box / n: d for box, part in parts.items() for n, d in part.inner})


def _rename(element: ExactRelation, names: Mapping[Path, Path]) -> ExactRelation:
    inner = {path.moved(names): dim for path, dim in element.inner}
    rows: list[dict[Coordinate, Fraction]] = []
    for equation in element.equations:
        row: dict[Coordinate, Fraction] = {}
        for (kind, path, i), value in equation:
            row[kind, path if kind in ("effort", "flow", "one") else path.moved(names), i] = value
        rows.append(row)
    return ExactRelation.of(element.interface, rows, inner)


exact_relations: Algebra[ExactRelation] = Algebra("exact relations", _interface, _compose, rename=_rename)
"""Affine relations over ℚ; equal if they are equal data."""


def _behaviour(element: ExactRelation) -> ExactRelation:
    stay = {key for row in element.equations for key, _ in row if key[0] in ("effort", "flow", "one")}
    return _made(element.interface, {}, eliminated(map(dict, element.equations), stay, _order))


behaviour: AlgebraMap[ExactRelation, ExactRelation] = AlgebraMap(
    exact_relations, exact_relations, _behaviour, "behaviour"
)
"""Relation at the ports at one instant: states and rates eliminated."""


def midpoint(h: Number) -> AlgebraMap[ExactRelation, ExactRelation]:
    """The midpoint rule over a step h: state (before + after)/2, rate (after − before)/h."""
    step = Fraction(h)

    def discretised(element: ExactRelation) -> ExactRelation:
        rows: list[dict[Coordinate, Fraction]] = []
        for equation in element.equations:
            row: dict[Coordinate, Fraction] = {}
            for key, value in equation:
                kind, path, i = key
                terms: dict[Coordinate, Fraction] = {key: value}
                if kind == "state":
                    terms = {("before", path, i): value / 2, ("after", path, i): value / 2}
                elif kind == "rate":
                    terms = {("before", path, i): -value / step, ("after", path, i): value / step}
                for new, term in terms.items():
                    row[new] = row.get(new, Fraction(0)) + term
            rows.append(row)
        return ExactRelation.of(element.interface, rows, dict(element.inner))

    return AlgebraMap(exact_relations, exact_relations, discretised, f"midpoint rule, h = {step}")
