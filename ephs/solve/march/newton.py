"""Stages that depend on each other by Newton's method, with a matrix that is kept while it serves.

Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.8. The system of three stages falls apart by the
eigenvalues of the method's coefficients, into a real system of the motion's size and one of twice that for the pair.
Where rates of freedoms depend on increments and rates alone, and sums on nothing but these, each falls to one of the
size of the freedoms: with γ = μ/h, (γ² − γ (J_rr + J_vv) + J_rr J_vv − J_rv) δv = f_r + (γ − J_rr) f_v.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, final

from ephs.semantics.linear.dense import clear, copy, dot, lu, lu_solve
from ephs.semantics.stage import (
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Real,
    Record,
    Table,
    Truth,
    Vector,
    indices,
    integer,
    matrix,
    real,
    staged,
    table,
    vector,
)
from ephs.solve.march.collocation import evaluate, place
from ephs.solve.march.memory import Errors
from ephs.solve.march.records import Control, Motion, Status, Tableau

__all__ = ["ITERATIONS", "STIFF", "Newton", "Stiff", "filtered", "newton"]

ITERATIONS = 10
"""Iterations after which a step is given up."""
FAST = 0.3
"""A rate of convergence from which on a new matrix is made: one costs as much as a dozen iterations."""
BEYOND = 1e300
"""Bound of numbers: nan is not below it."""


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
    """Memory of implicit steps of a motion whose state has m numbers besides the sums that no rate reads.

    Attributes
    ----------
    newton
        One row.
    matrix
        (m, m): ∂ẏ/∂y.
    damping, spring
        (n, n): J_rr + J_vv and J_rr J_vv − J_rv, of increments v and rates r.
    single, pair
        (m, m) and (2 m, 2 m): factors, with `swap` and `swaps`.
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
    "pair": matrix(), "swap": indices(), "swaps": indices(), "inverse": matrix(3), "into": matrix(3), "out": matrix(3),
    "stages": matrix(), "change": matrix(), "part": vector(), "parts": vector(), "right": vector(), "y": vector(),
    "rate": vector(), "q": vector(),
}  # fmt: skip


@staged
def newton(
    on: Evaluator, motion: Motion, tableau: Tableau, control: Control, base: Vector, start: Vector, h: Real, k: Matrix,
    errors: Errors, stiff: Stiff, y: Vector, q: Vector,
) -> Integer:  # fmt: skip
    """Solve the three stages of a step of length h from (base, start), k[0] known; their rates go to k.

    Returns
    -------
    Integer
        A status: `Status.UNSETTLED` where the iteration does not converge.
    """
    run = _Newton(on, motion, control, start, h, k, stiff)
    n = stiff.newton[0]
    status, tries, done = on.counter(0), on.counter(0), on.counter(0)
    before, rate = on.variable(BEYOND), on.variable(BEYOND)
    on.when(on.negate(on.absolute(n.factored - h) <= 0.0), _Solver(on, stiff, h).factorise)
    clear(on, _whole(stiff.stages))

    def stage(i: Integer) -> None:
        def look() -> None:
            run.place(i, y)
            motion.warm(on, start, y)
            status.value = evaluate(on, motion, control, base, y, q, k.row(i + 1))

        on.when(on.same(status.value, 0), look)

    def once() -> Truth:
        tries.value, n.iterations = tries.value + 1, n.iterations + 1
        on.loop(stiff.stages.rows, stage)
        on.when(on.same(status.value, 0), go)
        return on.either(on.negate(on.same(status.value, 0)), done.value > 0)

    def go() -> None:
        run.solve()
        moved = run.size(errors, y)
        run.move()
        later = tries.value > 1
        rate.value = on.select(later, moved / before.value, BEYOND)
        slow = on.minimum(rate.value, 0.9)
        close = on.both(later, moved * rate.value <= n.enough * (1.0 - slow))
        solved = on.either(moved <= n.enough, close)
        # Rounding, or a matrix that is no good near a change of rank, lets it get no further.
        stuck = on.both(tries.value > 2, on.both(rate.value > 0.5, moved <= n.rough))
        rough = on.either(stuck, on.both(tries.value >= ITERATIONS, moved <= n.rough))
        away = on.both(on.both(tries.value > 2, rate.value >= 1.0), moved > on.maximum(10.0 * n.enough, n.rough))
        lost = on.either(on.negate(moved < BEYOND), on.either(away, tries.value >= ITERATIONS))
        fast = on.either(tries.value <= 2, rate.value < FAST)
        n.stale = on.select(on.both(solved, fast), 0, 1)
        done.value = on.select(on.either(solved, rough), 1, 0)
        failed = on.both(lost, on.same(done.value, 0))
        status.value = on.select(failed, int(Status.UNSETTLED), 0)
        before.value = moved

    on.repeat(once)
    on.when(on.same(status.value, 0), run.rates)
    return status.value


