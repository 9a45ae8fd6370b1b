"""Residual, scale and matrix of a model's equations over a step, and ledgers, as staged functions."""

from functools import cache
from typing import Final

from ephs.semantics.descriptor.kernel_table import SIGNATURE
from ephs.semantics.linear.dense import add_to, clear, copy
from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Integers,
    Program,
    Real,
    Vector,
    staged,
)
from ephs.semantics.stage.reaching import Reached
from ephs.solve.methods.places import Part, each_component, each_input
from ephs.solve.methods.records import (
    COMPONENT,
    IRREVERSIBLE,
    STORING,
    WORKING,
    Columns,
    Dims,
    OuterPort,
    Scratch,
    row_of,
)
from ephs.solve.methods.scales import FAR, measure, reach, still, weigh

FAULTS: Final = 64
"""A fault is a component's number times this, and a status; 0 is none."""


@staged
def evaluated(
    on: Evaluator, t: Columns, x: Vector, z: Vector, scal: Vector, inputs: Vector, m: Scratch, weight: Real
) -> Integer:
    """Residual, its scale, and the matrix at z; 0, or COMPONENT + status + FAULTS · component.

    The weight is that of derivatives by increments of states in the matrix: the step, scal[0], for derivatives by rates
    over the step. With 1 at a step of 0 they are those by the states where they are.
    """
    fault = on.counter(0)
    copy(on, t.template, m.data)
    clear(on, m.residual)
    clear(on, m.scale)

    def component(i: Integer) -> None:
        def sound() -> None:
            part = Part.of(t, i)
            status = called(on, part, x, z, scal, m)

            def fail() -> None:
                fault.value = COMPONENT + status + FAULTS * i

            def stored() -> None:
                _store(on, part, z, weight, m)

            def related() -> None:
                _relate(on, part, z, weight, m)

            on.when(on.same(status, 0), lambda: on.when(on.same(t.kind[i], STORING), stored, related), fail)

        on.when(on.same(fault.value, 0), sound)

    def rest() -> None:
        _prescribe(on, t, z, inputs, m)
        reach(on, t, m)
        still(on, t, z, m)
        weigh(on, t, m)

    on.loop(t.kind.size, component)
    on.when(on.same(fault.value, 0), rest)
    return fault.value


def called(on: Evaluator, part: Part, x: Vector, z: Vector, scal: Vector, m: Scratch) -> Integer:
    """The status of a component's kernel, called at the unknowns."""
    t, i = part.t, part.i
    numbers, x_at, at = row_of(Dims, t.dims, i).numbers, t.read_x_at[i], t.parameter_at[i]

    def effort(j: Integer) -> None:
        m.e[j] = z[part.balance(j)]

    def multiplier(j: Integer) -> None:
        m.lam[j] = z[part.first + j]

    def increment(j: Integer) -> None:
        m.v[j] = scal[0] * z[part.rate(j)]

    def state(j: Integer) -> None:
        m.x[j] = x[t.read_x[x_at + j]]

    on.loop(part.n, effort)
    on.loop(part.k, multiplier)
    on.loop(part.m, increment)
    on.loop(numbers, state)
    dims = Integers(t.dims.cells, t.dims.start + Dims.integer_width * i, Dims.integer_width)
    parameters = t.parameters.part(at, t.parameters.size - at)
    return on.reach(
        Reached(SIGNATURE, t.address[i]), dims, scal, parameters, m.x, m.v, m.e, m.lam, m.f, m.c, m.jac, m.work
    )


def balance(
    on: Evaluator, t: Columns, z: Vector, h: Real, m: Scratch, entropies: Vector, by: Real, energies: Vector
) -> None:
    """Add what is left of the balances of entropies, times ``by``, to the change of what stores them in h seconds.

    A solution is known to the rounding of temperatures, what flows between nearly equal ones only to the difference of
    these: what a storage takes up is then that flow itself, or energy would be lost by as much as flows at all.

    Parameters
    ----------
    entropies, energies
        By their rates, and energies of all components at the end: what is changed.
    """

    def storing(part: Part) -> None:
        def port(j: Integer) -> None:
            row = part.balance(j)

            def take() -> None:
                more = -m.residual[row]
                add_to(entropies, part.rate(j), by * more)
                add_to(energies, part.i, (z[row] + t.intensive[part.effort(j)]) * (h * more))
                m.residual[row] = 0.0  # a second storage there gets no more

            on.when(t.entropy[part.effort(j)] > 0.0, take)

        on.loop(part.n, port)

    each_component(on, t, STORING, storing)


def _store(on: Evaluator, part: Part, z: Vector, weight: Real, m: Scratch) -> None:
    """e = ∂H, and the rate as a flow."""
    t, n = part.t, part.n
    m.energy[part.i] = m.c[0]

    def row(j: Integer) -> None:
        balance, rate = part.balance(j), part.rate(j)
        m.residual[rate] = z[balance] - m.e[j]
        m.scale[rate] = on.absolute(z[balance]) + on.absolute(m.e[j])
        add_to(m.residual, balance, z[rate])
        add_to(m.scale, balance, on.absolute(z[rate]))

        def entry(q: Integer) -> None:
            place = t.jacobian[part.j_at + j * n + q]
            on.when(place >= 0, lambda: add_to(m.data, place, -(weight * m.f[j * n + q])))

        on.loop(n, entry)

    on.loop(n, row)


