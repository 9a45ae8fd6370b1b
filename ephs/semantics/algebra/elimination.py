"""Linear equations over ℚ: one form for each set of solutions, and the elimination of unknowns."""

from collections.abc import Callable, Hashable, Iterable, Mapping
from fractions import Fraction
from typing import Any, TypeAlias, TypeVar

C = TypeVar("C", bound=Hashable)
Row: TypeAlias = tuple[tuple[C, Fraction], ...]
"""A linear form that vanishes: unknown -> coefficient, no zeros, sorted."""


def reduced(rows: Iterable[Mapping[C, Any]], order: Callable[[C], Any]) -> list[dict[C, Fraction]]:
    """The reduced row echelon form, unknowns in the order of their keys: equal for equal sets of solutions."""
    pivots: dict[C, dict[C, Fraction]] = {}
    for given in rows:
        row = {key: Fraction(value) for key, value in given.items() if value}
        for key in [key for key in row if key in pivots]:
            _subtract(row, row[key], pivots[key])
        if not row:
            continue
        pivot = min(row, key=order)
        scale = row[pivot]
        row = {key: value / scale for key, value in row.items()}
        for other in pivots.values():
            if pivot in other:
                _subtract(other, other[pivot], row)
        pivots[pivot] = row
    return [pivots[key] for key in sorted(pivots, key=order)]


def _subtract(row: dict[C, Fraction], factor: Fraction, other: Mapping[C, Fraction]) -> None:
    for key, value in other.items():
        left = row.get(key, Fraction(0)) - factor * value
        if left:
            row[key] = left
        else:
            row.pop(key, None)


def eliminated(
    rows: Iterable[Mapping[C, Any]], kept: Iterable[C], order: Callable[[C], Any]
) -> list[dict[C, Fraction]]:
    """Equations in the kept unknowns alone: ∃ the others, in reduced form."""
    stay = set(kept)
    first = reduced(rows, lambda key: (key in stay, order(key)))
    return [row for row in first if row.keys() <= stay]
