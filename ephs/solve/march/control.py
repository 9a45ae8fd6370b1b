"""Step lengths: acceptance, the next step, and detection of a limit by stability.

Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.2.
"""

from ephs.semantics.stage import Evaluator, Integer, Real, Truth
from ephs.solve.control import SLIVER, UNFELT
from ephs.solve.march.records import Control

PATIENCE = 15
"""Steps without solution, one after the other, before a stiff method is called for."""
HELD = 40
"""Steps at the limit of stability before that: they cost a fraction of the set-up of implicit steps."""


def _power(on: Evaluator, x: Real, exponent: Real) -> Real:
    """x^exponent of x > 0."""
    return on.exp(exponent * on.log(x))


def length(on: Evaluator, control: Control, rest: Real) -> Real:
    """Return the length of the next try, with ``rest`` remaining: on the grid, or without a tiny last step."""
    h, grid = control.step, control.grid
    free = on.select(rest <= 1.0000001 * h, rest, 0.5 * rest)
    free = on.select(rest > 1.01 * h, h, free)
    fixed = on.minimum(grid * (on.real(control.steps) + 1.0) - control.time, rest)
    fixed = on.select(rest - fixed <= SLIVER * grid, rest, fixed)
    return on.select(grid > 0.0, fixed, free)


def judge(on: Evaluator, control: Control, h: Real, error: Real) -> Integer:
    """Return 1 where a step is accepted, else 0; write the length of the next one, or of the next try, to `step`."""
    part = _power(on, control.span / h, control.share)
    exponent = control.exponent - control.share
    strict = error * on.minimum(part, control.strict)
    good = strict <= 1.0

    def reject() -> None:
        control.failed = 1
        shorter = on.maximum(0.2, 0.9 * _power(on, strict, -1.0 / exponent))
        shorter = on.select(strict < 1e300, shorter, 0.1)
        control.step = on.minimum(h * shorter, control.most_step)

    def accept() -> None:
        shared, damping = error * part, control.damping
        factor = 0.9 * _power(on, on.maximum(shared, UNFELT), -(1.0 - 0.75 * damping) / exponent)
        factor = factor * _power(on, control.before, damping / exponent)
        control.before = on.maximum(shared, 1e-4)
        most = on.select(control.failed > 0, 1.0, 6.0)
        control.failed = 0
        wanted = h * on.minimum(most, on.maximum(0.3, factor))
        # A step shortened to the end is no evidence about longer ones.
        whole = on.either(h >= control.step, wanted < control.step)
        following = on.maximum(on.minimum(wanted, control.most_step), on.minimum(control.least_step, h))
        control.step = on.select(whole, following, control.step)

    on.when(good, accept, reject)
    return on.select(good, 1, 0)


def held_back(on: Evaluator, control: Control) -> Truth:
    """Tell whether stability, whose limit is `limit`, has held back enough steps."""
    over = control.stiff > control.limit
    held = on.select(over, control.held + 1, control.held)
    free = on.select(over, 0, control.free + 1)
    control.held = on.select(on.both(on.negate(over), free >= 6), 0, held)
    control.free = free
    return on.both(over, held >= HELD)
