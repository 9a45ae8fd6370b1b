"""One step: its stages, the estimates of its error, the fastest mode that it shows."""

from ephs.mechanics.solve.march.records import Control, Memory, Motion, Status, Tableau
from ephs.semantics.linear.dense import copy
from ephs.semantics.stage import Evaluator, Integer, Matrix, Real, Truth, Vector, staged

__all__ = ["DRIFT", "allow", "attempt", "drift", "error_of", "first", "stiffness"]

DRIFT = 1e-2
"""Share of a step's drift off the constraints that counts as its error.

Closing the loops takes the drift out along normals at the step's end. Near a change of rank normals turn fast: there a
stage's drift has a part along the motion that the embedded formula misses. Tried on rows of one to ten four-bars: with
1e-3 errors of 100 tolerances are left at 1e-9, with 1e-1 steps become many times more.
"""


@staged
def first(on: Evaluator, motion: Motion, memory: Memory, control: Control) -> Integer:
    """Evaluate the rates at the state into the first row of k; return a status."""
    control.evaluations = control.evaluations + 1
    status, component = motion.rates(on, memory.q, memory.y, memory.q1, memory.k.row(0))
    control.component = component
    return status


@staged
def attempt(
    on: Evaluator,
    motion: Motion,
    tableau: Tableau,
    control: Control,
    base: Vector,
    start: Vector,
    h: Real,
    k: Matrix,
    last: Vector,
    y: Vector,
    q: Vector,
) -> Integer:
    """Evaluate the stages of a step of length h from (base, start), k[0] known.

    The step's end goes to y and q, the rates there to the last row of k, y at the last stage to ``last``.

    Returns
    -------
    Integer
        A status.
    """
    count = tableau.a.columns
    stage, status = on.counter(1), on.counter(0)

    def one() -> Truth:
        i = stage.value
        copy(on, start, y)

        def add(s: Integer) -> None:
            weight = h * tableau.a[i, s]

            def entry(j: Integer) -> None:
                y[j] = y[j] + weight * k[s, j]

            on.when(on.negate(on.absolute(weight) <= 0.0), lambda: on.loop(y.size, entry))

        on.loop(i, add)
        on.when(on.same(i, count - 1), lambda: copy(on, y, last))
        control.evaluations = control.evaluations + 1
        status.value, component = motion.rates(on, base, y, q, k.row(i))
        control.component = component
        stage.value = i + 1
        return on.either(on.negate(on.same(status.value, Status.SOUND)), stage.value > count)

    on.repeat(one)
    return status.value


def allow(on: Evaluator, motion: Motion, memory: Memory) -> None:
    """Write what errors may be, atol + rtol · size, to ``allowed``."""
    motion.sizes(on, memory.y, memory.y1, memory.allowed)

    def one(j: Integer) -> None:
        memory.allowed[j] = memory.atol[j] + memory.rtol[j] * memory.allowed[j]

    on.loop(motion.counted, one)


def _place(on: Evaluator, motion: Motion, j: Integer) -> Integer:
    """Return where the j-th counted number lies in y."""
    return on.select(j < motion.freedoms, j, j + (motion.increments - motion.freedoms))


def _estimate(on: Evaluator, motion: Motion, weights: Vector, k: Matrix, h: Real, q: Vector, out: Vector) -> None:
    """h Σ weights·k of what counts, without its parts across the constraints, which closing takes out."""

    def clear(j: Integer) -> None:
        out[j] = 0.0

    def add(s: Integer) -> None:
        weight = h * weights[s]

        def entry(j: Integer) -> None:
            out[j] = out[j] + weight * k[s, _place(on, motion, j)]

        on.when(on.negate(on.absolute(weight) <= 0.0), lambda: on.loop(out.size, entry))

    on.loop(out.size, clear)
    on.loop(k.rows, add)
    if motion.closes:
        n = motion.freedoms
        on.loop(2, lambda part: motion.project(on, q, out.part(part * n, n)))


def error_of(on: Evaluator, motion: Motion, tableau: Tableau, memory: Memory, h: Real) -> Real:
    """Return the size of the estimates relative to what is allowed: of order 5, or of order 8 from two of them.

    Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I*, II.4 and II.10.
    """
    m, eighth = memory, on.same(tableau.eighth[0], 1)

    _estimate(on, motion, tableau.error, m.k, h, m.q1, m.fine)
    on.when(eighth, lambda: _estimate(on, motion, tableau.coarse, m.k, h, m.q1, m.coarse))
    fine, coarse = on.variable(0.0), on.variable(0.0)

    def one(j: Integer) -> None:
        x = m.fine[j] / m.allowed[j]
        fine.value = fine.value + x * x
        y = m.coarse[j] / m.allowed[j]
        coarse.value = on.select(eighth, coarse.value + y * y, 0.0)

    on.loop(motion.counted, one)
    size = on.real(on.select(motion.counted > 1, motion.counted, 1))
    plain = on.sqrt(fine.value / size)
    both = fine.value / on.sqrt((fine.value + 0.01 * coarse.value) * size)
    return on.select(on.both(eighth, on.negate(fine.value <= 0.0)), both, plain)


def drift(on: Evaluator, before: Vector, after: Vector, allowed: Vector) -> Real:
    """Return the error that closing reveals: DRIFT of the change of the rates, relative to what is allowed of them."""
    n, total = after.size, on.variable(0.0)

    def one(j: Integer) -> None:
        x = (after[j] - before[j]) / allowed[n + j]
        total.value = total.value + x * x

    on.loop(n, one)
    return DRIFT * on.sqrt(total.value / on.real(on.select(n > 1, n, 1)))


def stiffness(on: Evaluator, motion: Motion, tableau: Tableau, memory: Memory, h: Real) -> Real:
    """Return h·|λ| of the mode in which the last two stages differ.

    Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.2.
    """
    count, m = tableau.a.columns, memory
    rise, run = on.variable(0.0), on.variable(0.0)

    def one(j: Integer) -> None:
        at = _place(on, motion, j)
        x, y = (m.k[count, at] - m.k[count - 1, at]) / m.allowed[j], (m.y1[at] - m.last[at]) / m.allowed[j]
        rise.value, run.value = rise.value + x * x, run.value + y * y

    on.loop(motion.counted, one)
    return on.select(run.value > 0.0, on.absolute(h) * on.sqrt(rise.value / run.value), 0.0)
