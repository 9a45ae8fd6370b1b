"""Newton's method and the loop over steps of the natural method of order 4, as staged functions."""

from functools import cache
from typing import Final

from ephs.semantics.linear.sparse import solve
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
    indices,
    integer,
    matrix,
    vector,
)
from ephs.solve.methods.newton import BEFORE, RUNNING, SOLVED, STALLED, extrapolated, pivots_of, restrain, settle
from ephs.solve.methods.places import add_to, copy
from ephs.solve.methods.records import (
    DIVERGED,
    DONE,
    INCONSISTENT,
    MEMORY,
    ORDER,
    PIVOT,
    STORING,
    TABLES,
    Columns,
    Elimination,
    Scratch,
    row_of,
)
from ephs.solve.methods.residuals import FAULTS, account, balance, evaluated
from ephs.solve.methods.scales import COMMON, FAR, measure
from ephs.solve.methods.scheme import (
    AHEAD,
    GROUPS,
    STAGE_MEMORY,
    STAGES,
    WEIGHTS,
    GroupColumns,
    Node,
    Place,
    StageScratch,
)
from ephs.solve.methods.stages import linearise

MOST: Final = 60
"""Iterations of Newton's method."""
PATIENCE: Final = 25
"""Iterations after which the residual has to fall."""


