"""Constitutive law of a contact."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, final

import numpy as np

from ephs.mechanics.shapes.gap import ramp
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.derive.functions import TINY


@final
@dataclass(frozen=True, slots=True)
class ConstitutiveLaw:
    """Constitutive law of a contact.

    Parameters
    ----------
    stiffness, exponent
        k in N/mⁿ and n ≥ 1 of the elastic force k dⁿ at overlap d; n = 1.5 is Hertz's.
    loss
        α of Hunt and Crossley, s/m.
    friction, slip
        Coefficient μ, and the slip velocity in m/s below which friction is viscous.
    rolling, spinning
        Arms in m of the moments that resist rolling and spinning, per normal force.
    """

    stiffness: float
    exponent: float = 1.0
    loss: float = 0.0
    friction: float = 0.0
    slip: float = 1e-3
    rolling: float = 0.0
    spinning: float = 0.0

    def __post_init__(self) -> None:
        bounds: Mapping[str, tuple[float, str]] = {
            "stiffness": (0.0, "a number > 0"), "exponent": (1.0, "a number ≥ 1"), "loss": (0.0, "a number ≥ 0"),
            "friction": (0.0, "a number ≥ 0"), "slip": (0.0, "a number > 0"), "rolling": (0.0, "a number ≥ 0"),
            "spinning": (0.0, "a number ≥ 0"),
        }  # fmt: skip
        for key, (least, expected) in bounds.items():
            value = getattr(self, key)
            if not least <= value < np.inf or (value == least and ">" in expected):
                raise StructureError("parameter", "contact", key=key, found=value, expected=expected)

    def force(self, overlap: Any) -> Any:
        """Elastic force in N at an overlap in m."""
        return self.stiffness * overlap * (overlap + TINY) ** (self.exponent - 1.0)

    def energy(self, overlap: Any) -> Any:
        """Elastic energy in J of an overlap in m."""
        n = self.exponent
        return self.stiffness / (n + 1.0) * overlap * overlap * (overlap + TINY) ** (n - 1.0)

    def normal(self, overlap: Any, opening: Any) -> tuple[Any, Any]:
        """Normal force N = φ′ − d ġ ≥ 0 at an overlap in m and a rate ġ of the gap in m/s, and d in N s/m."""
        elastic, loss = self.force(overlap), 1.5 * self.loss
        rate = loss * opening
        return elastic * ramp(1.0 - rate), loss * elastic / (1.0 + ramp(rate - 1.0))

    @property
    def numbers(self) -> tuple[tuple[str, float], ...]:
        """Its numbers by name."""
        return tuple((each.name, float(getattr(self, each.name))) for each in fields(self))

    def rescaled(self, length: float, mass: float, time: float) -> "ConstitutiveLaw":
        """The same law in numbers of other units: lengths are multiplied by ``length``, and so on."""
        energy = mass * length**2 / time**2
        return ConstitutiveLaw(
            stiffness=self.stiffness * energy / length ** (self.exponent + 1.0),
            exponent=self.exponent,
            loss=self.loss * time / length,
            friction=self.friction,
            slip=self.slip * length / time,
            rolling=self.rolling * length,
            spinning=self.spinning * length,
        )
