"""Steps of the natural method as staged functions: Newton's method, and the loop over steps."""

from collections.abc import Callable, Iterable
from functools import cache
from itertools import chain
from typing import Any, Final

from ephs.semantics.linear.dense import add_to, copy
from ephs.semantics.linear.sparse import factorise, solve
from ephs.semantics.spaces.vectors import dot
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Program,
    Truth,
    Vector,
)
from ephs.solve.methods.guesses import BEFORE, extrapolated, restrain
from ephs.solve.methods.moves import move_states
from ephs.solve.methods.places import each_row
from ephs.solve.methods.records import (
    COMPONENT,
    DIVERGED,
    DONE,
    INCONSISTENT,
    PIVOT,
    STORING,
    Columns,
    Elimination,
    Scratch,
)
from ephs.solve.methods.residuals import FAULTS, account, balance, evaluated
from ephs.solve.methods.scales import COMMON, FAR, measure
from ephs.solve.methods.scheme import (
    GroupColumns,
    Node,
    Scheme,
    StageEntry,
    StageScratch,
    gauss,
)
from ephs.solve.methods.stages import linearise

RUNNING: Final = -1
"""The status of a step that is not at its end."""
MOST: Final = 80
"""Iterations of Newton's method."""
PATIENCE: Final = 12, 25
"""Iterations after which the residual has to fall: with a matrix for each, and with matrices used again."""
SOLVED: Final = 4e-16
STALLED: Final = 1e-11
"""Relative residuals that are small enough at once, and once they do not fall."""


def _each(on: Evaluator, scheme: Scheme, body: Callable[[Integer], None]) -> None:
    """Do something for each stage."""
    if scheme.single:
        body(0)
    else:
        on.loop(scheme.stages, body)


def _known(on: Evaluator, values: Iterable[float]) -> Vector:
    """Numbers that are known while staging, where places are not."""
    entries = list(values)
    made = on.scratch(len(entries))
    for place, entry in enumerate(entries):
        made[place] = entry
    return made


def _assemble(
    on: Evaluator, scheme: Scheme, t: Columns, g: GroupColumns, o: Elimination, scal: Vector, z: Matrix, m: Scratch,
    s: StageScratch,
) -> Vector:  # fmt: skip
    """The matrix of all stages from the stages' derivatives."""
    stages, a, h = scheme.stages, _known(on, chain(*scheme.a)), scal[0]

    def pin(i: Integer) -> None:
        def leave() -> None:
            m.data[m.data.size - z.columns + i] = 1.0

        on.when(on.same(o.dropped[i], 1), leave)

    def entry(place: StageEntry, k: Integer) -> None:
        i, j, source = place.row, place.column, place.source

        def hold() -> None:
            s.matrix[k] = on.select(on.same(o.dropped[-1 - source], 1), 1.0, 0.0)

        def take() -> None:
            found = on.variable(0.0)

            def own() -> None:
                found.value = s.data[i, source]

            def rates() -> None:
                found.value = found.value + h * a[stages * i + j] * s.slope[i, source]

            on.when(on.same(i, j), own)
            on.when(t.column[source] < t.counts[0], rates)
            s.matrix[k] = found.value

        on.when(source < 0, hold, take)

    def node(row: Node, k: Integer) -> None:
        for i in range(stages):
            first = stages * (stages * k + i)
            for j in range(stages):
                add_to(s.matrix, g.entry[first + j], -(z[i, row.rate] * s.share[k, j]))
            add_to(s.matrix, g.entry[first + i], -s.factor[k])

    if scheme.single:
        on.loop(z.columns, pin)
        return m.data
    each_row(on, StageEntry, g.where, entry)
    each_row(on, Node, g.node, node)
    return s.matrix


