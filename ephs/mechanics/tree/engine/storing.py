"""Attached states moved to the energy that a step leaves to them, where the motion of bodies does not take it.

Charges of closed nets, volumes, amounts and momenta are sums that the flows of a system keep. What a step changed, Δx,
and what is left of h ẋ at its end beside that, are within the range of the flows, so that a move along both keeps every
sum that the step kept. Of a conservative system the first does not change the energy, and the second, ½ h² ẍ, does:
there ⟨dE|ẍ⟩ = −⟨ẋ|d²E ẋ⟩. Where all is dissipated it is the first. Both are weighed by the energy's own curvature, so
that the move is along the gradient of the energy as far as they span it. Entropies are not moved: they are what was
made.
"""

from typing import TYPE_CHECKING

from ephs.semantics.stage import Evaluator, Integer, Real, Truth, Variable, Vector
from ephs.solve.march.account import BEYOND, MOST, ROUNDING

if TYPE_CHECKING:
    from ephs.mechanics.tree.engine.balance import Correction

__all__ = ["store"]

ROUNDS = 8
"""Iterations."""
FARTHEST = 0.5
"""Part of its direction by which a state is moved at most."""
SEEN = 1e6 * ROUNDING
"""Relative size of a direction below which rounding of sums that are kept is no small part of it."""
LEARNT, ALWAYS = 16.0, 3
"""Missing energy by its rounding from which on a move tells the slope; moves for the sake of derivatives."""
STRAIGHT = 1e-6
"""Least curvature of the energy along a direction relative to its change: of energies that are linear."""


def store(on: Evaluator, run: "Correction") -> None:
    """Move attached states along the directions of a step, until no more than rounding is missing."""
    w, size = run.motion.work, run.heats.size
    along, beside = w.idle.part(0, size), w.spare.part(0, size)
    _directions(on, run, along, beside)
    found = _energies(on, run, along, beside)
    first, slope = _weigh(on, run, found, 0)
    second, more = _weigh(on, run, found, 1)

    def join(k: Integer) -> None:
        along[k] = first * along[k] + second * beside[k]

    on.loop(size, join)
    whole = on.variable(slope + more)
    run.look()
    within = on.both(whole.value > 0.0, on.absolute(run.short) <= FARTHEST * whole.value)
    on.when(within, lambda: _go(on, run, along, whole))


def _directions(on: Evaluator, run: "Correction", along: Vector, beside: Vector) -> None:
    """Write what the step changed, and what h ẋ at its end is beside that, of equal size; zero where that is nothing.

    Sizes are relative to those of the states.
    """
    motion, w, nodes, size = run.motion, run.motion.work, run.motion.tables.node, run.heats.size
    rest = w.spare.size - (size + 2)
    found = motion.accelerate(
        on, run.q, run.r, w.descent, beside, w.spare.part(size + 2, rest), w.spare.part(size, 2)
    )  # fmt: skip
    sound, one, other = on.same(found, 0), on.variable(0.0), on.variable(0.0)

    def part(k: Integer) -> None:
        free = on.real(nodes[k].free)
        step = free * (run.heats[k] - run.start[k])
        left = on.select(sound, free * (run.h * beside[k]) - step, 0.0)
        along[k], beside[k] = step, left
        whole = on.absolute(run.heats[k]) + on.absolute(run.start[k]) + on.absolute(left)
        whole = on.select(whole > 0.0, whole, 1.0)
        one.value, other.value = (
            one.value + (step / whole) * (step / whole),
            other.value + left / whole * (left / whole),
        )

    on.loop(size, part)
    seen = SEEN * SEEN
    near = on.select(one.value > seen, one.value, 0.0)
    equal = on.sqrt(on.select(near > 0.0, near, 1.0) / on.select(other.value > seen, other.value, 1.0))
    scale = on.select(other.value > seen, on.select(near > 0.0, equal, 1.0), 0.0)

    def even(k: Integer) -> None:
        along[k] = on.select(near > 0.0, along[k], 0.0)
        beside[k] = scale * beside[k]

    on.loop(size, even)


