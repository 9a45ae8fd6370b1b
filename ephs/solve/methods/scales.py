"""Scales of residuals, and the sizes of residuals relative to them.

A residual is measured by the magnitudes of its terms. Where all of them are near zero, as at rest, they have none of
their own: then it is measured by what its neighbours could make of it.
"""

from typing import Final

from ephs.semantics.linear.dense import clear
from ephs.semantics.stage import Evaluator, Integer, Integers, Real, Vector
from ephs.solve.methods.places import Part, each_component, raise_to
from ephs.solve.methods.records import IRREVERSIBLE, STORING, Columns, Scratch

NOTHING = 1e-200
"""Least scale of a balance, so that quotients by it are finite."""

SPREAD: Final = 1e-3
"""A block's scale is at least this fraction of the largest of its kind: e = 0 alone has no scale of its own."""

FAINT: Final = 1e-20
"""A block's scale is at least this fraction of the largest of all, whatever their units, in the iteration of a step
where that was least: terms of rounding, at rest, have no scale of their own."""
COMMON: Final = 1e18
"""The largest scale of which a fraction counts: beyond that numbers of different units lie too far apart."""

TAKES_PART: Final = 1e-3
"""The least coefficient, relative to the largest, with which an effort takes part in a constraint; less is rounding."""
FAR: Final = 1e300


def reach(on: Evaluator, t: Columns, m: Scratch) -> None:
    """Scale of each balance residual from the magnitudes of its efforts, into m.dense.

    The rate of a joint at rest is a difference of its bodies' twists, and so is known to the rounding of those.
    """
    n_rate, n_effort = t.counts[0], t.counts[1]
    flow, whole, largest, block = m.dense, m.step, m.pivot, m.block

    def begin(i: Integer) -> None:
        flow[i] = m.scale[n_rate + i]
        whole[i] = 0.0

    def gather(i: Integer) -> None:
        largest[i] = 0.0
        raise_to(on, block, t.block[i], m.scale[i])

    def size(k: Integer) -> None:
        entry = t.constraining[k]
        raise_to(on, largest, t.row[entry], on.absolute(m.data[entry]))

    def share(k: Integer) -> None:
        entry = t.constraining[k]
        row, effort, value = t.row[entry], t.column[entry] - n_rate, on.absolute(m.data[entry])
        on.when(value > TAKES_PART * largest[row], lambda: raise_to(on, whole, effort, block[t.block[row]] / value))

    def carry(k: Integer) -> None:
        entry = t.balancing[k]
        raise_to(on, flow, t.row[entry] - n_rate, on.absolute(m.data[entry]) * whole[t.column[entry] - n_rate])

    on.loop(n_effort, begin)
    clear(on, block)
    on.loop(largest.size, gather)
    on.loop(t.constraining.size, size)
    on.loop(t.constraining.size, share)
    on.loop(t.balancing.size, carry)


def rest(on: Evaluator, part: Part, h: Real, slopes: Vector, scale: Vector) -> None:
    """Scale of a storage's efforts at rest: their change by the flows in a step of h, by entries of the matrix."""

    def row(j: Integer) -> None:
        def entry(q: Integer) -> None:
            place = part.t.jacobian[part.j_at + j * part.n + q]

            def there() -> None:
                raise_to(on, scale, part.rate(j), h * on.absolute(slopes[place]) * scale[part.balance(q)])

            on.when(place >= 0, there)

        on.loop(part.n, entry)

    on.loop(part.n, row)


def still(on: Evaluator, t: Columns, z: Vector, m: Scratch) -> None:
    """Scales of efforts, and of entropy production, at rest."""

    def component(i: Integer) -> None:
        part = Part.of(t, i)
        on.when(on.same(t.kind[i], IRREVERSIBLE), lambda: produced(part))
        on.when(on.same(t.kind[i], STORING), lambda: rest(on, part, 1.0, m.data, m.scale))

    def produced(part: Part) -> None:
        # nor has entropy production, the square of a rounding-sized rate: the possible power of the forces counts
        power = on.variable(0.0)

        def made(j: Integer) -> None:
            effort = part.effort(j)
            warm = t.entropy[effort] > 0.0
            able = m.dense[effort] * on.absolute(z[part.balance(j)])
            power.value = on.select(warm, power.value, power.value + able)

        def heat(j: Integer) -> None:
            effort, row = part.effort(j), part.balance(j)
            wanted = on.both(t.entropy[effort] > 0.0, power.value > 0.0)
            on.when(
                wanted,
                lambda: raise_to(on, m.scale, row, power.value / on.absolute(z[row] + t.intensive[effort])),
            )

        on.loop(part.n, made)
        on.loop(part.n, heat)

    on.loop(t.kind.size, component)


def weigh(on: Evaluator, t: Columns, m: Scratch) -> None:
    """Measure the effort of each storage, too, by the balances that it takes part in.

    One that is zero, of a joint without stiffness, is known to the rounding of those, which is all its own size.
    """
    n_rate, n_effort, least = t.counts[0], t.counts[1], m.dense

    def begin(i: Integer) -> None:
        least[i] = FAR

    def known(entries: Integers) -> None:
        def each_entry(k: Integer) -> None:
            entry = entries[k]
            effort, value = t.column[entry] - n_rate, on.absolute(m.data[entry])

            def lower() -> None:
                least[effort] = on.minimum(least[effort], m.scale[t.row[entry]] / value)

            on.when(value > 0.0, lower)

        on.loop(entries.size, each_entry)

    def storing(part: Part) -> None:
        def row(j: Integer) -> None:
            effort = part.effort(j)
            on.when(least[effort] < FAR, lambda: raise_to(on, m.scale, part.rate(j), least[effort]))

        on.loop(part.n, row)

    on.loop(n_effort, begin)
    known(t.balancing)
    known(t.constraining)
    each_component(on, t, STORING, storing)


def measure(on: Evaluator, t: Columns, z: Vector, dropped: Integers, m: Scratch) -> Real:
    """Largest residual, each relative to the scale of its block; a dropped row becomes "this multiplier is zero".

    Not a number where a residual is none. The largest of the dropped ones goes into m.defect.
    """
    clear(on, m.block)
    clear(on, m.group)
    worst, defect, largest = on.variable(0.0), on.variable(0.0), on.variable(0.0)

    def gather(i: Integer) -> None:
        block = t.block[i]
        largest.value = on.maximum(largest.value, m.scale[i])
        raise_to(on, m.block, block, m.scale[i])
        raise_to(on, m.group, t.group[block], m.scale[i])

    def each_entry(i: Integer) -> None:
        block = t.block[i]
        scale = on.maximum(m.block[block], SPREAD * m.group[t.group[block]])
        scale = on.maximum(scale, FAINT * m.defect[1])
        sized = scale > NOTHING
        ratio = on.select(sized, on.absolute(m.residual[i]) / on.select(sized, scale, 1.0), 0.0)

        def leave() -> None:
            m.residual[i] = z[i]
            defect.value = on.maximum(defect.value, ratio)

        def keep() -> None:
            worst.value = on.maximum(worst.value, ratio)

        def nothing() -> None:
            worst.value = ratio

        on.when(on.same(dropped[i], 1), leave, keep)
        on.when(ratio <= ratio, lambda: None, nothing)

    on.loop(m.residual.size, gather)
    m.defect[1] = on.minimum(m.defect[1], largest.value)
    on.loop(m.residual.size, each_entry)
    m.defect[0] = defect.value
    return worst.value