def newton(
    on: Evaluator, scheme: Scheme, t: Columns, g: GroupColumns, o: Elimination, x: Vector, z: Matrix, scal: Vector,
    still: Vector, inputs: Matrix, m: Scratch, s: StageScratch, outcome: Integers,
) -> None:  # fmt: skip
    """Solve one step in place of z, run to stagnation; outcome = status, component, and iterations added.

    A matrix whose pivots have shrunk below the order's floor asks for another order. That of one stage comes with its
    residual; that of several is used again while the residual falls fast.
    """
    before, part, iteration, fresh = on.variable(FAR), on.variable(1.0), on.counter(0), on.counter(1)
    n, single, ratio, defect = z.columns, scheme.single, on.variable(0.0), on.variable(0.0)
    right, change, dense, pivot = (
        (m.residual, m.step, m.dense, m.pivot) if single
        else (Vector(s.residual.cells, s.residual.start, scheme.stages * n), s.change, s.dense, s.pivot)
    )  # fmt: skip
    outcome[0], outcome[1] = RUNNING, 0
    m.defect[1] = COMMON

    def residual() -> Integer:
        if single:
            return evaluated(on, t, x, z.row(0), scal, inputs.row(0), m, scal[0])
        return linearise(on, scheme, t, g, o.dropped, x, z, scal, still, inputs, m, s, fresh.value)

    def stage(i: Integer) -> None:
        copy(on, s.residual.row(i), m.residual)
        copy(on, s.scale.row(i), m.scale)
        found = measure(on, t, z.row(i), o.dropped.part(0, n), m)
        number = on.both(found <= found, ratio.value <= ratio.value)
        ratio.value = on.select(number, on.maximum(ratio.value, found), ratio.value + found)
        defect.value = on.maximum(defect.value, m.defect[0])
        copy(on, m.residual, s.residual.row(i))

    def size() -> None:
        ratio.value, defect.value = 0.0, 0.0
        if single:
            ratio.value, defect.value = measure(on, t, z.row(0), o.dropped, m), m.defect[0]
        else:
            on.loop(scheme.stages, stage)

    def subtract(i: Integer) -> None:
        def entry(j: Integer) -> None:
            z[i, j] = z[i, j] - change[i * n + j]

        on.loop(n, entry)

    def refuse() -> None:
        outcome[0] = PIVOT

    def factors() -> None:
        data = _assemble(on, scheme, t, g, o, scal, z, m, s)
        good = factorise(on, o.place, o.start, o.entry, o.diagonal, data, m.factors, dense, o.floor, pivot)
        on.when(on.negate(good), refuse)

    def move() -> None:
        solve(on, o.rows, o.columns, o.start, o.entry, o.diagonal, m.factors, right, change, dense)
        part.value = restrain(on, t, z, Matrix(change.cells, change.start, scheme.stages, n))
        _each(on, scheme, subtract)
        if not single:
            slow = on.either(part.value < 1.0, ratio.value > 0.1 * before.value)
            fresh.value = on.select(on.either(on.same(iteration.value, 0), slow), 1, 0)
        before.value = ratio.value

    def judge() -> None:
        size()
        found = ratio.value
        solved = on.either(found <= SOLVED, on.both(found < STALLED, found > 0.7 * before.value))
        late = iteration.value > PATIENCE[not single]
        stuck = on.both(late, on.both(found > 0.9 * before.value, part.value >= 1.0))
        stuck = on.either(stuck, on.negate(found <= found))
        closed = on.select(defect.value > o.tolerance[0], INCONSISTENT, DONE)
        outcome[0] = on.select(solved, closed, on.select(stuck, DIVERGED, RUNNING))
        on.when(on.both(on.same(outcome[0], RUNNING), on.same(fresh.value, 1)), factors)
        on.when(on.same(outcome[0], RUNNING), move)

    def iterate() -> Truth:
        fault = residual()

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
    on: Evaluator, scheme: Scheme, t: Columns, g: GroupColumns, o: Elimination, m: Scratch, s: StageScratch, x: Vector,
    z: Matrix, previous: Matrix, scal: Vector, still: Vector, inputs: Matrix, sums: Vector, states: Matrix,
    energies: Matrix, ledgers: Matrix, outcome: Integers, steps: Integer,
) -> None:  # fmt: skip
    """Take ``steps`` steps of h = scal[0]; fill one row a step; outcome = status, component, steps done, iterations.

    x, z, previous and sums are the state of the method; a step that fails leaves x and sums as they were, and z as the
    next guess. A row of energies holds the energy of each storage, the entropy made so far of each irreversible
    component; a row of ledgers the heat, energy, exergy supplied, the entropy made, and the step's least production.
    ``still`` is scal for an instant.
    """
    n, tries, least, count, single = z.columns, on.counter(0), on.variable(0.0), scheme.stages, scheme.single
    guess = Matrix(*((m.step.cells, m.step.start) if single else (s.change.cells, s.change.start)), count, n)
    last = Matrix(previous.cells, previous.start, count, n)
    # of one stage the step's increment is h times its rates
    energy, whole, unit = (m.energy, z.row(0), scal[0]) if single else (s.energy, s.whole, 1.0)
    weights = _known(on, scheme.b)
    outcome[0], outcome[1], outcome[2], outcome[3] = DONE, 0, 0, 0

    def forward(j: Integer) -> None:
        values = [[z[i, j], *(previous[count * k + i, j] for k in range(BEFORE))] for i in range(count)]
        latest, past = ([each[k] for each in values] for k in range(2))
        for i, each in enumerate(values):
            others = []
            if not single:  # the polynomial through the stages, continued
                others.append((on.absolute(each[0] - dot(scheme.ahead[i], past)), dot(scheme.ahead[i], latest)))
            z[i, j] = extrapolated(on, each, others)
            for k in range(BEFORE):
                previous[count * k + i, j] = each[k]
            guess[i, j] = each[0] - z[i, j]

    def stages(source: Matrix, out: Matrix) -> None:
        _each(on, scheme, lambda i: copy(on, source.row(i), out.row(i)))

    def again() -> Truth:
        newton(on, scheme, t, g, o, x, z, scal, still, inputs, m, s, outcome)
        tries.value = tries.value + 1
        failed = on.negate(on.same(outcome[0], DONE))
        if single:  # other pivots and other equations to leave out ask for another order at once
            failed = on.either(outcome[0] >= COMPONENT, on.same(outcome[0], DIVERGED))
        once = on.both(failed, tries.value < 2)
        # once more from a safe guess: the last values at all stages
        on.when(once, lambda: _each(on, scheme, lambda i: copy(on, last.row(count - 1), z.row(i))))
        return on.negate(once)

    def book(i: Integer) -> None:
        part = scal[0] * weights[i]
        if not single:
            evaluated(on, t, s.x.row(i), z.row(i), still, inputs.row(i), m, still[0])
        balance(on, t, z.row(i), part, m, whole, part / unit, energy)
        least.value = least.value + account(on, t, z.row(i), part, inputs.row(i), m, sums)

    def keep() -> None:
        row = outcome[2]
        least.value = 0.0
        _each(on, scheme, book)
        move_states(on, t, x, unit, whole, m.v)
        copy(on, x, states.row(row))

        def kept(i: Integer) -> None:
            energies[row, i] = on.select(on.same(t.kind[i], STORING), energy[i], m.energy[i])

        on.loop(t.kind.size, kept)
        for i in range(4):
            ledgers[row, i] = sums[i]
        ledgers[row, 4] = least.value
        outcome[2] = row + 1

    def leave() -> None:
        # the rank at the start of the step changes within it
        on.when(on.same(outcome[0], INCONSISTENT), lambda: stages(z, last), lambda: stages(last, z))

    def step() -> Truth:
        on.loop(n, forward)
        on.when(restrain(on, t, last, guess) < 1.0, lambda: stages(last, z))
        tries.value = 0
        on.repeat(again)
        on.when(on.same(outcome[0], DONE), keep, leave)
        return on.either(outcome[2] >= steps, on.negate(on.same(outcome[0], DONE)))

    on.when(steps > 0, lambda: on.repeat(step))


@cache
def natural_program(stages: int) -> Program:
    """Return the program of steps with a number of stages."""
    scheme = gauss(stages)
    known: tuple[tuple[str, ...], Any] = (), lambda: scheme
    entries = {"advance": Entry.bundled(advance, {}, known)}
    if scheme.single:  # what is called from one place only would be inlined: steps would take 4 % longer
        entries["evaluate"] = Entry(evaluated)
    else:
        entries["linearise"] = Entry.bundled(linearise, {}, known)
    return Program("natural" if scheme.single else f"natural_of_{stages}_stages", **entries)


def natural_programs() -> tuple[Program, ...]:
    """Return the programs of the methods `natural` and `natural4`."""
    return natural_program(1), natural_program(3)
