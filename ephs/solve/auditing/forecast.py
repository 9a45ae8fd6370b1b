"""Forecast of the work of a run whose steps are chosen: after its first steps, by counts of steps and iterations.

Methods of order 2 need ten times the steps for a hundredth of the error. At a small tolerance a run by `natural` takes
minutes where an explicit method of order 8 takes a tenth of a second; that is told before the minutes have passed.
"""

import math
import warnings
from collections.abc import Callable, Mapping
from typing import Any, final

from ephs.semantics.spaces.rank import TINY
from ephs.solve.auditing.findings import CostWarning
from ephs.solve.running.snapshot import Resumable

FIRST = 32
"""Number of steps before the first forecast, which uses the later half; doubled for each further forecast."""
MANY = 20_000
"""Iterations of Newton's method above which a run counts as long: some ten seconds for five bodies on one core."""

STEADY = 1.2
"""Growth of a quarter of the steps over the one before up to which they count as steady."""
FASTER = ("rk87", "radau")
"""Methods of high order, the one that is faster on most problems first."""
LOW = 4
"""Largest order for which another method is better at small tolerances."""


@final
class Forecast(Resumable):
    """Watches the steps of one run by an implicit method of a low order; others are as fast as there are.

    Parameters
    ----------
    name, order
        Of the method.
    until
        End of the run in its unit of time.
    serves
        Whether a method by its name is another one, and accepts the problem.

    Attributes
    ----------
    long
        What was forecast of a long run: steps, iterations, and after how many steps; empty of others.
    """

    changing = "long", "_next", "_from", "_middle"

    def __init__(self, name: str, order: int, until: float, serves: Callable[[str], bool]) -> None:
        self.long: dict[str, int] = {}
        self._name, self._until, self._next = name, until, FIRST if order <= LOW else 0
        self._from = self._middle = 0.0
        self._serves = serves

    def look(self, steps: int, t: float, counts: Callable[[], Mapping[str, Any]]) -> None:
        """After a step: so many were taken up to t in s.

        Warns
        -----
        CostWarning
            It will be a long run. This is said once.
        """
        if 2 * steps == self._next:
            self._from = t
        if 4 * steps == 3 * self._next:
            self._middle = t
        if steps != self._next or self.long:
            return
        rest = _steps(abs(self._until - t), abs(self._middle - self._from), abs(t - self._middle), steps // 4)
        iterations = int(counts().get("iterations", 0) * (1.0 + rest / steps))
        self._next, self._from = 2 * self._next, t
        if iterations >= MANY:
            self.long = {"steps": int(steps + rest), "iterations": iterations, "after": steps}
            told = f"about {_round(steps + rest)} steps and {_round(iterations)} iterations at these tolerances"
            better = next(filter(self._serves, FASTER), None)
            advice = f"{better} reaches the same error in a part of that, " if better is not None else ""
            advice += "a constant step keeps the balances as well"
            warnings.warn(f"{self._name} will take {told}; {advice}", CostWarning, stacklevel=2)

    def stats(self) -> dict[str, Any]:
        """Statistics of a run with a forecast of a long duration."""
        return {"forecast": self.long} if self.long else {}


def _steps(rest: float, before: float, last: float, steps: int) -> float:
    """Number of steps of the rest of a run, whose last steps covered ``last`` s and as many before them ``before`` s.

    After a transient steps grow, and are taken to go on to do so.
    """
    linear = rest / max(before + last, TINY) * 2.0 * steps
    growth = last / max(before, TINY)
    if growth <= STEADY:
        return linear
    return min(linear, steps * math.log1p(rest * (growth - 1.0) / (growth * last)) / math.log(growth))


def _round(number: float) -> str:
    """A count to two digits."""
    digits = max(len(str(int(number))) - 2, 0)
    return f"{int(round(number / 10**digits) * 10**digits):,}".replace(",", " ")