@staged
def filtered(
    on: Evaluator, motion: Motion, tableau: Tableau, control: Control, base: Vector, start: Vector, k: Matrix,
    errors: Errors, stiff: Stiff,
) -> Real:  # fmt: skip
    """Return the error of a step relative to what is allowed, by the method of order 3 embedded in it.

    The difference is filtered by the equations, as its stiff part must be; where it is too large, once more from where
    it leads, as of stiff parts the first estimate is.
    """
    m, n = stiff.part, stiff.newton[0]
    worst, solver = on.variable(0.0), _Solver(on, stiff, n.factored)

    def estimate(first: Vector) -> None:
        def one(j: Integer) -> None:
            m[j] = first[j]
            on.loop(stiff.stages.rows, lambda i: _add(m, j, tableau.error[i + 1] * k[i + 1, j]))

        on.loop(m.size, one)
        solver.one()
        worst.value = 0.0

        def compare(j: Integer) -> None:
            x = on.absolute(m[place(on, motion, j)]) / errors.allowed[j]
            worst.value = on.select(x <= worst.value, worst.value, x)

        on.loop(motion.counted, compare)

    def again() -> None:
        copy(on, start, stiff.y)
        on.loop(m.size, lambda j: _add(stiff.y, j, m[j]))
        motion.warm(on, start, stiff.y)
        status = evaluate(on, motion, control, base, stiff.y, stiff.q, stiff.rate)
        on.when(on.same(status, 0), lambda: estimate(stiff.rate))

    on.when(n.factored > -BEYOND, lambda: estimate(k.row(0)))
    on.when(on.negate(worst.value <= 1.0), again)
    return worst.value


def _whole(x: Matrix) -> Vector:
    return Vector(x.cells, x.start, x.rows * x.columns)


def _set(on: Evaluator, flag: Integer) -> Truth:
    """Tell whether a flag is 1."""
    return on.same(flag, 1)


def _add(x: Vector, j: Integer, by: Real) -> None:
    x[j] = x[j] + by