def _assemble(
    on: Evaluator, t: Columns, g: GroupColumns, o: Elimination, h: Real, z: Matrix, scheme: Vector, s: StageScratch
) -> None:
    """The matrix of all stages from the stages' derivatives."""

    def entry(k: Integer) -> None:
        place = row_of(Place, g.where, k)
        i, j, source = place.row, place.column, place.source

        def hold() -> None:
            s.matrix[k] = on.select(on.same(o.dropped[-1 - source], 1), 1.0, 0.0)

        def take() -> None:
            found = on.variable(0.0)

            def own() -> None:
                found.value = s.data[i, source]

            def rates() -> None:
                found.value = found.value + h * scheme[STAGES * i + j] * s.slope[i, source]

            on.when(on.same(i, j), own)
            on.when(t.column[source] < t.counts[0], rates)
            s.matrix[k] = found.value

        on.when(source < 0, hold, take)

    def node(k: Integer) -> None:
        rate = row_of(Node, g.node, k).rate
        for i in range(STAGES):
            first = STAGES * (STAGES * k + i)
            for j in range(STAGES):
                add_to(s.matrix, g.entry[first + j], -(z[i, rate] * s.share[k, j]))
            add_to(s.matrix, g.entry[first + i], -s.factor[k])

    on.loop(s.matrix.size, entry)
    on.loop(g.node.size // Node.integer_width, node)


def newton(
    on: Evaluator, t: Columns, g: GroupColumns, o: Elimination, x: Vector, z: Matrix, scal: Vector, still: Vector,
    inputs: Matrix, scheme: Vector, m: Scratch, s: StageScratch, outcome: Integers,
) -> None:  # fmt: skip
    """Solve one step in place of z, run to stagnation; outcome = status, component, and iterations added."""
    before, part, iteration, fresh = on.variable(FAR), on.variable(1.0), on.counter(0), on.counter(1)
    n, h = z.columns, scal[0]
    ratio, defect = on.variable(0.0), on.variable(0.0)
    right = Vector(s.residual.cells, s.residual.start, STAGES * n)
    outcome[0], outcome[1] = RUNNING, 0
    m.defect[1] = COMMON

    def look(i: Integer) -> None:
        copy(on, s.residual.row(i), m.residual)
        copy(on, s.scale.row(i), m.scale)
        found = measure(on, t, z.row(i), o.dropped.part(0, n), m)
        number = on.both(found <= found, ratio.value <= ratio.value)
        ratio.value = on.select(number, on.maximum(ratio.value, found), ratio.value + found)
        defect.value = on.maximum(defect.value, m.defect[0])
        copy(on, m.residual, s.residual.row(i))

    def subtract(i: Integer) -> None:
        def one(j: Integer) -> None:
            z[i, j] = z[i, j] - s.change[i * n + j]

        on.loop(n, one)

    def refuse() -> None:
        outcome[0] = PIVOT

    def factors() -> None:
        _assemble(on, t, g, o, h, z, scheme, s)
        on.when(on.negate(pivots_of(on, o, s.matrix, m, s.dense, s.pivot)), refuse)

    def move() -> None:
        solve(on, o.rows, o.columns, o.start, o.entry, o.diagonal, m.factors, right, s.change, s.dense)
        part.value = restrain(on, t, z, Matrix(s.change.cells, s.change.start, STAGES, n))
        on.loop(STAGES, subtract)
        # a matrix is reused while the residual decreases fast
        slow = on.either(part.value < 1.0, ratio.value > 0.1 * before.value)
        fresh.value = on.select(on.either(on.same(iteration.value, 0), slow), 1, 0)
        before.value = ratio.value

    def judge() -> None:
        ratio.value, defect.value = 0.0, 0.0
        on.loop(STAGES, look)
        found = ratio.value
        solved = on.either(found <= SOLVED, on.both(found < STALLED, found > 0.7 * before.value))
        stuck = on.both(iteration.value > PATIENCE, on.both(found > 0.9 * before.value, part.value >= 1.0))
        stuck = on.either(stuck, on.negate(found <= found))
        closed = on.select(defect.value > o.tolerance[0], INCONSISTENT, DONE)
        outcome[0] = on.select(solved, closed, on.select(stuck, DIVERGED, RUNNING))
        on.when(on.both(on.same(outcome[0], RUNNING), on.same(fresh.value, 1)), factors)
        on.when(on.same(outcome[0], RUNNING), move)

    def iterate() -> Truth:
        fault = linearise(on, t, g, o.dropped, x, z, scal, still, inputs, m, s, fresh.value)

        def fail() -> None:
            outcome[0], outcome[1] = fault % FAULTS, fault // FAULTS

        on.when(on.same(fault, 0), judge, fail)
        going = on.same(outcome[0], RUNNING)
        iteration.value = iteration.value + on.select(going, 1, 0)
        late = on.both(going, iteration.value >= MOST)
        outcome[0] = on.select(late, DIVERGED, outcome[0])
        return on.either(late, on.negate(going))

    on.repeat(iterate)
    outcome[3] = outcome[3] + iteration.value


def advance(
    on: Evaluator, t: Columns, g: GroupColumns, o: Elimination, m: Scratch, s: StageScratch, x: Vector, z: Matrix,
    previous: Matrix, scal: Vector, still: Vector, inputs: Matrix, scheme: Vector, sums: Vector,
    states: Matrix, energies: Matrix, ledgers: Matrix, outcome: Integers, steps: Integer,
) -> None:  # fmt: skip
    """Take ``steps`` steps; arguments and results as of `newton.advance`, z and previous of all stages.

    ``still`` is scal for an instant.
    """
    n, tries, least = z.columns, on.counter(0), on.variable(0.0)
    ahead = AHEAD.tolist()
    outcome[0], outcome[1], outcome[2], outcome[3] = DONE, 0, 0, 0

    def forward(j: Integer) -> None:
        last = [z[i, j] for i in range(STAGES)]
        before = [[previous[STAGES * k + i, j] for i in range(STAGES)] for k in range(BEFORE)]
        for i in range(STAGES):
            # besides the polynomial through the stages, continued
            continued, past = (sum(ahead[i][k] * each[k] for k in range(STAGES)) for each in (last, before[0]))
            values = [last[i], *(each[i] for each in before)]
            z[i, j] = extrapolated(on, values, [(on.absolute(last[i] - past), continued)])
            for k in range(BEFORE):
                previous[STAGES * k + i, j] = values[k]

    def again() -> Truth:
        newton(on, t, g, o, x, z, scal, still, inputs, scheme, m, s, outcome)
        tries.value = tries.value + 1
        once = on.both(on.negate(on.same(outcome[0], DONE)), tries.value < 2)

        def restart(i: Integer) -> None:
            copy(on, previous.row(STAGES - 1), z.row(i))

        # from a safe guess: the last values at all stages
        on.when(once, lambda: on.loop(STAGES, restart))
        return on.negate(once)

    def book(i: Integer) -> None:
        evaluated(on, t, s.x.row(i), z.row(i), still, inputs.row(i), m, still[0])
        weight = on.select(on.same(i, 0), WEIGHTS[0], on.select(on.same(i, 1), WEIGHTS[1], WEIGHTS[2]))
        h = scal[0] * weight
        balance(on, t, z.row(i), h, m, s.whole, h, s.energy)
        least.value = least.value + account(on, t, z.row(i), h, inputs.row(i), m, sums)

    def keep() -> None:
        row = outcome[2]
        least.value = 0.0
        on.loop(STAGES, book)
        settle(on, t, x, 1.0, s.whole, m.v)
        copy(on, x, states.row(row))

        def energy(i: Integer) -> None:
            energies[row, i] = on.select(on.same(t.kind[i], STORING), s.energy[i], m.energy[i])

        on.loop(t.kind.size, energy)
        for i in range(4):
            ledgers[row, i] = sums[i]
        ledgers[row, 4] = least.value
        outcome[2] = row + 1

    def leave(i: Integer) -> None:
        # the rank at the start of the step changes within it
        def there() -> None:
            copy(on, z.row(i), previous.row(i))

        def back() -> None:
            copy(on, previous.row(i), z.row(i))

        on.when(on.same(outcome[0], INCONSISTENT), there, back)

    def step() -> Truth:
        on.loop(n, forward)
        tries.value = 0
        on.repeat(again)
        on.when(on.same(outcome[0], DONE), keep, lambda: on.loop(STAGES, leave))
        return on.either(outcome[2] >= steps, on.negate(on.same(outcome[0], DONE)))

    on.when(steps > 0, lambda: on.repeat(step))


@cache
def gauss_program() -> Program:
    """Return the program of the natural method of order 4."""
    step = {"scal": vector(3), "still": vector(3), "inputs": matrix()}
    return Program(
        "gauss",
        advance=Entry(
            advance, t=TABLES, g=GROUPS, o=ORDER, m=MEMORY, s=STAGE_MEMORY, x=vector(), z=matrix(),
            previous=matrix(), **step, scheme=vector(STAGES * STAGES), sums=vector(), states=matrix(),
            energies=matrix(), ledgers=matrix(5), outcome=indices(4), steps=integer(),
        ),
        linearise=Entry(
            linearise, t=TABLES, g=GROUPS, dropped=indices(), x=vector(), z=matrix(), **step, m=MEMORY,
            s=STAGE_MEMORY, fresh=integer(),
        ),
    )  # fmt: skip
