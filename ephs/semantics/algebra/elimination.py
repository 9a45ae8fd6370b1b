"""Linear equations over ℚ: one form for each set of solutions, and the elimination of unknowns."""

from collections.abc import Callable, Hashable, Iterable, Mapping
from fractions import Fraction
from typing import Any, TypeAlias, TypeVar

from ephs.semantics.meaning import elimination
from ephs.semantics.meaning.fields import Rational

C = TypeVar("C", bound=Hashable)
Row: TypeAlias = tuple[tuple[C, Fraction], ...]
"""A linear form that vanishes: unknown -> coefficient, no zeros, sorted."""
RATIONAL = Rational()


def reduced(rows: Iterable[Mapping[C, Any]], order: Callable[[C], Any]) -> list[dict[C, Fraction]]:
    """The reduced row echelon form, unknowns in the order of their keys: equal for equal sets of solutions."""
    return elimination.reduced(RATIONAL, map(RATIONAL.exact, rows), order)


def eliminated(
    rows: Iterable[Mapping[C, Any]], kept: Iterable[C], order: Callable[[C], Any]
) -> list[dict[C, Fraction]]:
    """Equations in the kept unknowns alone: ∃ the others, in reduced form."""
    stay = set(kept)
    return reduced(elimination.eliminated(RATIONAL, map(RATIONAL.exact, rows), lambda key: key not in stay), order)