@final
@dataclass(frozen=True, slots=True)
class _Solver:
    """The matrices μ/h − J for the real eigenvalue μ and for the pair: a complex one, its parts as two real ones."""

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
        self.on.when(_set(self.on, n.split), self._of_freedoms, self._whole)
        n.factored, n.factorisations = self.h, n.factorisations + 1

    def one(self) -> None:
        """Solve for `part` by the real one."""
        s = self.stiff
        self._either([s.part], self._real, lambda: lu_solve(self.on, s.single, s.swap, s.part))

    def two(self) -> None:
        """Solve for `parts` by that of the pair."""
        s, size = self.stiff, self.stiff.matrix.rows
        parts = [s.parts.part(0, size), s.parts.part(size, size)]
        self._either(parts, self._complex, lambda: lu_solve(self.on, s.pair, s.swaps, s.parts))

    def _either(self, parts: list[Vector], by: list[Real], whole: Callable[[], None]) -> None:
        self.on.when(_set(self.on, self.stiff.newton[0].split), lambda: self._by_freedoms(parts, by), whole)

    def _whole(self) -> None:
        """Write and factorise the matrices of all numbers."""
        on, s = self.on, self.stiff
        size, (decay,), (growth, turning) = s.matrix.rows, self._real, self._complex
        clear(on, _whole(s.pair))

        def row(i: Integer) -> None:
            def entry(j: Integer) -> None:
                x = -s.matrix[i, j]
                s.single[i, j], s.pair[i, j], s.pair[size + i, size + j] = x, x, x

            on.loop(size, entry)
            s.single[i, i] = s.single[i, i] + decay
            s.pair[i, i] = s.pair[i, i] + growth
            s.pair[size + i, size + i] = s.pair[size + i, size + i] + growth
            s.pair[i, size + i], s.pair[size + i, i] = -turning, turning

        on.loop(size, row)
        lu(on, s.single, s.swap)
        lu(on, s.pair, s.swaps)

    def _factors(self, size: int) -> Matrix:
        """The factors of the freedoms' matrix: of one, or of a pair."""
        n, held = self.stiff.damping.rows, self.stiff.single if size == 1 else self.stiff.pair
        return Matrix(held.cells, held.start, size * n, size * n)

    def _of_freedoms(self) -> None:
        """Write and factorise the matrices of the freedoms."""
        on, s, n, (decay,), (growth, turning) = self.on, self.stiff, self.stiff.damping.rows, self._real, self._complex
        single, pair = self._factors(1), self._factors(2)

        def row(i: Integer) -> None:
            def entry(j: Integer) -> None:
                single[i, j] = s.spring[i, j] - decay * s.damping[i, j]
                real, imaginary = s.spring[i, j] - growth * s.damping[i, j], -turning * s.damping[i, j]
                pair[i, j], pair[n + i, n + j], pair[i, n + j], pair[n + i, j] = real, real, -imaginary, imaginary

            on.loop(n, entry)
            single[i, i] = single[i, i] + decay * decay
            real, imaginary = growth * growth - turning * turning, 2.0 * growth * turning
            pair[i, i], pair[n + i, n + i] = pair[i, i] + real, pair[n + i, n + i] + real
            pair[i, n + i], pair[n + i, i] = pair[i, n + i] - imaginary, pair[n + i, i] + imaginary

        on.loop(n, row)
        lu(on, single, s.swap)
        lu(on, pair, s.swaps)

    def _by_freedoms(self, parts: list[Vector], by: list[Real]) -> None:
        """Solve for (δv, δr, δs) in place of (f_v, f_r, f_s): a real right side, or both parts of a complex one."""
        on, s, n, count = self.on, self.stiff, self.stiff.damping.rows, len(parts)
        right = [s.right.part(k * n, n) for k in range(count)]

        def project(i: Integer) -> None:
            turned = _times(by, [x[i] for x in parts])
            for x, out, first in zip(parts, right, turned, strict=True):
                out[i] = x[n + i] + first - self._row(n + i, n, n, x.part(0, n))

        def lift(i: Integer) -> None:
            turned = _times(by, [x[i] for x in right])
            for x, found, first in zip(parts, right, turned, strict=True):
                x[n + i] = first - self._row(i, 0, n, found) - x[i]

        def sums(i: Integer) -> None:
            whole = [x[i] + self._row(i, 0, 2 * n, x) for x in parts]
            for x, value in zip(parts, _over(by, whole), strict=True):
                x[i] = value

        on.loop(n, project)
        lu_solve(on, self._factors(count), s.swap if count == 1 else s.swaps, s.right.part(0, count * n))
        on.loop(n, lift)
        for x, found in zip(parts, right, strict=True):
            copy(on, found, x.part(0, n))
        on.loop(s.matrix.rows, sums, start=2 * n)

    def _row(self, i: Integer, first: Integer, count: Integer, x: Vector) -> Real:
        """Part of a row of the matrix times a vector."""
        return dot(self.on, self.stiff.matrix.row(i).part(first, count), x.part(0, count))


