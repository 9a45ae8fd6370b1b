"""Attached states moved to the energy that a step leaves to them, where the motion of bodies does not take it."""

from typing import TYPE_CHECKING

from ephs.semantics.stage import Integer, Real
from ephs.solve.march.storing import Moved, store

if TYPE_CHECKING:
    from ephs.mechanics.tree.engine.balance import Correction


def store_attached(run: "Correction") -> None:
    """Move attached states along what the step changed, and what h ẋ at its end is beside that."""
    on, motion, w, nodes, size = run.on, run.motion, run.motion.work, run.motion.tables.node, run.heats.size
    along, beside, rest = w.idle.part(0, size), w.spare.part(0, size), w.spare.size - (size + 2)
    found = motion.accelerate(
        on, run.q, run.r, w.descent, beside, w.spare.part(size + 2, rest), w.spare.part(size, 2)
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
