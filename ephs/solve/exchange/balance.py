"""Energy produced by a sampled power port, and its return.

Over a period the system moves under what it is given, g, while the unit moves under what it takes, u; each returns the
other factor of power, whose integrals over the period are X for the system and Y for the unit. Power into both is
positive, so the interface makes g X + u Y. In plain exchange g and u are the last samples. In balance

- the unit goes second and takes the mean X/h that the system had, so that nothing would be made if g were Y/h;
- g is predicted to be this mean, and gives back what was made so far, D: of a next X that is predicted by X', it adds
  -D X'/(X'² + δ²), where δ, a part of the largest X of the run, bounds it where X' goes through zero.

Where predictions are right, D falls by the factor δ²/(X'² + δ²) in a period, and each period adds what g was wrong by,
(g - Y/h) X, of third order in the period. After Sadjina, Kyllingstad, Skjong, Pedersen: Energy conservation and power
bonds in co-simulations (2017), whose corrections are of what units take.
"""

from typing import Final, final

from ephs.solve.running.snapshot import Resumable

PART: Final = 0.2
"""δ as a part of the largest X: a correction is at most D/(2δ)."""


@final
class PortBalance(Resumable):
    """Balance of one power port along a run.

    Parameters
    ----------
    taken, given
        Signs of what the unit takes and the system is given, of what the other returns; their product is -1.
    kept
        Whether the energy is given back; else plain exchange.

    Attributes
    ----------
    g
        What the system is given over the next period.
    debt
        In J, made so far less what was given back.
    """

    changing = "g", "u", "a", "y", "X", "largest", "debt"

    def __init__(self, taken: float, given: float, kept: bool) -> None:
        self._taken, self._given, self._kept = taken, given, kept
        self.g = self.u = self.a = self.y = self.X = self.largest = self.debt = 0.0

    def begin(self, a: float, y: float) -> None:
        """Start from the first outputs of the system and the unit."""
        self.a, self.y, self.X, self.largest, self.debt = a, y, 0.0, 0.0, 0.0
        self.u, self.g = self._taken * a, self._given * y

    def moved(self, h: float, a: float, X: float | None) -> tuple[float, float]:
        """Energy received by the unit over the system's last period of h seconds, and X."""
        if X is None:
            X = 0.5 * h * (self.a + a)
        self.u = self._taken * (X / h if self._kept else self.a)
        self.a = a
        return self.u, X

    def returned(self, h: float, y: float, Y: float | None, X: float) -> float:
        """Energy produced in the period, in J, after the unit's step; g belongs to the next period."""
        if Y is None:
            Y = 0.5 * h * (self.y + y)
        made = self.g * X + self.u * Y
        self.debt += made
        ahead, next_y = 2.0 * X - self.X, y
        if self._kept:
            next_y = 1.5 * y - 0.5 * self.y
        self.g = self._given * next_y
        self.largest = max(self.largest, abs(X))
        if self._kept and self.largest > 0.0:
            self.g -= self.debt * ahead / (ahead * ahead + (PART * self.largest) ** 2)
        self.y, self.X = y, X
        return made
