"""One step: its stages, the estimates of its error, the fastest mode that it reveals."""

from typing import Final

from ephs.semantics.linear.dense import clear, copy, sum_of_squares
from ephs.semantics.linear.sums import grown
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Program,
    Real,
    Table,
    Truth,
    Vector,
    staged,
)
from ephs.solve.march.control import judge
from ephs.solve.march.evaluating import MarchStep, allow, combine, evaluate, place
from ephs.solve.march.lagged import Lagged, lag
from ephs.solve.march.memory import Errors, Memory, Totals
from ephs.solve.march.newton import newton
from ephs.solve.march.records import MarchControl, Motion, Status, TableauRecord
from ephs.solve.march.stiff import Stiff

DRIFT = 1e-2
"""Share of a step's drift off the constraints that counts as its error.

Closing the loops takes the drift out along normals at the step's end. Near a change of rank normals turn fast: there a
stage's drift has a part along the motion that the embedded formula misses. Tried on rows of one to ten four-bars: with
1e-3 errors of 100 tolerances are left at 1e-9, with 1e-1 steps become many times more.
"""
SPECK = 1e-30
"""Flow back in J that is rounding where all is at rest, and the energy has none: squares of velocities of 1e-15 m/s."""


@staged
def first(on: Evaluator, step: MarchStep) -> Integer:
    """Evaluate the rates at the start of a step into the first row of k; return a status."""
    return evaluate(on, step, step.start, step.q, step.k.row(0))


@staged
def attempt(
    on: Evaluator,
    step: MarchStep,
    errors: Errors | None,
    last: Vector,
    stiff: Stiff | None = None,
    lagged: Lagged | None = None,
) -> Integer:
    """Evaluate the stages of a step, k[0] known.

    Stages are explicit; with memory for that they are found by Newton's method, to errors that are allowed, or
    semi-implicit ones, which need no k[0].
    The step's end goes to y and q, the rates there to the last row of k, y at the last stage to ``last``.

    Returns
    -------
    Integer
        A status.
    """
    if lagged is not None:
        return lag(on, step, lagged)
    count, start, y = step.tableau.a.columns, step.start, step.y
    stage, status = on.counter(1), on.counter(0)

    def once() -> Truth:
        i = stage.value
        combine(on, step, i)
        on.when(on.same(i, count - 1), lambda: copy(on, y, last))
        status.value = evaluate(on, step, y, step.q, step.k.row(i))
        stage.value = i + 1
        return on.either(on.negate(on.same(status.value, Status.SOUND)), stage.value > count)

    if stiff is None:
        on.when(on.same(count, 1), lambda: copy(on, start, last))
    elif errors is not None:
        allow(on, step.motion, errors, start, start)
        status.value = newton(on, step, errors, stiff)
        copy(on, y, last)
        stage.value = count
    on.when(on.same(status.value, Status.SOUND), lambda: on.repeat(once))
    return status.value


def book(
    on: Evaluator,
    motion: Motion,
    tableau: TableauRecord,
    k: Matrix,
    h: Real,
    totals: Totals,
    anchor: Real,
    hold: Truth,
    q: Vector | None = None,
) -> Integer:
    """Sum what a step of length h with rates k adds to heats and totals; return a status.

    What the last row of a tableau weighs are h Σ b k. ``hold`` where the step is a part of one whose sums are known.
    With the elements q at the end of a step whose method damps, heat is made of the energy that this takes out.
    Flows that go both ways within a step, and back by less than the rounding of the energy, or a speck, are zero.
    """
    at, count, n = motion.summed, tableau.a.columns, totals.change.size
    whole, low, made, made_before = (x.part(first, n) for first in (0, n) for x in (totals.whole, totals.low))
    nothing = on.maximum(SPECK, motion.rounding(on, anchor, totals.start))

    def each_entry(j: Integer) -> None:
        total, size, most = on.variable(0.0), on.variable(0.0), on.variable(0.0)

        def add(s: Integer) -> None:
            rate = k[s, at + j]
            term = tableau.a[count, s] * rate
            total.value, size.value = total.value + term, size.value + on.absolute(term)
            most.value = on.maximum(most.value, h * rate)

        on.loop(count, add)
        change = h * total.value
        totals.change[j], totals.size[j] = change, on.absolute(h) * size.value
        back = on.both(on.both(change < 0.0, most.value > 0.0), change >= -nothing)

        def keep() -> None:
            whole[j] = on.select(back, 0.0, change)

        on.when(on.negate(hold), keep)

    def absorb() -> None:
        if q is not None:
            motion.absorb(on, anchor, totals.start, q, totals.end, totals.change)

    def part() -> None:
        absorb()
        motion.hold(on, totals.change, low, whole, made=False)
        copy(on, totals.change, low)

    def entire() -> None:
        motion.hold(on, totals.change, whole, whole, made=False)
        absorb()
        copy(on, totals.change, whole)
        clear(on, totals.low)

    def grow(j: Integer) -> None:
        totals.end[at + j], totals.after[j] = grown(totals.start[at + j], totals.before[j], totals.change[j])

    on.loop(totals.change.size, each_entry)
    on.when(hold, part, entire)
    status = motion.book(on, tableau, k, h, totals)

    def between() -> None:
        motion.hold(on, totals.change, made_before, made, made=True)
        copy(on, totals.change, made_before)

    on.when(hold, between, lambda: copy(on, totals.change, made))
    on.loop(totals.change.size, grow)
    return status


