"""Implicit stages by Newton's method, with a matrix that is reused while it converges.

Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.8.
"""

from dataclasses import dataclass
from typing import final

from ephs.semantics.linear.dense import add_to, clear, copy, dot
from ephs.semantics.stage import Evaluator, Integer, Matrix, Real, Vector, staged
from ephs.solve.march.evaluating import MarchStep, allow, evaluate, place
from ephs.solve.march.iteration import BEYOND, FAST, iterate
from ephs.solve.march.memory import Errors
from ephs.solve.march.records import Status
from ephs.solve.march.stiff import Solver, Stiff, whole


@staged
def newton(on: Evaluator, step: MarchStep, errors: Errors, stiff: Stiff) -> Integer:
    """Solve the stages of a step, k[0] known; their rates go to k.

    Returns
    -------
    Integer
        A status: `Status.UNSETTLED` where the iteration does not converge.
    """
    run, k, h, n = _NewtonParts(on, step, stiff), step.k, step.h, stiff.newton[0]
    status, moved = on.counter(0), on.variable(0.0)
    on.when(on.negate(on.absolute(n.factored - h) <= 0.0), Solver(on, stiff, h).factorise)
    clear(on, whole(stiff.stages))

    def stage(i: Integer) -> None:
        def check_size() -> None:
            run.place(i)
            step.motion.warm(on, step.start, step.y)
            status.value = evaluate(on, step, step.y, step.q, k.row(i + 1))

        on.when(on.same(status.value, 0), check_size)

    def rest(i: Integer) -> None:
        copy(on, k.row(0), k.row(i + 1))

    def correct(tries: Integer) -> Real:
        n.iterations, moved.value = n.iterations + 1, 2.0 * BEYOND
        # The stages begin at the start of the step, whose rates are known.
        begins = on.same(tries, 1)
        on.when(begins, lambda: on.loop(stiff.stages.rows, rest), lambda: on.loop(stiff.stages.rows, stage))
        on.when(on.same(status.value, 0), solve_once)
        return moved.value

    def solve_once() -> None:
        run.solve()
        moved.value = run.size(errors)
        run.move()

    found = iterate(on, correct, n.enough, n.rough, FAST)

    def judge() -> None:
        n.stale = on.select(found.fast, 0, 1)
        status.value = on.select(found.solved, 0, int(Status.UNSETTLED))

    on.when(on.same(status.value, 0), judge)
    on.when(on.same(status.value, 0), run.rates)
    return status.value


@staged
def filtered(on: Evaluator, step: MarchStep, errors: Errors, stiff: Stiff) -> Real:
    """Return the error of a step relative to the tolerance, by the embedded method, of order ``stages``.

    The difference is filtered by the equations, as its stiff part must be; where it is too large, once more from where
    it leads, as of stiff parts the first estimate is.
    """
    m, n, motion = stiff.parts.row(0), stiff.newton[0], step.motion
    worst, solver = on.variable(0.0), Solver(on, stiff, n.factored)

    def estimate(first: Vector) -> None:
        def each_entry(j: Integer) -> None:
            m[j] = first[j]
            on.loop(stiff.stages.rows, lambda i: add_to(m, j, step.tableau.error[i + 1] * step.k[i + 1, j]))

        on.loop(m.size, each_entry)
        solver.one()
        worst.value = 0.0

        def compare(j: Integer) -> None:
            x = on.absolute(m[place(on, motion, j)]) / errors.allowed[j]
            worst.value = on.select(x <= worst.value, worst.value, x)

        on.loop(motion.counted, compare)

    def again() -> None:
        copy(on, step.start, stiff.y)
        on.loop(m.size, lambda j: add_to(stiff.y, j, m[j]))
        motion.warm(on, step.start, stiff.y)
        status = evaluate(on, step, stiff.y, stiff.q, stiff.rate)
        on.when(on.same(status, 0), lambda: estimate(stiff.rate))

    on.when(n.factored > -BEYOND, lambda: estimate(step.k.row(0)))
    on.when(on.negate(worst.value <= 1.0), again)
    return worst.value


@final
@dataclass(frozen=True, slots=True)
class _NewtonParts:
    """The parts of an iteration."""

    on: Evaluator
    step: MarchStep
    stiff: Stiff

    def place(self, i: Integer) -> None:
        """Write the state at a stage to y."""
        s, y = self.stiff, self.step.y
        copy(self.on, self.step.start, y)
        self.on.loop(s.matrix.rows, lambda j: add_to(y, j, s.stages[i, j]))

    def solve(self) -> None:
        """Write the Newton corrections of the stages."""
        on, s, size = self.on, self.stiff, self.stiff.matrix.rows

        def defect(j: Integer) -> None:
            def rest(i: Integer) -> None:
                s.part[i] = self.step.k[i + 1, j] - self._led(i, j)

            def turn(i: Integer) -> None:
                s.parts[i, j] = dot(on, s.into.row(i), s.part)

            on.loop(s.stages.rows, rest)
            on.loop(s.stages.rows, turn)

        def back(i: Integer) -> None:
            def entry(j: Integer) -> None:
                s.change[i, j] = _summed(on, s.out.row(i), s.parts, j)

            on.loop(size, entry)

        on.loop(size, defect)
        Solver(on, s, self.step.h).all()
        on.loop(s.stages.rows, back)

    def size(self, errors: Errors) -> Real:
        """Largest change relative to the tolerance at the stages' values, which are written to y.

        What starts from nothing, as heat does, is measured by what it becomes.
        """
        on, s, worst, motion, y = self.on, self.stiff, self.on.variable(0.0), self.step.motion, self.step.y
        copy(on, self.step.start, y)

        def reach(j: Integer) -> None:
            most = on.variable(0.0)

            def stage(i: Integer) -> None:
                most.value = on.maximum(most.value, on.absolute(s.stages[i, j] + s.change[i, j]))

            on.loop(s.stages.rows, stage)
            y[j] = on.absolute(y[j]) + most.value

        def compare(j: Integer) -> None:
            def stage(i: Integer) -> None:
                x = on.absolute(s.change[i, place(on, motion, j)]) / errors.allowed[j]
                worst.value = on.select(x <= worst.value, worst.value, x)

            on.loop(s.stages.rows, stage)

        on.loop(s.matrix.rows, reach)
        allow(on, motion, errors, self.step.start, y)
        on.loop(motion.counted, compare)
        return worst.value

    def move(self) -> None:
        """Add the change to the stages."""
        s = self.stiff
        stages, change = whole(s.stages), whole(s.change)
        self.on.loop(stages.size, lambda j: add_to(stages, j, change[j]))

    def rates(self) -> None:
        """Rates that lead to the stages, of all that is not summed: these are those of the stages."""

        def stage(i: Integer) -> None:
            def each_entry(j: Integer) -> None:
                self.step.k[i + 1, j] = self._led(i, j)

            self.on.loop(self.step.motion.summed, each_entry)

        self.on.loop(self.stiff.stages.rows, stage)

    def _led(self, i: Integer, j: Integer) -> Real:
        """The rate of one number at a stage that leads to the increments of all stages."""
        s = self.stiff
        return _summed(self.on, s.inverse.row(i), s.stages, j) / self.step.h


def _summed(on: Evaluator, weights: Vector, rows: Matrix, j: Integer) -> Real:
    """One entry of the weighted sum of a matrix's rows."""
    total = on.variable(0.0)

    def add(i: Integer) -> None:
        total.value = total.value + weights[i] * rows[i, j]

    on.loop(rows.rows, add)
    return total.value
