"""Constraint rows in the metric of a mass matrix: rank, least corrections, multipliers.

Rows J x = target are turned to A = J L⁻ᵀ with the mass matrix M = L Lᵀ and orthonormalised, largest remainder first, as
by QR with pivoting. So rank is decided in the mass metric, and never on the square of a matrix.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, final

from ephs.semantics.linear.dense import backward, cholesky, copy, dot, forward, norm, subtract
from ephs.semantics.spaces.rank import EXPLICIT, REGULAR, ROUNDED
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Program,
    Real,
    Truth,
    Vector,
    members,
    staged,
)


@final
@dataclass(frozen=True, slots=True)
class Rows:
    """Rows and the memory of their factors.

    Attributes
    ----------
    row
        (m, n): J.
    terms
        (m,): length of each row in the mass metric if nothing in it cancelled.
    factor
        (n, n): L in the lower triangle.
    scaled, plain
        (m, n): rows in the mass metric and without masses; orthonormalised.
    triangle
        (m, m): their coefficients on the orthonormal rows; its diagonal their remainders.
    chosen
        (m,): rows in the order in which they were taken, those that depend on others last.
    """

    row: Matrix
    terms: Vector
    factor: Matrix
    scaled: Matrix
    plain: Matrix
    triangle: Matrix
    chosen: Integers


def _scale(on: Evaluator, x: Vector, divisor: Real) -> None:
    def each_entry(i: Integer) -> None:
        x[i] = x[i] / divisor

    on.loop(x.size, each_entry)


@staged
def _remainder(on: Evaluator, rows: Rows, count: Integer, taken: Integer) -> Real:
    """Largest remainder of the rows not taken yet, once those taken are out, beside the largest row: without masses."""
    size, largest = on.variable(0.0), on.variable(0.0)

    def each_entry(c: Integer) -> None:
        number = rows.chosen[c]
        plain = rows.plain.row(number)
        copy(on, rows.row.row(number), plain)
        size.value = on.maximum(size.value, norm(on, plain))

        def out(b: Integer) -> None:
            base = rows.plain.row(rows.chosen[b])
            subtract(on, dot(on, plain, base), base, plain)

        for _ in range(2):
            on.loop(on.select(c < taken, c, taken), out)
        rest = norm(on, plain)

        def normalise() -> None:
            _scale(on, plain, on.select(rest > 0.0, rest, 1.0))

        def measure() -> None:
            largest.value = on.select(
                rows.triangle[number, number] > 0.0, on.maximum(largest.value, rest), largest.value
            )

        on.when(c < taken, normalise, measure)

    on.loop(count, each_entry)
    return on.select(size.value > 0.0, largest.value / size.value, 0.0)


def orthonormalise(on: Evaluator, rows: Rows, count: Integer) -> Integer:
    """Orthonormalise the first ``count`` rows in the mass metric; return their rank.

    A row counts as repeating others where little is left of it both in the mass metric and without masses: in the first
    alone a constraint between heavy bodies looks small beside one that moves light ones.
    """
    chosen, scaled, triangle = rows.chosen, rows.scaled, rows.triangle
    largest = on.variable(0.0)

    def metric(a: Integer) -> None:
        chosen[a] = a
        copy(on, rows.row.row(a), scaled.row(a))
        forward(on, rows.factor, scaled.row(a))
        size = norm(on, scaled.row(a))
        # A row that cancels to rounding is no equation: the loop cannot open in this direction.
        size = on.select(size > ROUNDED * rows.terms[a], size, 0.0)
        triangle[a, a] = size
        largest.value = on.maximum(largest.value, size)

    on.loop(count, metric)
    rank, best, stop, most = on.counter(0), on.counter(0), on.counter(0), on.variable(0.0)

    def take() -> None:
        j = rank.value
        number, other = chosen[best.value], chosen[j]
        chosen[j], chosen[best.value] = number, other
        row = scaled.row(number)

        def out(b: Integer) -> None:
            base = scaled.row(chosen[b])
            part = dot(on, row, base)
            triangle[number, chosen[b]] = triangle[number, chosen[b]] + part
            subtract(on, part, base, row)

        for _ in range(2):  # once more against what rounding left
            on.loop(j, out)
        size = norm(on, row)
        triangle[number, number] = size
        _scale(on, row, size)

        def rest(a: Integer) -> None:
            other = chosen[a]
            part = dot(on, scaled.row(other), row)
            subtract(on, part, row, scaled.row(other))
            triangle[other, number] = part
            triangle[other, other] = norm(on, scaled.row(other))

        on.loop(count, rest, start=j + 1)
        rank.value = j + 1

    def following() -> Truth:
        best.value, most.value = -1, 0.0

        def search(a: Integer) -> None:
            size = triangle[chosen[a], chosen[a]]
            best.value = on.select(size > most.value, a, best.value)
            most.value = on.select(size > most.value, size, most.value)

        on.loop(count, search, start=rank.value)
        stop.value = on.select(on.either(best.value < 0, most.value <= REGULAR * largest.value), 1, 0)

        def compare_rows() -> None:
            repeats = _remainder(on, rows, count, rank.value) <= EXPLICIT
            stop.value = on.select(repeats, 1, 0)

        on.when(on.both(on.same(stop.value, 0), most.value <= EXPLICIT * largest.value), compare_rows)
        on.when(on.same(stop.value, 0), take)
        return on.either(on.same(stop.value, 1), rank.value >= count)

    on.when(count > 0, lambda: on.repeat(following))
    return rank.value


def correct(on: Evaluator, rows: Rows, rank: Integer, target: Vector, step: Vector, out: Vector) -> None:
    """Least change x in the mass metric with J x = target on the first ``rank`` chosen rows; ``step`` receives L ᵀx's
    coordinates (rank,) on the orthonormal rows."""
    n, rest = rows.factor.rows, on.variable(0.0)

    def clear(i: Integer) -> None:
        out[i] = 0.0

    on.loop(n, clear)

    def each_row(j: Integer) -> None:
        number = rows.chosen[j]
        rest.value = target[number]

        def less(b: Integer) -> None:
            rest.value = rest.value - rows.triangle[number, rows.chosen[b]] * step[b]

        on.loop(j, less)
        step[j] = rest.value / rows.triangle[number, number]

        def add(i: Integer) -> None:
            out[i] = out[i] + step[j] * rows.scaled[number, i]

        on.loop(n, add)

    on.loop(rank, each_row)
    backward(on, rows.factor, out)


def multipliers(on: Evaluator, rows: Rows, count: Integer, rank: Integer, step: Vector, out: Vector) -> None:
    """Multipliers (m,) with Jᵀ out = M x of the change that `correct` found; zero of rows that depend on others."""
    rest = on.variable(0.0)

    def each_row(j: Integer) -> None:
        number = rows.chosen[j]
        rest.value = step[j]

        def less(b: Integer) -> None:
            other = rows.chosen[b]
            rest.value = rest.value - rows.triangle[other, number] * out[other]

        on.loop(rank, less, start=j + 1)
        out[number] = rest.value / rows.triangle[number, number]

    def free(j: Integer) -> None:
        out[rows.chosen[j]] = 0.0

    on.loop(rank, each_row, down=True)
    on.loop(count, free, start=rank)


def solve(on: Evaluator, factor: Matrix, x: Vector) -> None:
    """x ← M⁻¹ x, from M's Cholesky factor."""
    forward(on, factor, x)
    backward(on, factor, x)


def _whole(on: Evaluator, a: Matrix, factor: Matrix) -> Integer:
    return cholesky(on, a, factor)


@cache
def row_program() -> Program:
    """Return the program of these functions; rows are handed over as the fields of `Rows`, in order."""
    rows = members(Rows)

    def entry(function: Callable[..., Any]) -> Entry:
        return Entry.bundled(function, rows, (rows, Rows))

    return Program(
        "constraint_rows", cholesky=Entry(_whole), solve=Entry(solve), orthonormalise=entry(orthonormalise),
        correct=entry(correct), multipliers=entry(multipliers),
    )  # fmt: skip
