"""LU factors in place of real and complex matrices, with no work where rows have ended or columns change nothing.

A complex matrix or vector is a pair: its real and its imaginary part.
"""

from collections.abc import Sequence

from ephs.semantics.stage import Evaluator, Integer, Integers, Matrix, Real, Vector


def envelope_lu(on: Evaluator, a: Sequence[Matrix], pivots: Integers, ends: Integers) -> None:
    """Factorise P A = L U in place with partial pivoting.

    Factors of a matrix whose column has no pivot but zero are not finite. The derivative of a factor that is 0 is lost.

    Parameters
    ----------
    a
        One matrix (n, n), or both parts of a complex one.
    pivots, ends
        (n,): the row exchanged with each; where each row of U ends, beyond which it is zero.
    """
    n = a[0].rows
    best, largest = on.counter(0), on.variable(0.0)

    def size(i: Integer, k: Integer) -> Real:
        found = [on.absolute(x[i, k]) for x in a]
        return found[0] if len(found) == 1 else found[0] + found[1]

    def width(i: Integer) -> None:
        ends[i] = i + 1

        def each_entry(j: Integer) -> None:
            ends[i] = on.select(size(i, j) > 0.0, j + 1, ends[i])

        on.loop(n, each_entry, start=i + 1)

    def column(k: Integer) -> None:
        best.value, largest.value = k, size(k, k)

        def search(i: Integer) -> None:
            found = size(i, k)
            best.value = on.select(found > largest.value, i, best.value)
            largest.value = on.maximum(largest.value, found)

        on.loop(n, search, start=k + 1)
        row = pivots[k] = best.value

        def exchange() -> None:
            upper, lower = ends[k], ends[row]
            last = on.select(upper > lower, upper, lower)
            ends[k], ends[row] = lower, upper

            def entry(j: Integer) -> None:
                for x in a:
                    above, below = x[k, j], x[row, j]
                    x[k, j], x[row, j] = below, above

            on.loop(last, entry)

        on.when(on.negate(on.same(row, k)), exchange)
        inverse = _inverse([x[k, k] for x in a])

        def below(i: Integer) -> None:
            def eliminate() -> None:
                factor = times(inverse, [x[i, k] for x in a])
                for x, part in zip(a, factor, strict=True):
                    x[i, k] = part

                def entry(j: Integer) -> None:
                    for x, part in zip(a, times(factor, [x[k, j] for x in a]), strict=True):
                        x[i, j] = x[i, j] - part

                on.loop(ends[k], entry, start=k + 1)
                ends[i] = on.select(ends[k] > ends[i], ends[k], ends[i])

            on.when(size(i, k) > 0.0, eliminate)

        on.loop(n, below, start=k + 1)

    on.loop(n, width)
    on.loop(n, column)


def envelope_solve(
    on: Evaluator, factors: Sequence[Matrix], pivots: Integers, ends: Integers, x: Sequence[Vector]
) -> None:
    """x ← A⁻¹ x, from the factors of `envelope_lu`; x is one vector (n,), or both parts of a complex one."""
    n, rest = x[0].size, [on.variable(0.0) for _ in x]

    def exchange(k: Integer) -> None:
        for part in x:
            upper, lower = part[k], part[pivots[k]]
            part[k], part[pivots[k]] = lower, upper

    def row(i: Integer, first: Integer, last: Integer) -> list[Real]:
        for total, part in zip(rest, x, strict=True):
            total.value = part[i]

        def less(k: Integer) -> None:
            found = times([a[i, k] for a in factors], [part[k] for part in x])
            for total, part in zip(rest, found, strict=True):
                total.value = total.value - part

        on.loop(last, less, start=first)
        return [total.value for total in rest]

    def down(i: Integer) -> None:
        for part, value in zip(x, row(i, 0, i), strict=True):
            part[i] = value

    def up(i: Integer) -> None:
        found = times(_inverse([a[i, i] for a in factors]), row(i, i + 1, ends[i]))
        for part, value in zip(x, found, strict=True):
            part[i] = value

    on.loop(n, exchange)
    on.loop(n, down)
    on.loop(n, up, down=True)


def times(a: Sequence[Real], b: Sequence[Real]) -> list[Real]:
    """A real or a complex product, by parts."""
    return [a[0] * b[0]] if len(a) == 1 else [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]


def _inverse(a: Sequence[Real]) -> list[Real]:
    """1/a, real or complex, by parts."""
    if len(a) == 1:
        return [1.0 / a[0]]
    square = a[0] * a[0] + a[1] * a[1]
    return [a[0] / square, -a[1] / square]
