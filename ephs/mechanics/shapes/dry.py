"""Constitutive law of dry friction."""

from dataclasses import dataclass, fields
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.errors import StructureError


@final
@dataclass(frozen=True, slots=True)
class Dry:
    """Dry friction of one degree of freedom: Coulomb's, with Stribeck's rise towards rest, viscous below the slip rate.

    Its force at a rate ω is (c + (a − c) exp(−(ω/s)²)) ω / √(ω² + ε²): c while it slides, up to a where it begins to.
    The joint creeps at rest: under a force f < a at a rate of about ε f/a.

    Parameters
    ----------
    coulomb
        c in N m or N.
    static
        a ≥ c, likewise; c where it is left out.
    stribeck
        s in rad/s or m/s, over which the force falls from a to c.
    slip
        ε in rad/s or m/s.
    """

    coulomb: float
    static: float | None = None
    stribeck: float = 0.01
    slip: float = 1e-3

    def __post_init__(self) -> None:
        if not 0.0 <= self.coulomb < np.inf:
            raise StructureError("parameter", "dry", key="coulomb", found=self.coulomb, expected="a number ≥ 0")
        if self.static is not None and not self.coulomb <= self.static < np.inf:
            raise StructureError("parameter", "dry", key="static", found=self.static, expected="a number ≥ coulomb")
        for key in ("stribeck", "slip"):
            value = getattr(self, key)
            if not 0.0 < value < np.inf:
                raise StructureError("parameter", "dry", key=key, found=value, expected="a number > 0")

    @property
    def start(self) -> float:
        """Breakaway force, in N m or N."""
        return self.coulomb if self.static is None else self.static

    def resistance(self, rate: Any) -> Any:
        """Force over rate in N m s or N s/m."""
        force = self.coulomb
        if self.start > self.coulomb:
            force = force + (self.start - self.coulomb) * np.exp(-((rate / self.stribeck) ** 2))
        return force / np.sqrt(rate * rate + self.slip**2)

    @property
    def numbers(self) -> tuple[tuple[str, float], ...]:
        """Its numbers by name."""
        given = {each.name: getattr(self, each.name) for each in fields(self)} | {"static": self.start}
        return tuple((name, float(value)) for name, value in given.items())

    def rescaled(self, force: float, rate: float) -> "Dry":
        """The same law in numbers of other units: forces are multiplied by ``force``, rates by ``rate``."""
        return Dry(self.coulomb * force, self.start * force, self.stribeck * rate, self.slip * rate)
