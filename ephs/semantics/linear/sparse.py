"""Sparse LU in a fixed order: numbers only, no search, no allocation.

The pattern of L + U is kept by rows: row i has its columns, ascending, at column[start[i]] … column[start[i + 1] − 1],
its diagonal at diagonal[i]. U's diagonal holds reciprocal pivots.
"""

from functools import cache

from ephs.semantics.stage import Entry, Evaluator, Integer, Integers, Program, Truth, Vector


def factorise(
    on: Evaluator,
    place: Integers,
    start: Integers,
    column: Integers,
    diagonal: Integers,
    data: Vector,
    value: Vector,
    row: Vector,
    floor: Vector,
    ratio: Vector,
) -> Truth:
    """Factorise the matrix with entries ``data`` into ``value``.

    Parameters
    ----------
    place
        (entries,): place of each entry in the pattern; where it is negative the entry does not take part.
    start, column, diagonal
        The pattern of the factors.
    row
        (n,) scratch.
    floor, ratio
        (n,): |pivot|/|largest of its row|, the least that is accepted, and what was found.

    Returns
    -------
    Truth
        False where a pivot is zero, not a number, or below its floor; rows after it are left as they are.
    """
    n = diagonal.size

    def clear(p: Integer) -> None:
        value[p] = 0.0

    on.loop(value.size, clear)

    def gather(k: Integer) -> None:
        at = place[k]

        def add() -> None:
            value[at] = value[at] + data[k]

        on.when(at >= 0, add)

    on.loop(place.size, gather)
    at, good = on.counter(0), on.counter(1)

    def eliminate() -> Truth:
        i = at.value
        first, last, middle = start[i], start[i + 1], diagonal[i]
        largest = on.variable(0.0)

        def spread(p: Integer) -> None:
            entry = value[p]
            row[column[p]] = entry
            largest.value = on.maximum(largest.value, on.absolute(entry))

        on.loop(last, spread, start=first)

        def reduce(p: Integer) -> None:
            k = column[p]
            entry = row[k]

            def subtract() -> None:
                pivot = diagonal[k]
                factor = entry * value[pivot]
                row[k] = factor

                def each_entry(q: Integer) -> None:
                    c = column[q]
                    row[c] = row[c] - factor * value[q]

                on.loop(start[k + 1], each_entry, start=pivot + 1)

            on.when(on.negate(on.absolute(entry) <= 0.0), subtract)

        on.loop(middle, reduce, start=first)

        def collect(p: Integer) -> None:
            value[p] = row[column[p]]

        on.loop(last, collect, start=first)
        pivot = value[middle]
        size = on.absolute(pivot)

        def accept() -> None:
            ratio[i] = size / largest.value

            def below() -> None:
                good.value = 0

            def keep() -> None:
                value[middle] = 1.0 / pivot

            on.when(ratio[i] < floor[i], below, keep)

        def singular() -> None:
            good.value = 0

        on.when(size > 0.0, accept, singular)
        at.value = i + 1
        return on.either(on.same(good.value, 0), i + 1 >= n)

    on.when(n > 0, lambda: on.repeat(eliminate))
    return on.same(good.value, 1)


def solve(
    on: Evaluator,
    rows: Integers,
    columns: Integers,
    start: Integers,
    column: Integers,
    diagonal: Integers,
    value: Vector,
    right: Vector,
    x: Vector,
    row: Vector,
) -> None:
    """Solve A x = right with the factors of A, its rows and columns taken in the order of ``rows`` and ``columns``.

    ``row`` (n,) is scratch.
    """
    n = diagonal.size
    total = on.variable(0.0)

    def subtract(p: Integer) -> None:
        total.value = total.value - value[p] * row[column[p]]

    def forward(i: Integer) -> None:
        total.value = right[rows[i]]
        on.loop(diagonal[i], subtract, start=start[i])
        row[i] = total.value

    def backward(i: Integer) -> None:
        total.value = row[i]
        on.loop(start[i + 1], subtract, start=diagonal[i] + 1)
        row[i] = total.value * value[diagonal[i]]

    def hand(i: Integer) -> None:
        x[columns[i]] = row[i]

    on.loop(n, forward)
    on.loop(n, backward, down=True)
    on.loop(n, hand)


def fill(
    on: Evaluator, first: Integers, column: Integers, start: Integers, out: Integers, link: Integers, mark: Integers
) -> Integer:
    """Find the pattern of L + U by rows, in this order of rows and columns without further pivoting.

    Parameters
    ----------
    first, column
        The rows of A, their diagonals included, are column[first[i]] … column[first[i + 1] − 1], ascending.
    start, out
        (n + 1,) and (room,): receive the pattern of the factors, ascending too.
    link, mark
        (n + 1,) and (n,) scratch.

    Returns
    -------
    Integer
        The number of entries, or −1 where ``out`` has no room for them.
    """
    n = mark.size
    count, here, k = on.counter(0), on.counter(0), on.counter(0)
    start[0] = 0

    def clear(i: Integer) -> None:
        mark[i] = -1

    on.loop(n, clear)

    def fill_row(i: Integer) -> None:
        # The row as a linked list in ascending order, n at its end; its members are marked.
        head, last = column[first[i]], first[i + 1] - 1

        def insert(p: Integer) -> None:
            mark[column[p]] = i
            link[column[p]] = column[p + 1]

        on.loop(last, insert, start=first[i])
        mark[column[last]] = i
        link[column[last]] = n
        k.value = head

        def merge() -> Truth:
            # Row k of U is merged in, behind its diagonal.
            here.value = k.value

            def entry(q: Integer) -> None:
                j = out[q]

                def behind() -> None:
                    def attach() -> None:
                        def advance() -> Truth:
                            following = link[here.value]
                            here.value = on.select(following < j, following, here.value)
                            return following >= j

                        on.repeat(advance)
                        link[j] = link[here.value]
                        link[here.value] = j
                        mark[j] = i

                    on.when(on.negate(on.same(mark[j], i)), attach)
                    here.value = j

                on.when(j > k.value, behind)

            on.loop(start[k.value + 1], entry, start=start[k.value])
            k.value = link[k.value]
            return k.value >= i

        on.when(head < i, lambda: on.repeat(merge))
        k.value = head

        def keep() -> Truth:
            def store() -> None:
                out[count.value] = k.value

            on.when(count.value < out.size, store)
            count.value = count.value + 1
            k.value = link[k.value]
            return on.either(k.value >= n, count.value > out.size)

        on.repeat(keep)
        start[i + 1] = count.value

    def row(i: Integer) -> None:
        on.when(count.value <= out.size, lambda: fill_row(i))

    on.loop(n, row)
    return on.select(count.value <= out.size, count.value, -1)


@cache
def sparse_lu() -> Program:
    """Return the program of these functions."""
    return Program("sparse_lu", factorise=Entry(factorise), solve=Entry(solve), fill=Entry(fill))
