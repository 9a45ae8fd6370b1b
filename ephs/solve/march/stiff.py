"""Systems of an implicit step: μ/h − J for each eigenvalue μ of the inverse of its coefficients.

The system of three stages falls apart into a real one of the motion's size and one of twice that for the pair. Where
rates of freedoms depend on increments and rates alone, and sums on nothing but these, each falls to one of the size of
the degrees of freedom: with γ = μ/h, (γ² − γ (J_rr + J_vv) + J_rr J_vv − J_rv) δv = f_r + (γ − J_rr) f_v.
"""

from dataclasses import dataclass
from typing import Any, Final, final

from ephs.semantics.linear.dense import clear, copy, dot
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
    indices,
    integer,
    matrix,
    real,
    table,
    vector,
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
    decay, growth, turning
        The eigenvalues of the coefficients' inverse: the real one, and the pair.
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
    decay = real()
    growth = real()
    turning = real()
    stale = integer()
    young = integer()
    split = integer()
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
    single, pair
        (m, m) and, real above imaginary parts, (2 m, m): factors, with `swap` and `end`, and with `swaps` and `ends`.
    inverse, into, out
        (3, 3): the coefficients' inverse, and to and from the parts that it falls into.
    stages, change
        (3, m): increments of the stages, and what an iteration adds to them.
    part, parts
        (m,) and (2 m,).
    right
        (2 n,).
    y, rate, q
        A state and its rates.
    """

    newton: Table[Newton]
    matrix: Matrix
    damping: Matrix
    spring: Matrix
    single: Matrix
    pair: Matrix
    swap: Integers
    swaps: Integers
    end: Integers
    ends: Integers
    inverse: Matrix
    into: Matrix
    out: Matrix
    stages: Matrix
    change: Matrix
    part: Vector
    parts: Vector
    right: Vector
    y: Vector
    rate: Vector
    q: Vector


STIFF: Final[dict[str, Any]] = {
    "newton": table(Newton), "matrix": matrix(), "damping": matrix(), "spring": matrix(), "single": matrix(),
    "pair": matrix(), "swap": indices(), "swaps": indices(), "end": indices(), "ends": indices(), "inverse": matrix(3),
    "into": matrix(3), "out": matrix(3), "stages": matrix(), "change": matrix(), "part": vector(), "parts": vector(),
    "right": vector(), "y": vector(), "rate": vector(), "q": vector(),
}  # fmt: skip


def whole(x: Matrix) -> Vector:
    """All entries of a matrix."""
    return Vector(x.cells, x.start, x.rows * x.columns)


@final
@dataclass(frozen=True, slots=True)
class Solver:
    """The matrices μ/h − J for the real eigenvalue μ and for the pair."""

    on: Evaluator
    stiff: Stiff
    h: Real

    @property
    def _real(self) -> list[Real]:
        return [self.stiff.newton[0].decay / self.h]

    @property
    def _complex(self) -> list[Real]:
        n = self.stiff.newton[0]
        return [n.growth / self.h, n.turning / self.h]

    def factorise(self) -> None:
        """Factorise both."""
        n = self.stiff.newton[0]
        self.on.when(self.on.same(n.split, 1), self._of_freedoms, self._whole)
        n.factored, n.factorisations = self.h, n.factorisations + 1

    def one(self) -> None:
        """Solve for `part` by the real one."""
        s = self.stiff
        self._either([s.part], self._real)

    def two(self) -> None:
        """Solve for `parts` by that of the pair."""
        s, size = self.stiff, self.stiff.matrix.rows
        parts = [s.parts.part(0, size), s.parts.part(size, size)]
        self._either(parts, self._complex)

    def _either(self, parts: list[Vector], by: list[Real]) -> None:
        on, n = self.on, self.stiff.newton[0]
        on.when(on.same(n.split, 1), lambda: self._by_freedoms(parts, by), lambda: self._solve(parts))

    def _factors(self, count: int, size: Integer) -> list[Matrix]:
        """Memory of the factors of the real matrix, or of both parts of the complex one."""
        held = self.stiff.single if count == 1 else self.stiff.pair
        return [Matrix(held.cells, held.start + k * (size * size), size, size) for k in range(count)]

    def _factorise(self, size: Integer) -> None:
        s = self.stiff
        envelope_lu(self.on, self._factors(1, size), s.swap, s.end)
        envelope_lu(self.on, self._factors(2, size), s.swaps, s.ends)

    def _solve(self, parts: list[Vector]) -> None:
        s, count = self.stiff, len(parts)
        swaps, ends = (s.swap, s.end) if count == 1 else (s.swaps, s.ends)
        envelope_solve(self.on, self._factors(count, parts[0].size), swaps, ends, parts)

    def _whole(self) -> None:
        """Write and factorise the matrices of all numbers."""
        on, s = self.on, self.stiff
        size, (decay,), (growth, turning) = s.matrix.rows, self._real, self._complex
        (single,), (real, imaginary) = self._factors(1, size), self._factors(2, size)
        clear(on, whole(imaginary))

        def row(i: Integer) -> None:
            def entry(j: Integer) -> None:
                single[i, j] = real[i, j] = -s.matrix[i, j]

            on.loop(size, entry)
            single[i, i], real[i, i], imaginary[i, i] = single[i, i] + decay, real[i, i] + growth, turning

        on.loop(size, row)
        self._factorise(size)

    def _of_freedoms(self) -> None:
        """Write and factorise the matrices of the freedoms."""
        on, s, n, (decay,), (growth, turning) = self.on, self.stiff, self.stiff.damping.rows, self._real, self._complex
        (single,), (real, imaginary) = self._factors(1, n), self._factors(2, n)

        def row(i: Integer) -> None:
            def entry(j: Integer) -> None:
                single[i, j] = s.spring[i, j] - decay * s.damping[i, j]
                real[i, j], imaginary[i, j] = s.spring[i, j] - growth * s.damping[i, j], -turning * s.damping[i, j]

            on.loop(n, entry)
            single[i, i] = single[i, i] + decay * decay
            real[i, i] = real[i, i] + (growth * growth - turning * turning)
            imaginary[i, i] = imaginary[i, i] + 2.0 * growth * turning

        on.loop(n, row)
        self._factorise(n)

    def _by_freedoms(self, parts: list[Vector], by: list[Real]) -> None:
        """Solve for (δv, δr, δs) in place of (f_v, f_r, f_s): a real right side, or both parts of a complex one."""
        on, s, n, count = self.on, self.stiff, self.stiff.damping.rows, len(parts)
        right = [s.right.part(k * n, n) for k in range(count)]

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
        self._solve(right)
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
