"""States moved to the energy that a step leaves to them, within the range of the flows.

Charges of closed nets, volumes, amounts and momenta are sums that the flows of a system keep. What a step changed, Δx,
and what is left of h ẋ at its end beside that, are within the range of the flows, so that a move along both keeps every
sum that the step kept. Of a conservative system the first does not change the energy, and the second, ½ h² ẍ, does:
there ⟨dE|ẍ⟩ = −⟨ẋ|d²E ẋ⟩. Where all is dissipated it is the first. Both are weighed by the energy's own curvature, so
that the move is along the gradient of the energy as far as they span it. Entropies are not moved: they are what was
made.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from ephs.semantics.stage import Evaluator, Integer, Real, Truth, Variable, Vector
from ephs.solve.march.account import BEYOND, MOST, ROUNDING, RunAccount

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


@dataclass(frozen=True, slots=True)
class Missing(ABC):
    """Energy that the end of a step misses.

    Parameters
    ----------
    target
        Energy in J that it is to have.
    energies
        (3,) two parts of its energy, and the sum of their terms' sizes in J, as they were evaluated last.
    status
        Of the last evaluation.
    always
        Whether what is only rounding is met, too: for the sake of its derivatives.
    """

    on: Evaluator
    account: RunAccount
    target: Real
    energies: Vector
    status: Variable[Integer]
    always: bool

    @abstractmethod
    def look(self, states: Vector) -> None:
        """Evaluate the energy with these states of what is stored."""

    @property
    def energy(self) -> Real:
        """Energy in J, as it was evaluated last."""
        return self.energies[0] + self.energies[1]

    @property
    def short(self) -> Real:
        """Missing energy in J."""
        return self.target - self.energy

    @property
    def known(self) -> Truth:
        """Whether it is a number: else nothing is to be met."""
        return self.on.absolute(self.short) < BEYOND

    @property
    def close(self) -> Truth:
        """Whether it is no more than rounding, or not a number."""
        return self.on.negate(self.on.absolute(self.short) > self.account.noise)


@final
@dataclass(frozen=True, slots=True)
class Moved:
    """States at the end of a step; vectors are (n,).

    Parameters
    ----------
    states, start
        Their values, and those at the step's start.
    along, beside
        What the step changed, and h ẋ at its end less that; zero of entropies, and of what is not to be used. They are
        overwritten.
    trial
        Memory.
    allowed
        What their errors may be.
    free
        Number of a state -> 1 where it may be moved, else 0.
    """

    states: Vector
    start: Vector
    along: Vector
    beside: Vector
    trial: Vector
    allowed: Vector
    free: Callable[[Integer], Real]


def store(run: Missing, x: Moved) -> None:
    """Move states along the directions of a step, until no more than rounding is missing."""
    on = run.on
    _even(on, x)
    found = _energies(run, x)
    first, slope = _weigh(run, found, 0)
    second, more = _weigh(run, found, 1)

    def join(k: Integer) -> None:
        x.along[k] = first * x.along[k] + second * x.beside[k]

    on.loop(x.states.size, join)
    whole = on.variable(slope + more)
    run.look(x.states)
    within = on.both(whole.value > 0.0, on.absolute(run.short) <= FARTHEST * whole.value)
    on.when(within, lambda: _newton_along(run, x, whole))


def _even(on: Evaluator, x: Moved) -> None:
    """Make both directions of equal size, relative to the sizes of states; zero where one is nothing."""
    one, other = on.variable(0.0), on.variable(0.0)

    def part(k: Integer) -> None:
        step, left = x.along[k], x.beside[k]
        whole = on.absolute(x.states[k]) + on.absolute(x.start[k]) + on.absolute(left)
        whole = on.select(whole > 0.0, whole, 1.0)
        one.value, other.value = (
            one.value + (step / whole) * (step / whole),
            other.value + left / whole * (left / whole),
        )

    on.loop(x.states.size, part)
    seen = SEEN * SEEN
    near = on.select(one.value > seen, one.value, 0.0)
    equal = on.sqrt(on.select(near > 0.0, near, 1.0) / on.select(other.value > seen, other.value, 1.0))
    scale = on.select(other.value > seen, on.select(near > 0.0, equal, 1.0), 0.0)

    def even(k: Integer) -> None:
        x.along[k] = on.select(near > 0.0, x.along[k], 0.0)
        x.beside[k] = scale * x.beside[k]

    on.loop(x.states.size, even)


def _energies(run: Missing, x: Moved) -> Vector:
    """Return the changes (4,) of the energy forwards and backwards along both directions; BEYOND without one."""
    on, here, found = run.on, run.on.variable(run.energy), run.on.scratch(4)

    def each_entry(k: Integer) -> None:
        sign = on.select(on.either(on.same(k, 0), on.same(k, 2)), 1.0, -1.0)

        def place(j: Integer) -> None:
            x.trial[j] = x.states[j] + sign * on.select(k < 2, x.along[j], x.beside[j])

        on.loop(x.trial.size, place)
        run.look(x.trial)
        change = run.energy - here.value
        sound = on.both(on.same(run.status.value, 0), on.absolute(change) < BEYOND)
        found[k] = on.select(sound, change, BEYOND)

    on.loop(4, each_entry)
    run.status.value = 0
    return found


def _weigh(run: Missing, found: Vector, which: int) -> tuple[Real, Real]:
    """Return dE/d²E along a direction, and (dE)²/d²E: nothing where its change of the energy is rounding."""
    on, rise, fall = run.on, found[2 * which], -found[2 * which + 1]
    sound = on.both(rise < BEYOND, fall > -BEYOND)
    slope, bend = on.select(sound, 0.5 * (rise + fall), 0.0), on.absolute(rise - fall)
    known = on.absolute(slope) > run.account.noise
    bend = on.maximum(bend, STRAIGHT * on.absolute(slope))
    ratio = on.select(known, slope / on.select(known, bend, 1.0), 0.0)
    return ratio, ratio * slope


def _newton_along(run: Missing, x: Moved, whole: Variable[Real]) -> None:
    """Move along a direction by Newton's method, no further than chosen steps may."""
    on, account = run.on, run.account
    total, count, first = on.variable(0.0), on.variable(0.0), on.variable(run.short)

    def measure(k: Integer) -> None:
        part = x.along[k] / x.allowed[k]
        total.value, count.value = total.value + part * part, count.value + x.free(k)

    on.loop(x.along.size, measure)
    size = on.absolute(first.value / whole.value) * on.sqrt(total.value / on.maximum(count.value, 1.0))
    far = on.both(on.same(account.chosen, 1), size > MOST)
    part = on.select(far, MOST / on.select(far, size, 1.0), 1.0)
    rounds = on.counter(0)

    def shift(by: Real) -> None:
        def each_entry(k: Integer) -> None:
            x.states[k] = x.states[k] + by * x.along[k]

        on.loop(x.along.size, each_entry)

    def once() -> Truth:
        short, known = on.variable(run.short), [on.variable(run.energies[k]) for k in range(3)]
        step = part * (short.value / whole.value)
        shift(step)
        run.look(x.states)
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
