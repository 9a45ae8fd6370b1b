"""Systems of an implicit step: μ/h − J for each eigenvalue μ of the inverse of its coefficients.

The system of an odd number of stages falls apart into a real one of the motion's size and complex ones for the pairs.
Where rates of freedoms depend on increments and rates alone, and sums on nothing but these, each falls to one of the
size of the degrees of freedom: with γ = μ/h, (γ² − γ (J_rr + J_vv) + J_rr J_vv − J_rv) δv = f_r + (γ − J_rr) f_v.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from ephs.semantics.linear.dense import copy, dot
from ephs.semantics.linear.envelope import envelope_lu, envelope_solve, times
from ephs.semantics.stage import (
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Real,
    Record,
    Table,
    Vector,
    integer,
    real,
)


class Newton(Record):
    """State of the iteration.

    Attributes
    ----------
    enough, rough
        Change of an iteration, relative to what is allowed, after which stages are solved; that is good enough where
        the iteration gets no further.
    factored
        Step in s for which the matrices are factorised; 0: none.
    pairs
        Number of pairs of complex eigenvalues.
    stale
        1 where the matrix served badly.
    young
        1 where it is that of the state.
    split
        1 where no rate of the matrix depends on the numbers after increments and rates.
    iterations, factorisations
        Counts.
    """

    enough = real()
    rough = real()
    factored = real()
    stale = integer()
    young = integer()
    split = integer()
    pairs = integer()
    iterations = integer()
    factorisations = integer()


@final
@dataclass(frozen=True, slots=True)
class Stiff:
    """Memory of implicit steps of a motion with m state coordinates besides sums on which no rate depends.

    Attributes
    ----------
    newton
        One row.
    matrix
        (m, m): ∂ẏ/∂y.
    damping, spring
        (n, n): J_rr + J_vv and J_rr J_vv − J_rv, of increments v and rates r.
    factors
        (stages · m, m): of the real system, then real above imaginary parts of each complex one.
    swaps, ends
        (systems · m,): what belongs to the factors.
    values
        (stages,): the eigenvalues of the coefficients' inverse: the real one, then both parts of one of each pair.
    inverse, into, out
        (stages, stages): the coefficients' inverse, and to and from the parts that it falls into.
    stages, change, parts
        (stages, m): increments of the stages, what an iteration adds to them, and the right sides of the systems.
    part
        (stages,): of one number at all stages.
    right
        (2 n,).
    y, rate, q
        A state and its rates.
    """

    newton: Table[Newton]
    matrix: Matrix
    damping: Matrix
    spring: Matrix
    factors: Matrix
    swaps: Integers
    ends: Integers
    values: Vector
    inverse: Matrix
    into: Matrix
    out: Matrix
    stages: Matrix
    change: Matrix
    parts: Matrix
    part: Vector
    right: Vector
    y: Vector
    rate: Vector
    q: Vector


def whole(x: Matrix) -> Vector:
    """All entries of a matrix."""
    return Vector(x.cells, x.start, x.rows * x.columns)


@final
@dataclass(frozen=True, slots=True)
class _ShiftedSystem:
    """μ/h − J of an eigenvalue μ, of all numbers or of the freedoms alone; a real one, or both parts of a complex one.

    Attributes
    ----------
    factors, parts
        Memory of its factors, and its right side or solution.
    by
        μ/h.
    """

    factors: list[Matrix]
    swaps: Integers
    ends: Integers
    parts: list[Vector]
    by: list[Real]


@final
@dataclass(frozen=True, slots=True)
class Solver:
    """The systems of all eigenvalues."""

    on: Evaluator
    stiff: Stiff
    h: Real

    def factorise(self) -> None:
        """Factorise all."""
        n = self.stiff.newton[0]
        self.on.when(self.on.same(n.split, 1), self._of_freedoms, self._whole)
        n.factored, n.factorisations = self.h, n.factorisations + 1

    def one(self) -> None:
        """Solve for the first row of `parts`, by the real one."""
        self._solve(0, 1)

    def all(self) -> None:
        """Solve for all rows of `parts`."""
        self.one()
        self.on.loop(self.stiff.newton[0].pairs, lambda pair: self._solve(pair, 2))

    def _each(self, size: Integer, do: Callable[[_ShiftedSystem], None]) -> None:
        do(self._system(0, 1, size))
        self.on.loop(self.stiff.newton[0].pairs, lambda pair: do(self._system(pair, 2, size)))

    def _system(self, pair: Integer, count: int, size: Integer) -> _ShiftedSystem:
        """The real one, of which count is 1, or that of a pair."""
        s, m = self.stiff, self.stiff.matrix.rows
        first = 0 if count == 1 else 2 * pair + 1
        place = 0 if count == 1 else (pair + 1) * m
        held, rows = s.factors, [first + k for k in range(count)]
        return _ShiftedSystem(
            [Matrix(held.cells, held.start + row * (m * m), size, size) for row in rows],
            s.swaps.part(place, size), s.ends.part(place, size), [s.parts.row(row) for row in rows],
            [s.values[row] / self.h for row in rows],
        )  # fmt: skip

    def _solve(self, pair: Integer, count: int) -> None:
        s = self.stiff
        whole, freedoms = (self._system(pair, count, size) for size in (s.matrix.rows, s.damping.rows))
        self.on.when(
            self.on.same(s.newton[0].split, 1), lambda: self._by_freedoms(freedoms),
            lambda: self._solved(whole, whole.parts),
        )  # fmt: skip

    def _solved(self, system: _ShiftedSystem, parts: list[Vector]) -> None:
        envelope_solve(self.on, system.factors, system.swaps, system.ends, parts)

    def _whole(self) -> None:
        """Write and factorise the matrices of all numbers."""
        on, s = self.on, self.stiff

        def each_row(system: _ShiftedSystem) -> None:
            def row(i: Integer) -> None:
                def entry(j: Integer) -> None:
                    for k, x in enumerate(system.factors):
                        x[i, j] = 0.0 if k else -s.matrix[i, j]

                on.loop(s.matrix.rows, entry)
                for x, by in zip(system.factors, system.by, strict=True):
                    x[i, i] = x[i, i] + by

            on.loop(s.matrix.rows, row)
            envelope_lu(on, system.factors, system.swaps, system.ends)

        self._each(s.matrix.rows, each_row)

    def _of_freedoms(self) -> None:
        """Write and factorise the matrices of the freedoms."""
        on, s, n = self.on, self.stiff, self.stiff.damping.rows

        def each_row(system: _ShiftedSystem) -> None:
            def row(i: Integer) -> None:
                def entry(j: Integer) -> None:
                    for k, (x, by) in enumerate(zip(system.factors, system.by, strict=True)):
                        x[i, j] = (0.0 if k else s.spring[i, j]) - by * s.damping[i, j]

                on.loop(n, entry)
                for x, square in zip(system.factors, times(system.by, system.by), strict=True):
                    x[i, i] = x[i, i] + square

            on.loop(n, row)
            envelope_lu(on, system.factors, system.swaps, system.ends)

        self._each(n, each_row)

    def _by_freedoms(self, system: _ShiftedSystem) -> None:
        """Solve for (δv, δr, δs) in place of (f_v, f_r, f_s)."""
        on, s, n, by, parts = self.on, self.stiff, self.stiff.damping.rows, system.by, system.parts
        right = [s.right.part(k * n, n) for k in range(len(parts))]

        def project(i: Integer) -> None:
            turned = times(by, [x[i] for x in parts])
            for x, out, first in zip(parts, right, turned, strict=True):
                out[i] = x[n + i] + first - self._row(n + i, n, n, x.part(0, n))

        def lift(i: Integer) -> None:
            turned = times(by, [x[i] for x in right])
            for x, found, first in zip(parts, right, turned, strict=True):
                x[n + i] = first - self._row(i, 0, n, found) - x[i]

        def sums(i: Integer) -> None:
            whole = [x[i] + self._row(i, 0, 2 * n, x) for x in parts]
            for x, value in zip(parts, _over(by, whole), strict=True):
                x[i] = value

        on.loop(n, project)
        self._solved(system, right)
        on.loop(n, lift)
        for x, found in zip(parts, right, strict=True):
            copy(on, found, x.part(0, n))
        on.loop(s.matrix.rows, sums, start=2 * n)

    def _row(self, i: Integer, first: Integer, count: Integer, x: Vector) -> Real:
        """Part of a row of the matrix times a vector."""
        return dot(self.on, self.stiff.matrix.row(i).part(first, count), x.part(0, count))


def _over(by: list[Real], x: list[Real]) -> list[Real]:
    """A real or a complex quotient, by parts."""
    if len(by) == 1:
        return [x[0] / by[0]]
    size = by[0] * by[0] + by[1] * by[1]
    return [(by[0] * x[0] + by[1] * x[1]) / size, (by[0] * x[1] - by[1] * x[0]) / size]
