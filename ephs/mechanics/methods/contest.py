"""Contest of integration methods within one run: the method with the least cost per second of motion goes on.

The cost is a number of evaluations of the rates, not a time, so that results do not depend on the machine. Stability
limits an explicit method, losses do not limit a semi-implicit one, and the stiffest method has the dearest steps; the
order changes as surfaces meet and part. So each method takes some steps of the run itself. The cost per second of the
present method is measured in windows of 12 steps. Other methods are tried for a window when this cost has grown, or
when earlier tries were a small part of the cost of the run; a cheaper method stays.
"""

from collections.abc import Sequence
from typing import Final, final

import numpy as np

from ephs.semantics.spaces.rank import TINY
from ephs.solve.running.snapshot import Resumable

SETTLING: Final = 4
"""Steps, rejected ones included, in which a method finds the length of its steps, before a window."""
WINDOW: Final = 12
"""Steps whose cost per second of motion counts, rejected ones included."""
GROWN: Final = 1.5
"""Growth of the rate after which other methods are tried early."""
PART, EARLY, FIRST = 0.08, 0.25, 0.2
"""Part of the cost since a method's last try that tries may have: usually, where the rate has grown, at first."""
GAIN: Final = 0.9
"""Part of the present rate from which on another method stays."""


@final
class Contest(Resumable):
    """The methods of one run, by their numbers; the first one begins.

    Parameters
    ----------
    prices
        What a step of each method will cost, about, in evaluations.
    starts
        Cost of preparing the first steps of each, in evaluations.
    change
        What it costs to go to another method and back, besides steps.
    wakes
        Cost of the first method from which on others are tried although nothing holds its steps back.

    Attributes
    ----------
    home
        The method of the run.
    at
        The method whose steps are taken: that, or one that is tried.
    tries
        Number of tries so far.
    """

    changing = (
        "home", "at", "tries", "prices",
        "_awake", "_settling", "_spent", "_price", "_least", "_rates", "_tried", "_due",
    )  # fmt: skip

    def __init__(self, prices: Sequence[float], starts: Sequence[float], change: float, wakes: float = np.inf) -> None:
        self._change, self._wakes = change, wakes
        self.prices = [(SETTLING + WINDOW) * a + b + change for a, b in zip(prices, starts, strict=True)]
        self.home = self.at = self.tries = 0
        self._awake, self._settling = False, True
        self._spent = self._price = 0.0
        self._least, self._rates = np.inf, [np.inf] * len(self.prices)
        self._tried: list[float] = [-1.0] * len(self.prices)
        self._due: list[int] = []

    @property
    def length(self) -> int:
        """Steps of the present window, rejected ones included."""
        return SETTLING if self._settling else WINDOW

    def weigh(self, cost: float, seconds: float) -> bool:
        """Count a window of the present method; whether another one takes the steps that follow."""
        self._spent += cost
        if self._settling:
            self._settling = False
            self._price = cost
            return False
        rate = self._rates[self.at] = cost / max(seconds, TINY)
        if self.at != self.home:
            self.prices[self.at] = self._price + cost + self._change
            self._spent += self._change
            return self._next()
        early, self._least = rate > GROWN * self._least, min(rate, self._least)
        self._awake = self._awake or self._spent >= self._wakes
        return self._awake and self._call(EARLY if early else PART)

    def stiff(self) -> bool:
        """Whether others take the steps that follow, as stability holds those of the method of the run back."""
        self._awake = True
        return self.at == self.home and self._call(EARLY)

    def fail(self) -> None:
        """Leave the present method, whose steps have no solution: for the last one, if it is that of the run."""
        self._awake, self._rates[self.at] = True, np.inf
        if self.at != self.home:
            self._next()
        else:
            self.home = self.at = len(self.prices) - 1
            self._settling, self._least, self._due = True, np.inf, []

    def without(self, method: int) -> None:
        """Never try a method."""
        self.prices[method] = np.inf

    def _call(self, part: float) -> bool:
        """Try the other methods whose tries cost no more than a part of what was spent; whether there is one."""
        share = part / (len(self.prices) - 1)
        for k, price in enumerate(self.prices):
            if k != self.home:
                self._rates[k] = np.inf
                since = self._spent - self._tried[k]
                if price <= (share * since if self._tried[k] >= 0.0 else FIRST * self._spent):
                    self._due.append(k)
        return bool(self._due) and self._next()

    def _next(self) -> bool:
        """Go to the next method that is due, or to the best one; whether it is another one."""
        before = self.at
        if self._due:
            self.at = self._due.pop(0)
            self.tries += 1
            self._tried[self.at] = self._spent
        else:
            self._decide()
        self._settling = self.at != before
        return self._settling

    def _decide(self) -> None:
        """Let the method whose last window cost least be that of the run."""
        best = int(np.argmin(self._rates))
        if self._rates[best] < GAIN * self._rates[self.home] or not np.isfinite(self._rates[self.home]):
            self.home = best
        self.at, self._least = self.home, self._rates[self.home]
