"""Closing the loops of a mechanism."""

from typing import TYPE_CHECKING

from ephs.semantics.spaces.rank import CLOSED
from ephs.semantics.stage import Evaluator, Integer, Truth, Vector, staged
from ephs.solve.march.records import Status

if TYPE_CHECKING:
    from ephs.mechanics.tree.engine.motion import Mechanism

ROUNDS = 20
"""Iterations that close loops."""


@staged
def close(on: Evaluator, motion: "Mechanism", q: Vector, r: Vector) -> Integer:
    """Close the loops and put the rates on them, by the least change in the mass metric; return a status.

    The gap that is left, in m or rad, is the answer in the memory. Prescribed rates are as they should be.
    """
    before, status, rounds = on.variable(1e300), on.counter(0), on.counter(0)

    def once() -> Truth:
        status.value, gap, done = motion.newton(on, q, r, before.value)
        before.value = gap
        rounds.value = rounds.value + 1
        return on.either(done, rounds.value >= ROUNDS)

    on.repeat(once)
    opened = on.negate(before.value <= CLOSED)
    status.value = on.select(on.both(on.same(status.value, 0), opened), int(Status.OPEN), status.value)
    on.when(on.same(status.value, 0), lambda: motion.straighten(on, q, r))
    motion.work.answer[0] = before.value
    return status.value
