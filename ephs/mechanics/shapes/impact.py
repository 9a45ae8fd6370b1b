"""Law of hard contact: impenetrable surfaces and stops, restitution by Moreau, friction by Coulomb."""

from dataclasses import dataclass, fields
from typing import final

import numpy as np

from ephs.mechanics.shapes.gap import Gap
from ephs.semantics.bundles.errors import StructureError

STUCK = 1e-9
"""Slip velocity in m/s of contacts that stick, to rounding."""


@final
@dataclass(frozen=True, slots=True)
class Impact:
    """Law of a hard contact.

    Parameters
    ----------
    restitution
        e of the normal velocity, 0 to 1.
    friction
        Coefficient μ; set-valued, so that contacts stick exactly.
    tangential
        Coefficient of restitution of the slip, 0 to 1. With that of the normal, which it is where it is left out, no
        impact gains energy; with another one impacts that would are refused.
    """

    restitution: float = 0.0
    friction: float = 0.0
    tangential: float | None = None

    def __post_init__(self) -> None:
        for key, most in (("restitution", 1.0), ("friction", np.inf), ("tangential", 1.0)):
            value = getattr(self, key)
            if value is not None and not (0.0 <= value <= most and value < np.inf):
                expected = "a number from 0 to 1" if most == 1.0 else "a number ≥ 0"
                raise StructureError("parameter", "hard contact", key=key, found=value, expected=expected)

    @property
    def slip_restitution(self) -> float:
        """Coefficient of restitution of the slip."""
        return self.restitution if self.tangential is None else self.tangential

    @property
    def slip(self) -> float:
        """Slip velocity in m/s below which it sticks."""
        return STUCK

    @property
    def numbers(self) -> tuple[tuple[str, float], ...]:
        """Its numbers by name."""
        given = {each.name: getattr(self, each.name) for each in fields(self)} | {"tangential": self.slip_restitution}
        return tuple((name, float(value)) for name, value in given.items())

    def rescaled(self, length: float, mass: float, time: float) -> "Impact":
        """The same law in other units."""
        return self


@final
@dataclass(frozen=True, slots=True)
class Meeting:
    """Point of a hard contact: steps give it the impulses that its process has instead of a rate.

    Parameters
    ----------
    gap
        Of the relative pose of its two frames.
    """

    gap: Gap
    law: Impact


@final
@dataclass(frozen=True, slots=True)
class Halt:
    """Hard stops of a joint with one degree of freedom: steps give them impulses, beside the friction of the joint.

    Parameters
    ----------
    stops
        (side, bound) of each: the gap is side·(coordinate − bound).
    """

    stops: tuple[tuple[float, float], ...]
    law: Impact