def _times(by: list[Real], x: list[Real]) -> list[Real]:
    """A real or a complex product, by parts."""
    return [by[0] * x[0]] if len(by) == 1 else [by[0] * x[0] - by[1] * x[1], by[0] * x[1] + by[1] * x[0]]


def _over(by: list[Real], x: list[Real]) -> list[Real]:
    """A real or a complex quotient, by parts."""
    if len(by) == 1:
        return [x[0] / by[0]]
    size = by[0] * by[0] + by[1] * by[1]
    return [(by[0] * x[0] + by[1] * x[1]) / size, (by[0] * x[1] - by[1] * x[0]) / size]


@final
@dataclass(frozen=True, slots=True)
class _Newton:
    """The parts of an iteration."""

    on: Evaluator
    motion: Motion
    control: Control
    start: Vector
    h: Real
    k: Matrix
    stiff: Stiff

    def place(self, i: Integer, y: Vector) -> None:
        """Write the state at a stage to y."""
        s = self.stiff
        copy(self.on, self.start, y)
        self.on.loop(s.matrix.rows, lambda j: _add(y, j, s.stages[i, j]))

    def solve(self) -> None:
        """Write what Newton's method adds to the stages."""
        on, s, size = self.on, self.stiff, self.stiff.matrix.rows

        def defect(j: Integer) -> None:
            rests = [self.k[i + 1, j] - _weighted(s.inverse, i, s.stages, j) / self.h for i in range(3)]
            for row, out in ((0, s.part), (1, s.parts.part(0, size)), (2, s.parts.part(size, size))):
                out[j] = s.into[row, 0] * rests[0] + s.into[row, 1] * rests[1] + s.into[row, 2] * rests[2]

        def back(j: Integer) -> None:
            for i in range(3):
                x = s.out[i, 0] * s.part[j] + s.out[i, 1] * s.parts[j] + s.out[i, 2] * s.parts[size + j]
                s.change[i, j] = x

        on.loop(size, defect)
        solver = _Solver(on, s, self.h)
        solver.one()
        solver.two()
        on.loop(size, back)

    def size(self, errors: Errors, y: Vector) -> Real:
        """The largest change, relative to what is allowed of the sizes that stages reach; these go to y.

        What starts from nothing, as heat does, is measured by what it becomes.
        """
        on, s, worst = self.on, self.stiff, self.on.variable(0.0)
        copy(on, self.start, y)

        def reach(j: Integer) -> None:
            most = on.variable(0.0)
            for i in range(3):
                most.value = on.maximum(most.value, on.absolute(s.stages[i, j] + s.change[i, j]))
            y[j] = on.absolute(y[j]) + most.value

        def compare(j: Integer) -> None:
            for i in range(3):
                x = on.absolute(s.change[i, place(on, self.motion, j)]) / errors.allowed[j]
                worst.value = on.select(x <= worst.value, worst.value, x)

        on.loop(s.matrix.rows, reach)
        self.motion.sizes(on, self.start, y, errors.allowed)

        def allow(j: Integer) -> None:
            errors.allowed[j] = errors.atol[j] + errors.rtol[j] * errors.allowed[j]

        on.loop(self.motion.counted, allow)
        on.loop(self.motion.counted, compare)
        return worst.value

    def move(self) -> None:
        """Add the change to the stages."""
        s = self.stiff
        stages, change = _whole(s.stages), _whole(s.change)
        self.on.loop(stages.size, lambda j: _add(stages, j, change[j]))

    def rates(self) -> None:
        """Rates that lead to the stages, of all that is not summed: these are those of the stages."""
        s = self.stiff

        def one(j: Integer) -> None:
            for i in range(3):
                self.k[i + 1, j] = _weighted(s.inverse, i, s.stages, j) / self.h

        self.on.loop(self.motion.summed, one)


def _weighted(weights: Matrix, i: int, stages: Matrix, j: Integer) -> Real:
    return weights[i, 0] * stages[0, j] + weights[i, 1] * stages[1, j] + weights[i, 2] * stages[2, j]