def _energies(on: Evaluator, run: "Correction", along: Vector, beside: Vector) -> Vector:
    """Return the changes (4,) of the energy forwards and backwards along both directions; BEYOND without one."""
    trial, here = run.motion.work.temperature.part(0, along.size), on.variable(run.energy)
    found = on.scratch(4)

    def one(k: Integer) -> None:
        sign = on.select(on.either(on.same(k, 0), on.same(k, 2)), 1.0, -1.0)

        def place(j: Integer) -> None:
            trial[j] = run.heats[j] + sign * on.select(k < 2, along[j], beside[j])

        on.loop(along.size, place)
        change = run.energy_at(trial) - here.value
        sound = on.both(on.same(run.status.value, 0), on.absolute(change) < BEYOND)
        found[k] = on.select(sound, change, BEYOND)

    on.loop(4, one)
    run.status.value = 0
    return found


def _weigh(on: Evaluator, run: "Correction", found: Vector, which: int) -> tuple[Real, Real]:
    """Return dE/d²E along a direction, and (dE)²/d²E: nothing where its change of the energy is rounding."""
    rise, fall = found[2 * which], -found[2 * which + 1]
    sound = on.both(rise < BEYOND, fall > -BEYOND)
    slope, bend = on.select(sound, 0.5 * (rise + fall), 0.0), on.absolute(rise - fall)
    known = on.absolute(slope) > run.account.noise
    bend = on.maximum(bend, STRAIGHT * on.absolute(slope))
    ratio = on.select(known, slope / on.select(known, bend, 1.0), 0.0)
    return ratio, ratio * slope


def _go(on: Evaluator, run: "Correction", along: Vector, whole: Variable[Real]) -> None:
    """Move along a direction by Newton's method, no further than chosen steps may."""
    account, total, count, first = run.account, on.variable(0.0), on.variable(0.0), on.variable(run.short)
    nodes, before = run.motion.tables.node, 2 * run.motion.freedoms

    def measure(k: Integer) -> None:
        x = along[k] / run.allowed[before + k]
        total.value, count.value = total.value + x * x, count.value + on.real(nodes[k].free)

    on.loop(along.size, measure)
    size = on.absolute(first.value / whole.value) * on.sqrt(total.value / on.maximum(count.value, 1.0))
    far = on.both(on.same(account.chosen, 1), size > MOST)
    part = on.select(far, MOST / on.select(far, size, 1.0), 1.0)
    rounds = on.counter(0)

    def shift(by: Real) -> None:
        def one(k: Integer) -> None:
            run.heats[k] = run.heats[k] + by * along[k]

        on.loop(along.size, one)

    def once() -> Truth:
        short, known = on.variable(run.short), [on.variable(run.energies[k]) for k in range(3)]
        step = part * (short.value / whole.value)
        shift(step)
        run.look()
        sound = on.same(run.status.value, 0)

        def back() -> None:
            shift(-step)
            run.status.value = 0
            for k, energy in enumerate(known):
                run.energies[k] = energy.value

        on.when(sound, lambda: None, back)
        rounds.value = rounds.value + 1
        share = (short.value - run.short) / on.select(on.absolute(short.value) > 0.0, part * short.value, 1.0)
        seen = on.both(on.absolute(short.value) > LEARNT * account.noise, on.both(share > 0.25, share < 4.0))
        whole.value = whole.value * on.select(seen, share, 1.0)
        enough = on.both(run.close, rounds.value >= (ALWAYS if run.always else 1))
        return on.either(on.either(enough, far), on.either(on.negate(sound), rounds.value >= ROUNDS))

    on.repeat(once)
    account.moved = account.moved + (first.value - run.short)
    account.size = on.maximum(account.size, size)
