"""The corrections of the stages: one term a storage and one a joint, so that energy and positions are kept."""

from collections.abc import Callable
from typing import Final

from ephs.semantics.stage import Evaluator, Integer, Integers, Matrix, Real, Truth
from ephs.solve.methods.places import Part, add_to, each_component, each_row
from ephs.solve.methods.records import STORING, Columns, Dims, row_of
from ephs.solve.methods.scheme import GroupColumns, Node, Scheme, StageScratch, Velocity

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
