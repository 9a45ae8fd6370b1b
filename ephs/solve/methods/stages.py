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

from collections.abc import Callable
from typing import Final

from ephs.semantics.linear.dense import add_to, copy
from ephs.semantics.spaces import codes
from ephs.semantics.spaces.staged_groups import STAGED
from ephs.semantics.spaces.vectors import apply, dot
from ephs.semantics.stage import Evaluator, Integer, Integers, Matrix, Real, Truth, Vector, staged
from ephs.solve.methods.moves import retract, somewhere
from ephs.solve.methods.places import Part, each_component, each_row
from ephs.solve.methods.records import STORING, Columns, Dims, Scratch, StateRecord, row_of
from ephs.solve.methods.residuals import evaluated
from ephs.solve.methods.scales import rest
from ephs.solve.methods.scheme import GroupColumns, Node, Scheme, StageScratch, Velocity

# The corrections of the stages: one term a storage and one a joint, so that energy and positions are kept.

_NONE: Final = 1e-280
"""Squares up to which there is nothing to correct along."""


def bend(on: Evaluator, scheme: Scheme, g: GroupColumns, h: Real, z: Matrix, s: StageScratch) -> None:
    """Derivatives of the factors α of storages of entropy by the rates: their energies bend too much to leave them out.

    A small capacity warms by orders of magnitude in a step; of other storages α is of the quadrature's order.
    """

    def node(row: Node, k: Integer) -> None:
        rate, effort = row.rate, row.effort
        rates = [z[i, rate] for i in range(scheme.stages)]
        defect, square = s.gradient[rate] * s.whole[rate] / h, 0.0
        for i in range(scheme.stages):
            defect = defect - scheme.b[i] * (z[i, effort] - s.residual[i, rate]) * rates[i]
            square = square + scheme.b[i] * rates[i] * rates[i]
        s.factor[k] = 0.0
        for j in range(scheme.stages):
            s.share[k, j] = 0.0

        def bent() -> None:
            factor = defect / square
            s.factor[k] = factor
            slopes = [s.slope[i, row.slope] for i in range(scheme.stages)]
            for j in range(scheme.stages):
                by = scheme.b[j] * (s.end[k] - z[j, effort] + s.residual[j, rate])
                for i in range(scheme.stages):
                    by = by + h * scheme.b[i] * scheme.a[i][j] * rates[i] * slopes[i]
                s.share[k, j] = (by - 2.0 * factor * scheme.b[j] * rates[j]) / square

        on.when(square > _NONE, bent)

    each_row(on, Node, g.node, node)


def correct_storages(on: Evaluator, scheme: Scheme, t: Columns, h: Real, z: Matrix, s: StageScratch) -> None:
    """Put the one-term corrections of the storages into the residuals of the stages."""

    def storing(part: Part) -> None:
        defect, square = on.variable(0.0), on.variable(0.0)

        def port(j: Integer) -> None:
            rate, effort = part.rate(j), part.balance(j)
            lost, moved = defect.value + s.gradient[rate] * s.whole[rate] / h, square.value
            for i in range(scheme.stages):
                lost = lost - scheme.b[i] * (z[i, effort] - s.residual[i, rate]) * z[i, rate]
                moved = moved + scheme.b[i] * z[i, rate] * z[i, rate]
            defect.value, square.value = lost, moved

        def share(j: Integer) -> None:
            rate = part.rate(j)
            for i in range(scheme.stages):
                s.residual[i, rate] = s.residual[i, rate] - defect.value / square.value * z[i, rate]

        on.loop(part.n, port)
        on.when(square.value > _NONE, lambda: on.loop(part.n, share))

    each_component(on, t, STORING, storing)


def correct_joints(
    on: Evaluator, scheme: Scheme, t: Columns, g: GroupColumns, dropped: Integers, z: Matrix, s: StageScratch
) -> None:
    """Put the one-term corrections of the joints into the residuals of the stages.

    Stages are off the positions of joints by the order of the quadrature. An equation that follows from the others
    only where loops are closed (Bricard's linkage) is missed there by as much; over the step it holds, and that is its
    residual.
    """
    n_rate, count = t.counts[0], g.velocity.size // Velocity.integer_width
    at = on.counter(0)
    square, power = on.variable(0.0), on.variable(0.0)

    def velocity(k: Integer) -> Velocity:
        return row_of(Velocity, g.velocity, k)

    def pairs(k: Integer, do: Callable[[Integer, Integer, Real], None]) -> None:
        row = velocity(k)
        first = n_rate + row.effort

        def left(j: Integer) -> None:
            def right(q: Integer) -> None:
                do(first + j, first + q, g.metric[36 * k + 6 * j + q])

            on.loop(row.dim, right)

        on.loop(row.dim, left)

    def joint() -> Truth:
        begin, component = at.value, velocity(at.value).component
        first = n_rate + t.counts[1] + t.multiplier_at[component]
        square.value, power.value = 0.0, 0.0

        def squared(j: Integer, q: Integer, weight: Real) -> None:
            def sum_up() -> None:
                found = square.value
                for i in range(scheme.stages):
                    found = found + scheme.b[i] * z[i, j] * weight * z[i, q]
                square.value = found

            on.when(on.absolute(weight) > 0.0, sum_up)

        def another() -> Truth:
            pairs(at.value, squared)
            at.value = at.value + 1
            more = on.variable(0.0)

            def same() -> None:
                more.value = on.select(on.same(velocity(at.value).component, component), 1.0, 0.0)

            on.when(at.value < count, same)
            return more.value <= 0.0

        def condition(j: Integer) -> None:
            row = first + j
            delta, force = s.gap[row], 0.0
            for i in range(scheme.stages):
                delta = delta - scheme.b[i] * s.residual[i, row]
                force = force + scheme.b[i] * z[i, row]
            power.value = power.value + delta * force
            closing = on.same(dropped[row], 1)
            for i in range(scheme.stages):
                s.residual[i, row] = on.select(closing, s.gap[row], s.residual[i, row] + delta)

        def shared(j: Integer, q: Integer, weight: Real) -> None:
            share = power.value / square.value * weight

            def give() -> None:
                for i in range(scheme.stages):
                    add_to(s.residual.row(i), j, share * z[i, q])

            on.when(on.absolute(share) > 0.0, give)

        on.repeat(another)
        on.loop(row_of(Dims, t.dims, component).multipliers, condition)
        on.when(square.value > _NONE, lambda: on.loop(at.value, lambda k: pairs(k, shared), start=begin))
        return at.value >= count

    on.when(count > 0, lambda: on.repeat(joint))


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
