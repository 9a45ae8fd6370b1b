"""Linear relations over ℚ, exactly: flows and efforts of linear systems, with their states beside them."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal, TypeAlias, final

from ephs.operad import ROOT, Algebra, AlgebraMap, Interface, Path, Pattern
from ephs.semantics.algebra.interfaces import interface_of
from ephs.semantics.meaning import LinearRelation, glued, variables
from ephs.semantics.meaning.fields import Rational
from ephs.semantics.meaning.variables import RelationVariable, own

Number: TypeAlias = int | Fraction
Kind: TypeAlias = Literal["effort", "flow", "one", "rate", "state", "before", "after"]
Coordinate: TypeAlias = tuple[Kind, Path, int]
"""Key of an unknown: its kind, port or state, and its place in a vector; ``("one", ROOT, 0)`` is constantly one."""
ONE: Coordinate = ("one", ROOT, 0)
RATIONAL = Rational()


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
    equations: tuple[tuple[tuple[Coordinate, Fraction], ...], ...]

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
        rows = [RATIONAL.exact({_variable(key): value for key, value in row.items()}) for row in equations]
        return _made(interface, inner or {}, LinearRelation.among(RATIONAL, rows))

    @property
    def relation(self) -> LinearRelation:
        """The equations as a relation between variables; those of states inside have the states' names."""
        rows = [{_variable(key): value for key, value in row} for row in self.equations]
        return LinearRelation.among(RATIONAL, rows)

    @property
    def empty(self) -> bool:
        """Whether it is empty."""
        return self.equations == (((ONE, Fraction(1)),),)

    def __str__(self) -> str:
        return "\n".join(map(_text, self.equations)) or "(no equation)"


def _variable(key: Coordinate) -> RelationVariable:
    kind, path, i = key
    if key == ONE:
        return variables.ONE
    return RelationVariable("outer" if kind in ("flow", "effort") else "own", kind, ROOT, path, i)


def _made(interface: Interface, inner: Mapping[Path, int], relation: LinearRelation) -> ExactRelation:
    equations = tuple(tuple(((v.kind, v.port, v.place), n) for v, n in row.items()) for row in relation.canonical)
    return ExactRelation(interface, tuple(sorted(inner.items())), equations)


def _text(row: tuple[tuple[Coordinate, Fraction], ...]) -> str:
    words: list[str] = []
    for (kind, path, i), value in row:
        name = "" if kind == "one" else f"{kind} {path}" + (f"[{i}]" if i else "")
        size = "" if abs(value) == 1 and name else f"{abs(value)}{' ' if name else ''}"
        words.append(("- " if value < 0 else "+ ") + size + name)
    return " ".join(words).removeprefix("+ ") + " = 0"


def _named(element: ExactRelation, name: Callable[[Path], Path]) -> tuple[dict[Path, int], LinearRelation]:
    """The states inside under other names, and the relation with them."""
    relation = element.relation.renamed(lambda v: v._replace(port=name(v.port)) if v.role == "own" else v)
    return {name(path): dim for path, dim in element.inner}, relation


def _compose(pattern: Pattern, parts: Mapping[Path, ExactRelation]) -> ExactRelation:
    inner: dict[Path, int] = {}
    relations: dict[Path, LinearRelation] = {}
    for box, part in parts.items():
        states, relations[box] = _named(part, box.__truediv__)
        inner |= states
    return _made(pattern.interface, inner, glued(RATIONAL, pattern, relations))


def _rename(element: ExactRelation, names: Mapping[Path, Path]) -> ExactRelation:
    return _made(element.interface, *_named(element, lambda path: path.moved(names)))


exact_relations: Algebra[ExactRelation] = Algebra(
    "exact relations", interface_of(ExactRelation), _compose, rename=_rename
)
"""Affine relations over ℚ; equal if they are equal data."""


def _behaviour(element: ExactRelation) -> ExactRelation:
    relation = element.relation
    return _made(element.interface, {}, relation.without(v for v in relation.variables if v.role == "own"))


behaviour: AlgebraMap[ExactRelation, ExactRelation] = AlgebraMap(
    exact_relations, exact_relations, _behaviour, "behaviour"
)
"""Relation at the ports at one instant: states and rates eliminated."""


def midpoint(h: Number) -> AlgebraMap[ExactRelation, ExactRelation]:
    """The midpoint rule over a step h: state (before + after)/2, rate (after − before)/h."""
    step = Fraction(h)

    def discretised(element: ExactRelation) -> ExactRelation:
        rows: list[dict[RelationVariable, Fraction]] = []
        instant: list[RelationVariable] = []
        for path, dim in element.inner:
            kinds = [own(kind, path, dim) for kind in ("state", "rate", "before", "after")]
            for state, rate, before, after in zip(*kinds, strict=True):
                rows.append(RATIONAL.exact({state: 2, before: -1, after: -1}))
                rows.append(RATIONAL.exact({rate: step, before: 1, after: -1}))
                instant += [state, rate]
        of_step = LinearRelation.among(RATIONAL, rows)
        return _made(element.interface, dict(element.inner), element.relation.join(of_step).without(instant))

    return AlgebraMap(exact_relations, exact_relations, discretised, f"midpoint rule, h = {step}")
