"""Equations of the unknowns of a natural step, as staged functions: Gauss stages, corrected component by component.

With one stage these are the relations over the step. With several, every component has its continuous relation at
each. Over the step the stages' increments of each state make one increment V; the relations over the step, evaluated
at V, say by how much a storage's energy changes and whether a joint closes. What the stages miss of that is of high
order and is put in as one term a component:

    e_i = dH(x_i) + α f_i                 with Σ b_i ⟨e_i|h f_i⟩ = H(x¹) − H(x⁰)
    0 = C_i e_i + δ,  f_i = C_i*λ_i + e_i ⟨δ|Σ b_j λ_j⟩/Σ b_j ⟨e_j|e_j⟩     with δ = F − Σ b_j C_j e_j

so that storages store what flows into them, joints make no power and stay closed, and dissipation, which is left as it
is, takes place at the stages with positive weights.

With joints their number is odd: with an even one what momenta have across the constraints would add up from step to
step and the order fall to 2 (Hairer, Lubich and Roche, *Lecture Notes in Mathematics* 1409, table 2.3: with three
stages it is 4).
"""

from typing import Final

from ephs.semantics.linear.dense import copy
from ephs.semantics.spaces import codes
from ephs.semantics.spaces.staged_groups import STAGED
from ephs.semantics.spaces.vectors import apply, dot
from ephs.semantics.stage import Evaluator, Integer, Integers, Matrix, Real, Truth, Vector, staged
from ephs.solve.methods.corrections import bend, correct_joints, correct_storages
from ephs.solve.methods.moves import retract, somewhere
from ephs.solve.methods.places import Part, each_component, each_row
from ephs.solve.methods.records import STORING, Columns, Scratch, StateRecord
from ephs.solve.methods.residuals import evaluated
from ephs.solve.methods.scales import rest
from ephs.solve.methods.scheme import GroupColumns, Node, Scheme, StageScratch, Velocity

LAST = 2e-16
"""Relative change at the level of the last digit."""

_FIXED: Final = 30
"""Rounds of the iteration for the exponents on a group."""


@staged
def exponents(
    on: Evaluator, scheme: Scheme, code: Integer, h: Real, z: Matrix, first: Integer, dim: Integer, v: Matrix,
    at: Integer, whole: Vector, turn: Matrix,
) -> None:  # fmt: skip
    """Increments to the stages, v_i = h Σ a_ij D(v_j) w_j with D = dexp⁻¹, and over the step; velocities w are in z."""
    change, size = on.variable(0.0), on.variable(0.0)

    def begin(j: Integer) -> None:
        for i in range(scheme.stages):
            turn[i, j] = z[i, first + j]

    def increments(j: Integer) -> None:
        turns = [turn[i, j] for i in range(scheme.stages)]
        for i in range(scheme.stages):
            entry = dot([h * weight for weight in scheme.a[i]], turns)
            change.value = on.maximum(change.value, on.absolute(entry - v[i, at + j]))
            size.value = on.maximum(size.value, on.absolute(entry))
            v[i, at + j] = entry

    def on_group(number: int, dims: int) -> None:
        rounds = on.counter(0)

        def turned(i: Integer) -> None:
            rows = STAGED[number].dexp_left_inv(on, [v[i, at + j] for j in range(dims)])
            for j, entry in enumerate(apply(rows, [z[i, first + j] for j in range(dims)])):
                turn[i, j] = entry

        def once() -> Truth:
            change.value, size.value = 0.0, 0.0
            on.loop(dims, increments)
            done = on.both(rounds.value > 0, change.value <= LAST * size.value)
            on.when(on.negate(done), lambda: on.loop(scheme.stages, turned))
            rounds.value = rounds.value + 1
            return on.either(done, rounds.value >= _FIXED)

        on.when(on.same(code, number), lambda: on.repeat(once))

    def sum_up(j: Integer) -> None:
        whole[j] = dot([h * weight for weight in scheme.b], [turn[i, j] for i in range(scheme.stages)])

    on.loop(dim, begin)
    on.when(on.same(code, codes.VECTOR), lambda: on.loop(dim, increments))
    for number, dims in ((codes.SO3, 3), (codes.SE2, 3), (codes.SE3, 6), (codes.SO3xR3, 6)):
        on_group(number, dims)
    on.loop(dim, sum_up)


