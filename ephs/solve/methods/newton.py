"""Steps of the natural method as staged functions: Newton's method, and the loop over steps."""

from collections.abc import Sequence
from functools import cache
from typing import Final

from ephs.semantics.linear.sparse import factorise, solve
from ephs.semantics.spaces import codes
from ephs.semantics.spaces.staged_groups import STAGED
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
    real,
    staged,
    vector,
)
from ephs.solve.methods.places import copy
from ephs.solve.methods.records import (
    COMPONENT,
    DIVERGED,
    DONE,
    INCONSISTENT,
    MEMORY,
    ORDER,
    PIVOT,
    STORING,
    TABLES,
    Columns,
    Dims,
    Elimination,
    Scratch,
    State,
    row_of,
)
from ephs.solve.methods.residuals import FAULTS, account, balance, evaluated
from ephs.solve.methods.scales import COMMON, FAR, measure, reach, weigh

RUNNING: Final = -1
"""The status of a step that is not at its end."""
MOST: Final = 80
"""Iterations of Newton's method."""
RULES: Final = (
    (2.0, -1.0),
    (4.0, -6.0, 4.0, -1.0),
    (6.0, -15.0, 20.0, -15.0, 6.0, -1.0),
    (2.0, 0.0, -2.0, 1.0),
    (4.0, -5.0, 0.0, 5.0, -4.0, 1.0),
    (2.0, 1.0, -4.0, 1.0, 2.0, -1.0),
)
"""Weights of the last values in a guess of the next, exact for polynomials of degree 1, 3 and 5, and of degree 2, 4 and
3 with an alternating part of degree 0, 0 and 1: multipliers of joints alternate from step to step."""
BEFORE: Final = max(map(len, RULES))
"""Number of steps before the last whose unknowns are kept to choose among the rules."""
SOLVED: Final = 4e-16
STALLED: Final = 1e-11
"""Relative residuals that are small enough at once, and once they do not fall."""


def restrain(on: Evaluator, t: Columns, z: Matrix, step: Matrix) -> Real:
    """Shorten a Newton step z − step (stages, unknowns) storage by storage; the least part taken of efforts and rates.

    Absolute temperatures fall by half or rise fourfold at most: small heat capacities warm by orders of magnitude in
    one step of the method, where whole Newton steps would leave what is positive. All stages take the same part, as the
    states at each depend on the rates at all.
    """
    least, part, n_rate = on.variable(1.0), on.variable(1.0), t.counts[0]

    def component(i: Integer) -> None:
        n, e_at, w_at = row_of(Dims, t.dims, i).efforts, t.e_at[i], t.read_w_at[i]

        def effort(j: Integer) -> None:
            at = t.e_index[e_at + j]

            def stage(k: Integer) -> None:
                warmth, fall = z[k, n_rate + at] + t.intensive[at], step[k, n_rate + at]

                def limit(bound: Real) -> None:
                    part.value = on.minimum(part.value, bound / fall)

                def cool() -> None:
                    limit(0.5 * warmth)

                def heat() -> None:
                    on.when(fall < -3.0 * warmth, lambda: limit(-3.0 * warmth))

                on.when(warmth > 0.0, lambda: on.when(fall > 0.5 * warmth, cool, heat))

            on.when(t.entropy[at] > 0.0, lambda: on.loop(z.rows, stage))

        def shorten() -> None:
            least.value = on.minimum(least.value, part.value)

            def port(j: Integer) -> None:
                effort, rate = n_rate + t.e_index[e_at + j], t.read_w[w_at + j]

                def stage(k: Integer) -> None:
                    step[k, effort] = step[k, effort] * part.value
                    step[k, rate] = step[k, rate] * part.value

                on.loop(z.rows, stage)

            on.loop(n, port)

        def storing() -> None:
            part.value = 1.0
            on.loop(n, effort)
            on.when(part.value < 1.0, shorten)

        on.when(on.same(t.kind[i], STORING), storing)

    on.loop(t.kind.size, component)
    return least.value


def tighten(on: Evaluator, q: Vector) -> None:
    """Bring a quaternion that is off by rounding back to unit length."""
    entries = [q[i] for i in range(4)]
    a, b, c, d = entries
    factor = 1.5 - 0.5 * (a * a + b * b + c * c + d * d)
    for i, entry in enumerate(entries):
        q[i] = entry * factor


def somewhere(on: Evaluator, vector: Vector) -> Vector:
    """The same memory, at a place that is not known while staging: functions of their own are emitted once for all."""
    return Vector(vector.cells, vector.start + on.counter(0).value, vector.size)


