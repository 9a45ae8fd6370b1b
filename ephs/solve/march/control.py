"""Step lengths: acceptance, the next step, and detection of a limit by stability.

Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.2.
"""

from typing import Any, Protocol, TypeAlias, final

from ephs.semantics.stage import PLAIN, Evaluator, Integer, Real, Truth
from ephs.solve.march.iteration import BEYOND
from ephs.solve.march.records import MarchControl
from ephs.solve.running.control import SLIVER, Symmetric
from ephs.solve.running.snapshot import Snapshot

DAMPING, STRICT, NEAR = 0.4, 30.0, 0.93
"""How much the last error counts; the most by which a step's part of the tolerance makes its acceptance stricter; what
a step that is kept may shrink to."""
UNFELT = 1e-10
"""Error in tolerances below which the next step is the longest allowed."""

PATIENCE = 15
"""Steps without solution, one after the other, before a stiff method is called for."""
HELD = 40
"""Steps at the limit of stability before that: they cost a fraction of the set-up of implicit steps."""


def _power(on: Evaluator, x: Real, exponent: Real) -> Real:
    """x^exponent of x > 0."""
    return on.exp(exponent * on.log(x))


def length(on: Evaluator, control: MarchControl, rest: Real) -> Real:
    """Return the length of the next try, with ``rest`` remaining: on the grid, or without a tiny last step."""
    h, grid = control.step, control.grid
    free = on.select(rest <= 1.0000001 * h, rest, 0.5 * rest)
    free = on.select(rest > 1.01 * h, h, free)
    fixed = on.minimum(grid * (on.real(control.steps) + 1.0) - control.time, rest)
    fixed = on.select(rest - fixed <= SLIVER * grid, rest, fixed)
    return on.select(grid > 0.0, fixed, free)


def judge(on: Evaluator, control: MarchControl, h: Real, error: Real, hold: float = 1.0) -> Integer:
    """Return 1 where a step is accepted, else 0; write the length of the next one, or of the next try, to `step`.

    With ``hold`` above 1 a step that may grow by less than this factor stays as it is, since its matrices are
    factorised; else its own error alone counts.
    """
    part = _power(on, control.span / h, control.share)
    exponent = control.exponent - control.share
    strict = error * on.minimum(part, control.strict)
    good = strict <= 1.0

    def reject() -> None:
        control.failed = 1
        shorter = on.maximum(0.2, 0.9 * _power(on, strict, -1.0 / exponent))
        shorter = on.select(strict < BEYOND, shorter, 0.1)
        control.step = on.minimum(h * shorter, control.most_step)

    def accept() -> None:
        shared, damping = error * part, control.damping
        factor = 0.9 * _power(on, on.maximum(shared, UNFELT), -(1.0 - 0.75 * damping) / exponent)
        factor = factor * _power(on, control.before, damping / exponent)
        if hold > 1.0:
            alone = 0.9 * _power(on, on.maximum(shared, UNFELT), -1.0 / exponent)
            factor = on.select(on.both(alone >= NEAR, alone < hold), 1.0, alone)
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


def held_back(on: Evaluator, control: MarchControl) -> Truth:
    """Tell whether stability, whose limit is `limit`, has held back enough steps."""
    over = control.stiff > control.limit
    held = on.select(over, control.held + 1, control.held)
    free = on.select(over, 0, control.free + 1)
    control.held = on.select(on.both(on.negate(over), free >= 6), 0, held)
    control.free = free
    return on.both(over, held >= HELD)


class Steered(Protocol):
    """Properties of a method that control its steps; they may change from step to step.

    Attributes
    ----------
    exponent
        The power of the step with which the estimate falls.
    share
        Exponent of a step's share of the tolerance by its length: a step of h in a run of T aims at (h/T)^share of it.
        With 0 errors add up over the steps, with 1 they make the tolerance together. What is accepted knows the share
        up to `STRICT` only: where rates jump, no step would be short enough.
    hold
        As of `judge`.
    """

    exponent: float
    share: float
    hold: float


@final
class Proportional:
    """Proportional-integral control: the next step by this error and the last one, see `judge`.

    Parameters
    ----------
    method
        What takes the steps.
    """

    finest = 0.0
    """Least step as a fraction of the run."""

    def __init__(self, method: Steered) -> None:
        self._method = method
        self._control: Any = MarchControl.table(1)[0]
        self._control.before, self._control.most_step = 1e-4, BEYOND
        self._control.damping, self._control.strict = DAMPING, STRICT

    def judge(self, h: float, error: float, span: float) -> tuple[bool, float]:
        """Whether a step is accepted, and the length of the next one or of the next try; span: of the whole run."""
        c, method = self._control, self._method
        c.span, c.step, c.exponent, c.share = span, h, method.exponent, method.share
        accepted = judge(PLAIN, c, h, error if error < BEYOND else BEYOND, method.hold)
        return bool(accepted), float(c.step)

    def wanted(self, h: float, error: float, span: float) -> float:
        """Length of the step whose error would equal the tolerance, without a lower limit."""
        share = self._method.share
        part = min((span / h) ** share, STRICT)
        return h * (error * part) ** (-1.0 / (self._method.exponent - share))

    def snapshot(self) -> Snapshot:
        """Memory of earlier steps."""
        return {"before": float(self._control.before), "failed": bool(self._control.failed)}

    def restore(self, snapshot: Snapshot) -> None:
        """Restore a snapshot."""
        self._control.before, self._control.failed = snapshot["before"], int(snapshot["failed"])


Policy: TypeAlias = Proportional | Symmetric
"""What chooses the steps of a run by their estimated errors relative to the tolerance."""
