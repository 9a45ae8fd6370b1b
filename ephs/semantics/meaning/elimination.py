"""Elimination: rows without some of their variables, in any field. The one algorithm of linear relations.

Variables that are one are written as one; then a variable is eliminated among the few rows that contain it, the one
with the fewest such rows first. Rows that have nothing to do with each other never meet.
"""

from collections.abc import Callable, Iterable, Sequence
from heapq import heapify, heappop, heappush
from typing import Any, TypeVar

from ephs.semantics.meaning.fields import Field, Row

N = TypeVar("N")


def eliminated(field: Field[N], rows: Iterable[Row[N]], forgotten: Callable[[Any], bool]) -> list[Row[N]]:
    """∃ the forgotten variables: the linear forms of the row space in the other ones.

    Parameters
    ----------
    forgotten
        Whether to eliminate a variable.
    """
    names, work = _numbered(rows)
    gone = [forgotten(name) for name in names]
    # a forgotten variable that is left counts as zero in all rows
    _, left = _pivoted(field, _substituted(field, work, gone), gone)
    return [{names[i]: number for i, number in row.items() if not gone[i]} for row in left]


def echelon(field: Field[N], rows: Iterable[Row[N]], first: Callable[[Any], bool]) -> list[tuple[Any, Row[N]]]:
    """Rows with a pivot each, in the order of elimination: a pivot occurs in no later row.

    Parameters
    ----------
    first
        Variables that are eliminated before the others.
    """
    names, work = _numbered(rows)
    front, rest = _pivoted(field, work, [first(name) for name in names])
    front += _pivoted(field, rest, [True] * len(names))[0]
    return [(names[pivot], {names[i]: number for i, number in row.items()}) for pivot, row in front]


def reduced(field: Field[N], rows: Iterable[Row[N]], order: Callable[[Any], Any]) -> list[Row[N]]:
    """The reduced row echelon form, variables in the order of their keys: over ℚ equal for equal row spaces."""
    pivots: dict[Any, Row[N]] = {}
    uses: dict[Any, set[Any]] = {}
    for given in rows:
        row = dict(given)
        for variable in [key for key in row if key in pivots]:
            field.subtract(row, row[variable], pivots[variable])
        support = field.support(row)
        if not support:
            continue
        pivot = min(support, key=order)
        scale = row[pivot]
        row = {key: field.quotient(value, scale) for key, value in row.items()}
        for owner in list(uses.get(pivot, ())):
            field.subtract(pivots[owner], pivots[owner][pivot], row)
            _note(uses, owner, pivots[owner], row)
        pivots[pivot] = row
        _note(uses, pivot, row, row)
    return [dict(sorted(pivots[key].items(), key=lambda term: order(term[0]))) for key in sorted(pivots, key=order)]


def _note(uses: dict[Any, set[Any]], owner: Any, row: Row[Any], changed: Iterable[Any]) -> None:
    """Keep which pivots' rows contain a variable."""
    for key in changed:
        if key in row:
            uses.setdefault(key, set()).add(owner)
        elif key in uses:
            uses[key].discard(owner)


def _numbered(rows: Iterable[Row[N]]) -> tuple[list[Any], list[Row[N]]]:
    """The variables, and the rows over their places: small integers are compared faster than names."""
    places: dict[Any, int] = {}
    work = [{places.setdefault(name, len(places)): number for name, number in row.items()} for row in rows]
    return list(places), work


def _substituted(field: Field[N], rows: Sequence[Row[N]], gone: Sequence[bool]) -> list[Row[N]]:
    """Carry out the equations x = y: a forgotten variable is written as the other one."""
    above: list[int] = list(range(len(gone)))

    def leader(i: int) -> int:
        while above[i] != i:
            above[i] = i = above[above[i]]
        return i

    rest: list[Row[N]] = []
    for row in rows:
        if len(row) == 2 and _opposite(field, row):
            x, y = map(leader, row)
            if x == y:
                continue
            if gone[x] or gone[y]:
                above[x if gone[x] else y] = y if gone[x] else x
                continue
        rest.append(row)
    minus = field.number(-1.0)
    for place, row in enumerate(rest):
        new: Row[Any] = {}
        for i, number in row.items():
            j = leader(i)
            if j in new:
                field.subtract(new, minus, {j: number})
            else:
                new[j] = number
        rest[place] = new
    return rest


def _opposite(field: Field[N], row: Row[N]) -> bool:
    one, other = row.values()
    return field.opposite(one, other)


def _pivoted(
    field: Field[N], rows: Iterable[Row[N]], wanted: Sequence[bool]
) -> tuple[list[tuple[int, Row[N]]], list[Row[N]]]:
    """The rows that eliminated the wanted variables, each with its pivot, and the rows that are left."""
    work = {number: dict(row) for number, row in enumerate(rows)}
    uses: dict[int, set[int]] = {}
    for number, row in work.items():
        for variable in row:
            if wanted[variable]:
                uses.setdefault(variable, set()).add(number)
    order = [(len(where), variable) for variable, where in uses.items()]
    heapify(order)
    pivots: list[tuple[int, Row[N]]] = []
    while order:
        count, variable = heappop(order)
        where = uses.get(variable)
        if where is None or len(where) != count:
            continue  # done, or in the heap again with the right count
        del uses[variable]
        numbers = sorted(where)
        certain = [i for i in numbers if field.certain(work[i][variable])]
        if not certain:  # no row has it but within its error bound
            continue
        chosen = certain[field.pivot([work[i] for i in certain], variable)]
        numbers.remove(chosen)
        pivot = work.pop(chosen)
        rest = {key: value for key, value in pivot.items() if key != variable}
        watched = [key for key in rest if key in uses]
        for number in numbers:
            row = work[number]
            field.subtract(row, field.quotient(row.pop(variable), pivot[variable]), rest)
            for key in watched:
                if key in row:
                    uses[key].add(number)
                else:
                    uses[key].discard(number)
        for key in watched:
            uses[key].discard(chosen)
            heappush(order, (len(uses[key]), key))
        pivots.append((variable, pivot))
    return pivots, [row for row in work.values() if field.support(row)]