@staged
def retract(on: Evaluator, code: Integer, x: Vector, v: Vector, out: Vector) -> None:
    """x·exp(v) of a group, which may be x's own place."""

    def vectors() -> None:
        def one(i: Integer) -> None:
            out[i] = x[i] + v[i]

        on.loop(v.size, one)

    def group(number: int, size: int, dim: int) -> None:
        def point() -> None:
            found = STAGED[number].retract(on, [x[i] for i in range(size)], [v[i] for i in range(dim)])
            for i, entry in enumerate(found):
                out[i] = entry

        on.when(on.same(code, number), point)

    on.when(on.same(code, codes.VECTOR), vectors)
    for number, size, dim in ((codes.SO3, 4, 3), (codes.SE2, 3, 3), (codes.SE3, 7, 6), (codes.SO3xR3, 7, 6)):
        group(number, size, dim)


def settle(on: Evaluator, t: Columns, x: Vector, h: Real, rates: Vector, v: Vector) -> None:
    """Move all states, in place, by h times their rates; v is scratch for one of them."""

    def state(k: Integer) -> None:
        row = row_of(State, t.states, k)
        point = x.part(row.at, row.size)

        def increment(j: Integer) -> None:
            v[j] = h * rates[row.rate + j]

        on.loop(row.dim, increment)
        retract(on, row.code, point, somewhere(on, v).part(0, row.dim), point)
        flat = on.either(on.same(row.code, codes.VECTOR), on.same(row.code, codes.SE2))
        on.when(on.negate(flat), lambda: tighten(on, point))

    on.loop(t.states.size // State.integer_width, state)


def pivots_of(on: Evaluator, o: Elimination, data: Vector, m: Scratch, dense: Vector, pivot: Vector) -> Truth:
    """Factors of the matrix in the order o; false where a pivot is below its floor."""
    return factorise(on, o.place, o.start, o.entry, o.diagonal, data, m.factors, dense, o.floor, pivot)


def extrapolated(on: Evaluator, values: Sequence[Real], others: Sequence[tuple[Real, Real]] = ()) -> Real:
    """Guess of the value after these, latest first, by the rule whose guess of the latest one had the least error.

    Parameters
    ----------
    others
        Error and guess of other rules.
    """
    latest, guess, least = values[0], on.variable(values[0]), on.variable(FAR)
    found = [(on.absolute(latest - _combined(rule, values[1:])), _combined(rule, values)) for rule in RULES]
    for error, ahead in (*others, *found):
        closer = error < least.value
        guess.value = on.select(closer, ahead, guess.value)
        least.value = on.select(closer, error, least.value)
    return guess.value


def _combined(rule: Sequence[float], values: Sequence[Real]) -> Real:
    terms = [coefficient * value for coefficient, value in zip(rule, values, strict=False) if coefficient]
    return sum(terms[1:], start=terms[0])


def newton(
    on: Evaluator, t: Columns, o: Elimination, x: Vector, z: Vector, scal: Vector, inputs: Vector, m: Scratch,
    outcome: Integers,
) -> None:  # fmt: skip
    """Solve one step in place of z, run to stagnation; outcome = status, component, and iterations added.

    A matrix whose pivots have shrunk below the order's floor asks for another order.
    """
    before, part, iteration, n = on.variable(FAR), on.variable(1.0), on.counter(0), z.size
    one = Matrix(z.cells, z.start, 1, n)
    outcome[0], outcome[1] = RUNNING, 0
    m.defect[1] = COMMON

    def pin(i: Integer) -> None:
        def leave() -> None:
            m.data[m.data.size - n + i] = 1.0

        on.when(on.same(o.dropped[i], 1), leave)

    def subtract(i: Integer) -> None:
        z[i] = z[i] - m.step[i]

    def move() -> None:
        solve(on, o.rows, o.columns, o.start, o.entry, o.diagonal, m.factors, m.residual, m.step, m.dense)
        part.value = restrain(on, t, one, Matrix(m.step.cells, m.step.start, 1, n))
        on.loop(n, subtract)

    def refuse() -> None:
        outcome[0] = PIVOT

    def judge() -> None:
        ratio = measure(on, t, z, o.dropped, m)
        solved = on.either(ratio <= SOLVED, on.both(ratio < STALLED, ratio > 0.7 * before.value))
        stuck = on.both(iteration.value > 12, on.both(ratio > 0.9 * before.value, part.value >= 1.0))
        stuck = on.either(stuck, on.negate(ratio <= ratio))
        closed = on.select(m.defect[0] > o.tolerance[0], INCONSISTENT, DONE)
        outcome[0] = on.select(solved, closed, on.select(stuck, DIVERGED, RUNNING))

        def step() -> None:
            before.value = ratio
            on.loop(n, pin)
            on.when(pivots_of(on, o, m.data, m, m.dense, m.pivot), move, refuse)

        on.when(on.same(outcome[0], RUNNING), step)

    def iterate() -> Truth:
        fault = evaluated(on, t, x, z, scal, inputs, m, scal[0])

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
    on: Evaluator, t: Columns, o: Elimination, m: Scratch, x: Vector, z: Vector, previous: Matrix, scal: Vector,
    inputs: Vector, sums: Vector, states: Matrix, energies: Matrix, ledgers: Matrix, outcome: Integers, steps: Integer,
) -> None:  # fmt: skip
    """Take ``steps`` steps of h = scal[0]; fill one row a step; outcome = status, component, steps done, iterations.

    x, z, previous and sums are the state of the method; a step that fails leaves x and sums as they were, and z as the
    next guess. A row of energies holds the energy of each storage, the entropy made so far of each irreversible
    component; a row of ledgers the heat, energy, exergy supplied, the entropy made, and the step's least production.
    """
    n, guess, tries, last = z.size, m.step, on.counter(0), previous.row(0)
    outcome[0], outcome[1], outcome[2], outcome[3] = DONE, 0, 0, 0

    def forward(i: Integer) -> None:
        values = [z[i], *(previous[k, i] for k in range(BEFORE))]
        z[i] = extrapolated(on, values)
        for k in range(BEFORE):
            previous[k, i] = values[k]
        guess[i] = values[0] - z[i]

    def again() -> Truth:
        newton(on, t, o, x, z, scal, inputs, m, outcome)
        tries.value = tries.value + 1
        failed = on.either(outcome[0] >= COMPONENT, on.same(outcome[0], DIVERGED))
        once = on.both(failed, tries.value < 2)
        on.when(once, lambda: copy(on, last, z))  # once more from the last values, a safe guess
        return on.negate(once)

    def keep() -> None:
        row = outcome[2]
        balance(on, t, z, scal[0], m, z, 1.0, m.energy)
        settle(on, t, x, scal[0], z, m.v)
        least = account(on, t, z, scal[0], inputs, m, sums)
        copy(on, x, states.row(row))
        copy(on, m.energy, energies.row(row))
        for i in range(4):
            ledgers[row, i] = sums[i]
        ledgers[row, 4] = least
        outcome[2] = row + 1

    def leave() -> None:
        # the rank at the start of the step changes within it
        on.when(on.same(outcome[0], INCONSISTENT), lambda: copy(on, z, last), lambda: copy(on, last, z))

    def step() -> Truth:
        on.loop(n, forward)
        taken = restrain(on, t, Matrix(last.cells, last.start, 1, n), Matrix(guess.cells, guess.start, 1, n))
        on.when(taken < 1.0, lambda: copy(on, last, z))
        tries.value = 0
        on.repeat(again)
        on.when(on.same(outcome[0], DONE), keep, leave)
        return on.either(outcome[2] >= steps, on.negate(on.same(outcome[0], DONE)))

    on.when(steps > 0, lambda: on.repeat(step))


@cache
def natural_program() -> Program:
    """Return the programs of the natural method and of single evaluations."""
    point = {"x": vector(), "z": vector(), "scal": vector(3), "inputs": vector()}
    return Program(
        "natural",
        advance=Entry(
            advance, t=TABLES, o=ORDER, m=MEMORY, x=vector(), z=vector(), previous=matrix(), scal=vector(3),
            inputs=vector(), sums=vector(), states=matrix(), energies=matrix(), ledgers=matrix(5), outcome=indices(4),
            steps=integer(),
        ),
        evaluate=Entry(evaluated, t=TABLES, **point, m=MEMORY, weight=real()),
        measure=Entry(measure, t=TABLES, z=vector(), dropped=indices(), m=MEMORY),
        account=Entry(account, t=TABLES, z=vector(), h=real(), inputs=vector(), m=MEMORY, sums=vector()),
        reach=Entry(reach, t=TABLES, m=MEMORY),
        weigh=Entry(weigh, t=TABLES, m=MEMORY),
        tighten=Entry(tighten, q=vector(4)),
    )  # fmt: skip
