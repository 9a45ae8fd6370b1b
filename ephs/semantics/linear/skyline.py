"""Symmetric matrices by the rows of their lower triangles, each from its first entry that is not zero on.

George and Liu, *Computer Solution of Large Sparse Positive Definite Systems*, 1981, 4.3: the factor of
`ephs.semantics.linear.dense.cholesky` has the same rows.
"""

from ephs.semantics.linear.dense import dot
from ephs.semantics.stage import Evaluator, Integer, Integers, Matrix, Vector


def skyline_solve(on: Evaluator, factor: Matrix, first: Integers, x: Vector) -> None:
    """x ← L⁻ᵀ L⁻¹ x."""

    def down(i: Integer) -> None:
        begin = first[i]
        known = dot(on, factor.row(i).part(begin, i - begin), x.part(begin, i - begin))
        x[i] = (x[i] - known) * (1.0 / factor[i, i])

    def up(i: Integer) -> None:
        value = x[i] = x[i] * (1.0 / factor[i, i])

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