def _relate(on: Evaluator, part: Part, z: Vector, weight: Real, m: Scratch) -> None:
    """Flows into the balances, and conditions."""
    t, n, k = part.t, part.n, part.k
    own = n + k
    width = own + part.m

    def derivatives(j: Integer) -> None:
        first = part.j_at + j * width

        def by_unknown(q: Integer) -> None:
            place = t.jacobian[first + q]
            on.when(place >= 0, lambda: add_to(m.data, place, m.jac[j * width + q]))

        def by_increment(q: Integer) -> None:
            place = t.jacobian[first + q]
            on.when(place >= 0, lambda: add_to(m.data, place, weight * m.jac[j * width + q]))

        on.loop(own, by_unknown)
        on.loop(width, by_increment, start=own)

    on.loop(own, derivatives)
    force = on.variable(0.0)

    def multiplier(j: Integer) -> None:
        force.value = on.maximum(force.value, on.absolute(m.lam[j]))

    on.loop(k, multiplier)

    def flow(j: Integer) -> None:
        balance, scale = part.balance(j), on.variable(0.0)
        add_to(m.residual, balance, m.f[j])
        # a balance of one term, Bᵀλ = 0, has no other scale: the largest multiplier counts
        scale.value = m.scale[balance] + on.absolute(m.f[j])

        def add_multiplier(q: Integer) -> None:
            scale.value = on.maximum(scale.value, on.absolute(m.jac[j * width + n + q]) * force.value)

        def term(q: Integer) -> None:
            # of what is irreversible the temperatures count, whose differences vanish near equilibrium
            known = on.select(on.same(t.kind[part.i], IRREVERSIBLE), t.intensive[part.effort(q)], 0.0)
            size = on.absolute(m.jac[j * width + q] * (z[part.balance(q)] + known))
            scale.value = on.maximum(scale.value, size)

        on.loop(k, add_multiplier)
        on.loop(n, term)  # a flow may be a small difference of large terms: p × v of a body that does not turn
        m.scale[balance] = scale.value
        m.flows[part.e_at + j] = m.f[j]

    def condition(j: Integer) -> None:
        row, scale = part.first + j, on.variable(m.scale[part.first + j])
        add_to(m.residual, row, m.c[j])

        def term(q: Integer) -> None:
            scale.value = scale.value + on.absolute(m.jac[(n + j) * width + q] * m.e[q])

        on.loop(n, term)
        m.scale[row] = scale.value

    on.loop(n, flow)
    on.loop(k, condition)


def _prescribe(on: Evaluator, t: Columns, z: Vector, inputs: Vector, m: Scratch) -> None:
    """Given quantities of outer ports: flows, or efforts whose flows are unknown."""

    def freedom(outer: OuterPort, j: Integer, place: Integer) -> None:
        row, unknown, given = t.counts[0] + outer.at + j, outer.unknown + j, inputs[place]

        def take(flow: Real) -> None:
            add_to(m.residual, row, -flow)
            add_to(m.scale, row, on.absolute(flow))

        def effort() -> None:
            m.residual[unknown] = z[row] - given
            m.scale[unknown] = on.absolute(z[row]) + on.absolute(given)
            take(z[unknown])

        on.when(on.same(outer.prescribed, 1), effort, lambda: take(given))

    each_input(on, t, freedom)


def account(on: Evaluator, t: Columns, z: Vector, h: Real, inputs: Vector, m: Scratch, sums: Vector) -> Real:
    """Add the ledgers of a step of h to sums; return the least entropy production of a component in it.

    sums = heat, supplied energy, supplied exergy, entropy made, and the entropy made by each component, or of a working
    one the energy that it supplied.
    """
    least = on.variable(FAR)

    def booked(part: Part, places: tuple[int, ...], amount: Real) -> None:
        for place in (*places, 4 + part.i):
            add_to(sums, place, amount)
        m.energy[part.i] = sums[4 + part.i]

    def produced(part: Part) -> None:
        heat, made = on.variable(0.0), on.variable(0.0)

        def port(j: Integer) -> None:
            effort, flow = part.effort(j), m.flows[part.e_at + j]

            def warm() -> None:
                made.value = made.value - flow

            def work() -> None:
                heat.value = heat.value + (z[part.balance(j)] + t.intensive[effort]) * flow

            on.when(t.entropy[effort] > 0.0, warm, work)

        on.loop(part.n, port)
        add_to(sums, 0, h * heat.value)
        booked(part, (3,), h * made.value)
        least.value = on.minimum(least.value, h * made.value)

    def worked(part: Part) -> None:
        work = on.variable(0.0)

        def port(j: Integer) -> None:
            work.value = work.value - z[part.balance(j)] * m.flows[part.e_at + j]

        on.loop(part.n, port)
        booked(part, (1, 2), h * work.value)

    def freedom(outer: OuterPort, j: Integer, place: Integer) -> None:
        at, flow = outer.at + j, on.variable(0.0)
        effort = z[t.counts[0] + at]

        def unknown() -> None:
            flow.value = z[outer.unknown + j]

        def given() -> None:
            flow.value = inputs[place]

        on.when(on.same(outer.prescribed, 1), unknown, given)
        add_to(sums, 1, h * (effort + t.intensive[at]) * flow.value)
        add_to(sums, 2, h * effort * flow.value)

    each_component(on, t, IRREVERSIBLE, produced)
    each_component(on, t, WORKING, worked)
    each_input(on, t, freedom)
    return on.select(least.value < FAR, least.value, 0.0)


@cache
def evaluation_program() -> Program:
    """Return the program of single evaluations."""
    return Program(
        "evaluation", evaluate=Entry(evaluated), measure=Entry(measure), account=Entry(account), reach=Entry(reach),
        weigh=Entry(weigh),
    )  # fmt: skip