@staged
def linearise(
    on: Evaluator, scheme: Scheme, t: Columns, g: GroupColumns, dropped: Integers, x: Vector, z: Matrix, scal: Vector,
    still: Vector, inputs: Matrix, m: Scratch, s: StageScratch, fresh: Integer,
) -> Integer:  # fmt: skip
    """Residuals of the stages with their corrections, and where fresh their matrices; 0 or a fault of `evaluated`."""
    n_rate, n, h = t.counts[0], z.columns, scal[0]
    fault, zero, mean_at = on.counter(0), on.counter(0).value, somewhere(on, s.mean)

    def state(row: StateRecord, _: Integer) -> None:
        rate, dim = row.rate, row.dim
        exponents(on, scheme, row.code, h, z, rate, dim, s.v, rate, s.whole.part(rate, dim), s.turn)

        def stage(i: Integer) -> None:
            retract(
                on, row.code, x.part(row.at, row.size), s.v.row(i).part(rate, dim), s.x.row(i).part(row.at, row.size)
            )

        on.loop(scheme.stages, stage)

    def mean_rate(j: Integer) -> None:
        s.mean[j] = s.whole[j] / h

    def mean(j: Integer) -> None:
        s.mean[j] = dot(scheme.b, [z[i, j] for i in range(scheme.stages)])

    def velocity(row: Velocity, _: Integer) -> None:
        first = n_rate + row.effort

        def exponent() -> None:
            exponents(on, scheme, row.code, h, z, first, row.dim, s.outer, zero, somewhere(on, s.one), s.turn)

            def write(j: Integer) -> None:
                s.mean[first + j] = s.one[j] / h

            on.loop(row.dim, write)

        on.when(on.negate(on.same(row.code, codes.VECTOR)), exponent)

    each_row(on, StateRecord, t.states, state)
    on.loop(n_rate, mean_rate)
    on.loop(n, mean, start=n_rate)
    each_row(on, Velocity, g.velocity, velocity)
    # the step as a whole: discrete gradients, and whether joints close
    fault.value = evaluated(on, t, somewhere(on, x), mean_at, scal, inputs.row(zero), m, h)

    def stage(i: Integer) -> None:
        def still_there() -> None:
            fault.value = evaluated(on, t, s.x.row(i), z.row(i), still, inputs.row(i), m, still[0])
            on.when(on.same(fault.value, 0), keep)

        def keep() -> None:
            copy(on, m.residual, s.residual.row(i))
            copy(on, m.scale, s.scale.row(i))
            on.when(on.same(fresh, 1), derivatives)
            on.when(on.same(fault.value, 0), lambda: each_component(on, t, STORING, resting))

        def resting(part: Part) -> None:
            rest(on, part, on.absolute(h), s.slope.row(i), s.scale.row(i))

        def derivatives() -> None:
            copy(on, m.data, s.data.row(i))

            def slope(j: Integer) -> None:
                s.slope[i, j] = 2.0 * (m.data[j] - s.data[i, j])

            fault.value = evaluated(on, t, s.x.row(i), z.row(i), still, inputs.row(i), m, on.variable(1.0).value)
            on.when(on.same(fault.value, 0), lambda: on.loop(s.data.columns, slope))

        on.when(on.same(fault.value, 0), still_there)

    def over_the_step() -> None:
        _over_the_step(on, t, g, h, n, m, s)
        on.loop(scheme.stages, stage)

    def correct() -> None:
        on.when(on.same(fresh, 1), lambda: bend(on, scheme, g, h, z, s))
        correct_storages(on, scheme, t, h, z, s)
        correct_joints(on, scheme, t, g, dropped, z, s)

    on.when(on.same(fault.value, 0), over_the_step)
    on.when(on.same(fault.value, 0), correct)
    return fault.value


def _over_the_step(
    on: Evaluator, t: Columns, g: GroupColumns, h: Real, n: Integer, m: Scratch, s: StageScratch
) -> None:
    """Energies, discrete gradients, temperatures at the end and gaps, as `evaluated` left them in m."""

    def storing(part: Part) -> None:
        def port(j: Integer) -> None:
            rate = part.rate(j)
            s.gradient[rate] = s.mean[part.balance(j)] - m.residual[rate]

        on.loop(part.n, port)

    def node(row: Node, k: Integer) -> None:
        s.end[k] = s.gradient[row.rate] - s.whole[row.rate] / h * m.data[row.slope]

    def gap(j: Integer) -> None:
        s.gap[j] = m.residual[j]

    copy(on, m.energy, s.energy)
    each_component(on, t, STORING, storing)
    each_row(on, Node, g.node, node)
    on.loop(n, gap, start=t.counts[0] + t.counts[1])
