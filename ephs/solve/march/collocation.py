"""Collocation steps by iteration: stages that depend on each other, each evaluated anew with the others' last rates.

Hairer, Lubich and Wanner, *Geometric Numerical Integration*, VIII.6. Stages are swept in order, so that each sees the
new rates of those before it. The iteration contracts where h·|λ|·ρ(A) < 1.
"""

from ephs.semantics.linear.dense import copy
from ephs.semantics.stage import Evaluator, Integer, Matrix, Real, Truth, Vector, staged
from ephs.solve.march.records import Control, Motion, Status, Tableau

ENOUGH = 1e-2
"""Change of a sweep, relative to the allowed error of a step, at which stages have converged."""
ROUGH = 0.1
"""Acceptable change with chosen steps where sweeps stagnate."""
ROUGH_ON_GRID = 1e3
"""The same on a grid, where stages are swept to rounding: tolerances are then 1e-14."""
STALLED = 0.9
"""Ratio to the change of the previous sweep above which sweeps stagnate."""
SWEEPS = 50
"""Sweeps after which a step is given up."""


def place(on: Evaluator, motion: Motion, j: Integer) -> Integer:
    """Return the index in y of the j-th counted number."""
    return on.select(j < motion.freedoms, j, j + (motion.increments - motion.freedoms))


@staged
def evaluate(
    on: Evaluator, motion: Motion, control: Control, base: Vector, y: Vector, q: Vector, out: Vector
) -> Integer:
    """Evaluate the rates at base·exp(v) and count it; return a status."""
    control.evaluations = control.evaluations + 1
    status, component = motion.rates(on, base, y, q, out)
    control.component = component
    return status


def combine(on: Evaluator, weights: Vector, count: Integer, h: Real, k: Matrix, start: Vector, y: Vector) -> None:
    """Write start + h Σ weights·k of the first ``count`` rates to y."""
    copy(on, start, y)

    def add(s: Integer) -> None:
        weight = h * weights[s]

        def entry(j: Integer) -> None:
            y[j] = y[j] + weight * k[s, j]

        on.when(on.negate(on.absolute(weight) <= 0.0), lambda: on.loop(y.size, entry))

    on.loop(count, add)


@staged
def iterate(
    on: Evaluator,
    motion: Motion,
    tableau: Tableau,
    control: Control,
    base: Vector,
    start: Vector,
    h: Real,
    k: Matrix,
    allowed: Vector,
    y: Vector,
    q: Vector,
) -> Integer:
    """Evaluate the stages of a step of length h from (base, start), k[0] known, until they agree.

    Parameters
    ----------
    allowed
        What errors of the step may be, of what is counted.

    Returns
    -------
    Integer
        A status: `Status.UNSETTLED` where the stages do not come to agree.
    """
    count = tableau.a.columns
    moved, before, sweeps = on.variable(0.0), on.variable(1e300), on.counter(0)
    stage, status = on.counter(1), on.counter(0)
    rough = on.select(control.grid > 0.0, ROUGH_ON_GRID, ROUGH)

    def guess() -> Truth:
        i = stage.value
        combine(on, tableau.guess.row(i), i, h, k, start, y)
        status.value = evaluate(on, motion, control, base, y, q, k.row(i))
        stage.value = i + 1
        return on.either(on.negate(on.same(status.value, Status.SOUND)), stage.value >= count)

    def again() -> Truth:
        i = stage.value
        combine(on, tableau.a.row(i), count, h, k, start, y)
        status.value = evaluate(on, motion, control, base, y, q, k.row(count))

        def compare(j: Integer) -> None:
            at = place(on, motion, j)
            x = h * (k[count, at] - k[i, at]) / allowed[j]
            moved.value = moved.value + x * x

        on.loop(motion.counted, compare)
        copy(on, k.row(count), k.row(i))
        stage.value = i + 1
        return on.either(on.negate(on.same(status.value, Status.SOUND)), stage.value >= count)

    def sweep() -> Truth:
        stage.value, moved.value = 1, 0.0
        on.repeat(again)
        now, last = on.sqrt(moved.value), before.value
        sweeps.value = sweeps.value + 1
        settled = on.either(now <= ENOUGH, on.both(now > STALLED * last, now <= rough))
        # The first sweeps may introduce terms that the guess lacks, such as heat, which is quadratic in rates.
        growing = on.both(on.negate(now < last), sweeps.value > 3)
        lost = on.either(on.both(growing, on.negate(settled)), sweeps.value >= SWEEPS)
        sound = on.same(status.value, Status.SOUND)
        failed = on.both(sound, on.both(lost, on.negate(settled)))
        status.value = on.select(failed, int(Status.UNSETTLED), status.value)
        before.value = now
        return on.either(settled, on.negate(on.same(status.value, Status.SOUND)))

    on.repeat(guess)
    on.when(on.same(status.value, Status.SOUND), lambda: on.repeat(sweep))
    return status.value
