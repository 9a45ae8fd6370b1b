"""Symmetric matrices by the rows of their lower triangles, each from its first entry that is not zero on.

George and Liu, *Computer Solution of Large Sparse Positive Definite Systems*, 1981, 4.3: the factor of Cholesky has
the same rows.
"""

from ephs.semantics.linear.dense import dot
from ephs.semantics.stage import Evaluator, Integer, Integers, Matrix, Truth, Vector


def skyline_cholesky(on: Evaluator, a: Matrix, first: Integers) -> Integer:
    """Factorise A = L Lᵀ in place.

    Parameters
    ----------
    first
        (n,): where each row begins; what is before is not read.

    Returns
    -------
    Integer
        0, or 1 + the first row whose pivot is not positive, where it stops.
    """
    n = a.rows
    at, failed, rest = on.counter(0), on.counter(0), on.variable(0.0)

    def row() -> Truth:
        i = at.value

        def entry(j: Integer) -> None:
            begin = on.select(first[i] > first[j], first[i], first[j])
            rest.value = a[i, j]

            def less(k: Integer) -> None:
                rest.value = rest.value - a[i, k] * a[j, k]

            on.loop(j, less, start=begin)

        def left(j: Integer) -> None:
            entry(j)
            a[i, j] = rest.value / a[j, j]

        on.loop(i, left, start=first[i])
        entry(i)

        def pivot() -> None:
            a[i, i] = on.sqrt(rest.value)

        def stop() -> None:
            failed.value = i + 1

        on.when(rest.value > 0.0, pivot, stop)
        at.value = i + 1
        return on.either(failed.value > 0, i + 1 >= n)

    on.when(n > 0, lambda: on.repeat(row))
    return failed.value


def skyline_solve(on: Evaluator, factor: Matrix, first: Integers, x: Vector) -> None:
    """x ← L⁻ᵀ L⁻¹ x."""

    def down(i: Integer) -> None:
        begin = first[i]
        known = dot(on, factor.row(i).part(begin, i - begin), x.part(begin, i - begin))
        x[i] = (x[i] - known) / factor[i, i]

    def up(i: Integer) -> None:
        value = x[i] = x[i] / factor[i, i]

        def less(k: Integer) -> None:
            x[k] = x[k] - factor[i, k] * value

        on.loop(i, less, start=first[i])

    on.loop(x.size, down)
    on.loop(x.size, up, down=True)


def skyline_times(on: Evaluator, a: Matrix, first: Integers, x: Vector, out: Vector) -> None:
    """Write A x."""

    def row(i: Integer) -> None:
        total, value = on.variable(a[i, i] * x[i]), x[i]

        def add(j: Integer) -> None:
            total.value = total.value + a[i, j] * x[j]
            out[j] = out[j] + a[i, j] * value

        on.loop(i, add, start=first[i])
        out[i] = total.value

    on.loop(x.size, row)