def _estimate(on: Evaluator, step: MarchStep, weights: Vector, out: Vector) -> None:
    """h Σ weights·k of the counted coordinates, without components transverse to the constraints."""
    motion, k = step.motion, step.k

    def add(s: Integer) -> None:
        weight = step.h * weights[s]

        def entry(j: Integer) -> None:
            out[j] = out[j] + weight * k[s, place(on, motion, j)]

        on.when(on.negate(on.absolute(weight) <= 0.0), lambda: on.loop(out.size, entry))

    clear(on, out)
    on.loop(k.rows, add)
    if motion.closes:
        n = motion.freedoms
        on.loop(2, lambda part: motion.project(on, step.q, out.part(part * n, n)))


@staged
def error_of(on: Evaluator, step: MarchStep, memory: Memory) -> Real:
    """Return the size of the estimates of a step, relative to the tolerance."""
    m, tableau = memory, step.tableau
    _estimate(on, step, tableau.error, m.fine)
    on.when(tableau.eighth[0] > 0, lambda: _estimate(on, step, tableau.coarse, m.coarse))
    return measure(on, m.fine, m.coarse, m.allowed, tableau.eighth)


def measure(on: Evaluator, fine: Vector, coarse: Vector, allowed: Vector, eighth: Integers) -> Real:
    """Return the size of estimates relative to the tolerance, by the norm that a tableau names.

    Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I*, II.4 and II.10.
    """
    two, size = eighth[0] > 0, allowed.size
    first, other = (sum_of_squares(on, size, lambda j, x=x: x[j] / allowed[j]) for x in (fine, coarse))
    second, count = on.select(two, other, 0.0), on.real(on.select(size > 1, size, 1))
    both = first / on.sqrt((first + 0.01 * second) * count)
    return on.select(on.both(two, on.negate(first <= 0.0)), both, on.sqrt(first / count))


def drift(on: Evaluator, before: Vector, after: Vector, allowed: Vector) -> Real:
    """Return the error shown by closing: DRIFT of the change of the rates, relative to their tolerance."""
    n = after.size
    total = sum_of_squares(on, n, lambda j: (after[j] - before[j]) / allowed[n + j])
    return DRIFT * on.sqrt(total / on.real(on.select(n > 1, n, 1)))


def stiffness(on: Evaluator, rise: Vector, run: Vector, allowed: Vector, h: Real) -> Real:
    """Return h·|λ| of the mode in which two stages differ: by ``rise`` in their rates, by ``run`` in themselves.

    Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.2.
    """
    above, along = (sum_of_squares(on, allowed.size, lambda j, x=x: x[j] / allowed[j]) for x in (rise, run))
    return on.select(along > 0.0, on.absolute(h) * on.sqrt(above / along), 0.0)


def stiffness_of(on: Evaluator, step: MarchStep, memory: Memory) -> Real:
    """Return the stiffness by the last two stages; their differences overwrite the memory of estimates."""
    count, m, k = step.tableau.a.columns, memory, step.k

    def each_entry(j: Integer) -> None:
        at = place(on, step.motion, j)
        m.fine[j], m.coarse[j] = k[count, at] - k[count - 1, at], step.y[at] - m.last[at]

    on.loop(step.motion.counted, each_entry)
    return stiffness(on, m.fine, m.coarse, m.allowed, step.h)


def _judge(on: Evaluator, control: Table[MarchControl], h: Real, error: Real) -> Integer:
    return judge(on, control[0], h, error)


STEPS: Final = Program(
    "steps", measure=Entry(measure), drift=Entry(drift), stiffness=Entry(stiffness), judge=Entry(_judge)
)
"""Entry functions for drivers with one step per call."""
