"""Both laws in a step: heat as energy by compensated sums, and the remaining energy of the motion.

With weights b_j of the stages, heats and totals change by h Σ b_j of their rates. All other energy is then what it was,
and the work, less the heat; by how much a step misses that, its plain defect, is of the order of its error. Moving the
state by as little along the gradient of the energy keeps the order (Hairer, Lubich and Wanner, *Geometric Numerical
Integration*, IV.4). The defect says how accurate the motion is, which a corrected balance does not: it is kept.
"""

from ephs.semantics.spaces.rank import TINY
from ephs.semantics.stage import Evaluator, Real, Record, integer, real
from ephs.solve.march.iteration import BEYOND as BEYOND

ROUNDING = 16.0 * 2.220446049250313e-16
"""Fraction of the terms of energy, work and heat below which their defect is rounding and not corrected."""
MOST = 10.0
"""Largest correction of a state with chosen steps, in errors allowed by the tolerance."""
WORTH = 0.1
"""Error of a step beside the correction that it needs: steps are refused whose correction is ten times what a tolerance
allows. What cannot be corrected counts in full."""
WHOLE = 1.0
"""The same of semi-implicit steps: an estimate of low order misses surfaces that meet at a step's end."""


class RunAccount(Record):
    """Energy account of a run.

    Attributes
    ----------
    anchor
        Energy in J of what is not heat where nothing has been booked; not a number where nothing is free to move.
    left
        Energy in J that the steps so far left missing.
    put, total
        Sum in J of the energies that corrections put in, and of their sizes.
    moved, rest, size
        Of the step that was tried last: energy put in, energy missing, errors that a tolerance allows by which the
        correction moves the state.
    noise
        Rounding of what is missing in J: so much is left.
    chosen
        1 where steps are chosen, not on a grid.
    alone
        1 where rates alone are moved: positions where fast modes are not resolved would leave the energy's tangent.
    begins
        1 where the anchor is that of the state that a march starts from.
    """

    anchor = real()
    left = real()
    put = real()
    total = real()
    moved = real()
    rest = real()
    size = real()
    noise = real()
    chosen = integer()
    alone = integer()
    begins = integer()


def rounding(on: Evaluator, anchor: Real, work: Real, heat: Real) -> Real:
    """Return the rounding in J of the sum of an anchor, work and heat."""
    known = on.select(on.absolute(anchor) < BEYOND, on.absolute(anchor), 0.0)
    return ROUNDING * (known + on.absolute(work) + on.absolute(heat))


def stretch(on: Evaluator, share: Real) -> Real:
    """Return α of (1 + α)² = 1 + share, exact to rounding where that is small."""
    return share / (1.0 + on.sqrt(on.maximum(1.0 + share, 0.0)))


def worth(on: Evaluator, account: RunAccount, share: Real = WORTH) -> Real:
    """Return the error of the last tried step by a share of its correction, less the remainder of earlier ones."""
    short = account.moved + account.rest
    own = on.maximum(on.absolute(short - account.left) - account.noise, 0.0) / on.maximum(on.absolute(short), TINY)
    return on.select(account.size > 0.0, share * account.size * on.minimum(own, 1.0), 0.0)
