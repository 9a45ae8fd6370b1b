"""Energy of a mechanism, and projection of states onto the energy that heat and work imply.

A state moves along the gradient n = G⁻¹∇E of the energy E with the mass matrix M as metric of the rates, within loops
and with prescribed motions as they are: rates alone, r + α n with n their free part, which is r itself without
prescribed motions; where they are no more than what the step changed them by, positions too, along −h² M⁻¹∇V.

Where momenta are kept, too, islands are first moved rigidly to those that they had, see
`ephs.mechanics.road.rigid`; n is then without the rigid motions, and positions are also moved along these, as
the momenta turn them by themselves.

The remaining difference of energy goes to attached states, see `store_attached`.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, final

from ephs.mechanics.tree.engine.attachment import attached_energy
from ephs.mechanics.tree.engine.forces import strain
from ephs.mechanics.tree.engine.heats import entropies
from ephs.mechanics.tree.sweeps.acting import TOTALS, PushedBody
from ephs.semantics.linear.dense import clear, copy
from ephs.semantics.spaces.rank import TINY
from ephs.semantics.stage import Evaluator, Integer, Real, Table, Truth, Variable, Vector, staged
from ephs.solve.march.account import BEYOND, MOST, ROUNDING, WORTH, RunAccount, rounding, stretch
from ephs.solve.march.storing import Missing, Moved, store

if TYPE_CHECKING:
    from ephs.mechanics.tree.engine.motion import Mechanism


# Attached states moved to the energy that a step leaves to them, where the motion of bodies does not take it.


def store_attached(run: "Correction") -> None:
    """Move attached states along what the step changed, and what h ẋ at its end is beside that."""
    on, motion, w, nodes, size = run.on, run.motion, run.motion.work, run.motion.tables.node, run.heats.size
    along, beside, rest = w.idle.part(0, size), w.spare.part(0, size), w.spare.size - (size + TOTALS)
    found = motion.accelerate(
        on, run.q, run.r, w.descent, beside, w.spare.part(size + TOTALS, rest), w.spare.part(size, TOTALS)
    )  # fmt: skip
    sound = on.same(found, 0)

    def free(k: Integer) -> Real:
        return on.real(nodes[k].free)

    def part(k: Integer) -> None:
        step = free(k) * (run.heats[k] - run.start[k])
        left = on.select(sound, free(k) * (run.h * beside[k]) - step, 0.0)
        along[k], beside[k] = step, left

    on.loop(size, part)
    allowed = run.allowed.part(2 * motion.freedoms, size)
    store(run, Moved(run.heats, run.start, along, beside, w.temperature.part(0, size), allowed, free))


ROUNDS = 8
"""Iterations that move positions."""
RIGID = 1e-24
"""Part of the kinetic energy below which what rigid motions leave of it is rounding."""
REFUSED = 2.0
"""Error of a step whose missing energy is not found in all rounds."""
FARTHEST = 0.5
"""Part of its direction by which a state is moved at most."""


@staged
def stored_energies(
    on: Evaluator, motion: "Mechanism", q: Vector, r: Vector, heats: Vector, out: Annotated[Vector, 3]
) -> Integer:
    """Write kinetic energy, all other energy that is not heat, and the sum of its terms' sizes in J to out (3,).

    Returns
    -------
    Integer
        A status.
    """
    own, w, status = motion.tables.own[0], motion.work, on.counter(0)
    on.reach(own.energy, *motion.swept, q, r, w.momenta, w.spin, out)

    def strained() -> None:
        status.value = strain(on, motion.tables, w, q, out)
        on.when(on.both(own.attached > 0, on.same(status.value, 0)), attached)

    def attached() -> None:
        entropies(on, motion.tables, w, heats)
        status.value = attached_energy(on, motion.tables, w, out)

    on.when(own.forced > 0, strained)
    return status.value


def turn(on: Evaluator, motion: "Mechanism", q: Vector, r: Vector, target: Vector) -> None:
    """Change the rates by rigid motions of islands, so that they have the momenta of ``target``."""
    e, w = motion.tables, motion.work
    on.reach(e.own[0].rigid, *motion.swept, q, r, e.island, e.bases, target, w.sums, w.found, w.torque)


def measure(on: Evaluator, motion: "Mechanism", q: Vector, r: Vector) -> None:
    """Write the momenta of islands to ``kept``."""
    w = motion.work
    copy(on, r, w.direction)
    turn(on, motion, q, w.direction, w.released)
    copy(on, w.found, w.kept)


@staged
def correct(
    on: Evaluator,
    motion: "Mechanism",
    account: RunAccount,
    work: Real,
    heat: Real,
    h: Real,
    before: Vector,
    q: Vector,
    r: Vector,
    stored: Vector,
    heats: Vector,
    allowed: Vector,
    always: bool,
) -> Integer:
    """Move the end (q, r) of a step of h seconds to the energy that work and heat in J leave to it; return a status.

    How much energy that takes, what it leaves and how far it goes, relative to what is allowed, go to the account.

    Parameters
    ----------
    before, stored
        Rates, and heats with attached states, at the start of the step.
    allowed
        (2 degrees of freedom + heats,) of increments, rates and heats: what their errors may be. A state is moved
        further where steps are on a grid, else what is farther is left to the steps that follow.
    always
        Whether what is only rounding is met, too: for the sake of its derivatives.
    """
    target = account.anchor + (work - heat)
    account.noise = rounding(on, account.anchor, work, heat)
    run = Correction(
        on, account, target, on.scratch(3), on.counter(0), always, motion, h, before, q, r, stored, heats, allowed
    )  # fmt: skip
    account.moved, account.size, account.rest = 0.0, 0.0, 0.0
    turned = on.variable(0.0)

    def correct_energy() -> None:
        short = run.short
        turn(on, motion, q, r, motion.work.kept)
        run.look(heats)
        turned.value = short - run.short

    def keep() -> None:
        run.look(heats)
        account.noise = account.noise + ROUNDING * (run.energies[0] + run.energies[2])
        on.when(on.both(run.known, run.floating), correct_energy)
        on.when(run.known if always else on.negate(run.close), run.move)
        left = on.both(run.known if always else on.negate(run.close), motion.tables.own[0].attached > 0)
        on.when(on.both(left, on.same(run.status.value, 0)), lambda: store_attached(run))
        account.rest, account.moved = run.short, account.moved + turned.value

    on.when(on.absolute(account.anchor) < BEYOND, keep)
    return run.status.value


@final
@dataclass(frozen=True, slots=True)
class Correction(Missing):
    """One correction; ``energies`` are what `held` writes."""

    motion: "Mechanism"
    h: Real
    before: Vector
    q: Vector
    r: Vector
    start: Vector
    heats: Vector
    allowed: Vector

    def look(self, states: Vector) -> None:
        self.status.value = stored_energies(self.on, self.motion, self.q, self.r, states, self.energies)

    @property
    def floating(self) -> Truth:
        """Whether there are momenta to be kept."""
        return self.motion.tables.own[0].islands > 0

    def move(self) -> None:
        """Move the rates along their free part; positions too where those are small."""
        on, w, n = self.on, self.motion.work, self.r.size
        self._free()
        twice = on.variable(2.0 * self.energies[0])
        on.when(self.motion.tables.own[0].driven > 0, lambda: self._weigh(w.direction, twice))
        on.when(self.floating, lambda: self._weigh_inner(twice))
        share = self._share(twice.value)
        size = on.absolute(stretch(on, share)) * self._size(w.direction, n)

        def far() -> None:
            change = on.variable(0.0)

            def changed(j: Integer) -> None:
                w.descent[j] = self.r[j] - self.before[j]

            on.loop(n, changed)
            self._weigh(w.descent, change)
            still = on.both(self._alone, on.negate(self.floating))
            small = on.negate(on.either(twice.value >= change.value, still))
            on.when(small, lambda: self._everything(twice.value), lambda: self._rates(twice.value, size))

        within = on.both(size <= 1.0, share >= -FARTHEST)
        on.when(within, lambda: self._rates(twice.value, size), far)

    @property
    def _alone(self) -> Truth:
        """Whether no potential moves positions: what is attached pushes at rest, too."""
        on = self.on
        return on.either(self.motion.tables.own[0].attached > 0, on.same(self.account.alone, 1))

    def _weigh_inner(self, out: Variable[Real]) -> None:
        """Twice the kinetic energy of the direction; none where that is what rounding leaves of rigid motions."""
        self._weigh(self.motion.work.direction, out)
        out.value = self.on.select(out.value > RIGID * self.energies[0], out.value, 0.0)

    def _share(self, twice: Real) -> Real:
        """Missing energy relative to half of that which is stretched: beyond all numbers where that is nothing."""
        on = self.on
        return on.select(twice > 0.0, 2.0 * self.short / on.select(twice > 0.0, twice, 1.0), -1.0)

    def _size(self, move: Vector, at: Integer) -> Real:
        """Root mean square of a move relative to what is allowed."""
        on, total = self.on, self.on.variable(0.0)

        def each_entry(j: Integer) -> None:
            x = move[j] / self.allowed[at + j]
            total.value = total.value + x * x

        on.loop(move.size, each_entry)
        return on.sqrt(total.value / on.real(on.select(move.size > 1, move.size, 1)))

    def _weigh(self, rates: Vector, out: Variable[Real]) -> None:
        """Twice the kinetic energy that rates would have."""
        on, motion, w, found = self.on, self.motion, self.motion.work, self.on.scratch(3)
        on.reach(motion.tables.own[0].energy, *motion.swept, self.q, rates, w.momenta, w.spin, found)
        out.value = 2.0 * found[0]

    def _free(self) -> None:
        """Write the free part of the rates: less the least ones that do as is prescribed, and less rigid motions."""
        on, w = self.on, self.motion.work

        def released() -> None:
            calm = replace(self.motion, tables=replace(self.motion.tables, gravity=on.scratch(3)))
            calm.outward(on, self.q, w.zero, w.zero)
            self.status.value = calm.fold(on, w.spin, w.momenta)
            calm.unfold(on, w.direction)

        def loose() -> None:
            for _ in range(2):  # once more, for what rounding left of momenta
                turn(on, self.motion, self.q, w.direction, w.released)

        on.when(self.motion.tables.own[0].driven > 0, released, lambda: copy(on, self.r, w.direction))
        on.when(self.floating, loose)

    def _rates(self, twice: Real, size: Real) -> None:
        """Move the rates, no further than chosen steps may."""
        on, w, account = self.on, self.motion.work, self.account
        share = self._share(twice)
        near = on.absolute(share) <= FARTHEST
        share = on.select(near, share, 0.0)
        chosen = on.both(on.same(account.chosen, 1), size > MOST)
        alpha = stretch(on, share) * on.select(chosen, MOST / on.select(chosen, size, 1.0), 1.0)

        def each_entry(j: Integer) -> None:
            self.r[j] = self.r[j] + alpha * w.direction[j]

        on.loop(self.r.size, each_entry)
        moved = twice * alpha * (1.0 + 0.5 * alpha)
        mended = on.either(near, self.motion.tables.own[0].attached > 0)
        account.moved, account.size = moved, on.select(mended, size, size / WORTH)
        self.energies[0] = self.energies[0] + moved

    def _everything(self, twice: Real) -> None:
        """Move rates and positions, until no more than rounding is missing."""
        on, w = self.on, self.motion.work
        self._descend()
        slope, first = on.variable(0.0), on.variable(self.short)
        self._weigh(w.descent, slope)
        whole = on.variable(twice + self.h * self.h * slope.value)
        rounds, gone, ended = on.counter(0), on.variable(0.0), on.counter(0)

        def once() -> Truth:
            short, part = self.short, self.short / whole.value
            gone.value = gone.value + part
            self._shift(part)
            # turning about rates that are not small bends the energy: by how much it grew says the slope
            grown = short - self.short
            likely = on.either(
                on.both(grown > 0.25 * short, grown < 4.0 * short), on.both(grown < 0.25 * short, grown > 4.0 * short)
            )
            learns = on.both(self.floating, likely)

            def learn() -> None:
                whole.value = whole.value * (grown / short)

            def back() -> None:
                gone.value, ended.value = gone.value - part, 1
                self._shift(-part)

            worse = on.negate(on.absolute(self.short) <= on.absolute(short))
            on.when(learns, learn, lambda: on.when(worse, back))
            rounds.value = rounds.value + 1
            unsound = on.negate(on.same(self.status.value, 0))
            over = on.either(on.same(ended.value, 1), rounds.value >= ROUNDS)
            return on.either(on.either(unsound, self.close), over)

        def size(far: Real) -> Real:
            here = far * self._size(w.direction, self.r.size)
            there = far * self.h * self.h * self._size(w.descent, 0)
            return on.sqrt(0.5 * (here * here + there * there))

        def iterate_steps() -> None:
            on.repeat(once)
            far = size(on.absolute(gone.value))
            self.account.size = on.select(self.close, far, on.maximum(far, REFUSED) / WORTH)
            self.account.moved = first.value - self.short

        def stay() -> None:
            share = 2.0 * on.absolute(self.short) / on.maximum(whole.value, TINY)
            self.account.size = size(stretch(on, share)) / WORTH

        within = on.both(whole.value > 0.0, on.absolute(self.short) <= FARTHEST * whole.value)
        on.when(on.same(self.status.value, 0), lambda: on.when(within, iterate_steps, stay))

    def _descend(self) -> None:
        """Write the accelerations from rest by weight and springs, and those of islands that turn by themselves."""
        on, motion, w = self.on, self.motion, self.motion.work

        def fall() -> None:
            bodies = Table(PushedBody, motion.tables.body.integers, motion.tables.body.reals, 0)
            alone = replace(motion.tables, drive=w.still, body=bodies, lead=w.zero)
            ns, idle = motion.tables.node.size, w.idle
            s_rate, made = idle.part(0, ns), idle.part(ns + TOTALS, idle.size - (ns + TOTALS))
            calm = replace(motion, tables=alone)
            self.status.value = calm.accelerate(on, self.q, w.zero, w.descent, s_rate, made, idle.part(ns, TOTALS))

        def spin() -> None:
            turn(on, motion, self.q, self.r, w.kept)
            clear(on, w.alter)
            turn(on, motion, self.q, w.alter, w.torque)

            def each_entry(j: Integer) -> None:
                w.descent[j] = w.descent[j] + w.alter[j]

            on.loop(self.r.size, each_entry)

        on.when(self._alone, lambda: clear(on, w.descent), fall)
        on.when(self.floating, spin)

    def _shift(self, part: Real) -> None:
        """Move rates and positions by a part of their directions, and look at the energy there."""
        on, motion, w = self.on, self.motion, self.motion.work

        def each_entry(j: Integer) -> None:
            w.alter[j] = -(part * self.h * self.h) * w.descent[j]
            self.r[j] = self.r[j] + part * w.direction[j]

        on.loop(self.r.size, each_entry)
        motion.displace(on, w.alter, self.q)
        if motion.closes:
            self.status.value = motion.shut(on, self.q, self.r)
        on.when(self.floating, lambda: turn(on, motion, self.q, self.r, w.kept))
        on.when(on.same(self.status.value, 0), lambda: self.look(self.heats))
