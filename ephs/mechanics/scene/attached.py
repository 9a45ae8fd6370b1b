"""Attachments of a scene's mechanism: motors, gears, stores of heat, conduction."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

__all__ = ["Conduction", "Gear", "Motor", "ThermalNode"]


@final
@dataclass(frozen=True, slots=True)
class Motor:
    """A direct-current motor on a joint with one freedom.

    Attributes
    ----------
    constant
        N m/A, which is V s/rad.
    resistance, inductance
        Of the winding in Ω and H.
    gear
        Rate of the rotor by the joint's, rad/rad or rad/m.
    inertia
        Of the rotor in kg m².
    voltage
        V, where no input is given.
    """

    name: str
    joint: str
    constant: float
    resistance: float
    inductance: float
    gear: float
    inertia: float
    voltage: float
    heat: str


@final
@dataclass(frozen=True, slots=True, eq=False)
class Gear:
    """A relation of the rates of joints: that of the first is Σ ratio · rate of the others.

    Attributes
    ----------
    ratio
        A number for each joint but the first.
    stiffness, damping
        Of a belt that stretches, N m/rad and N m s/rad, or N/m and N s/m, of the first joint; a rigid gear has none.
    friction
        On the first joint's rate.
    """

    name: str
    joints: tuple[str, ...]
    ratio: NDArray[np.float64]
    stiffness: float
    damping: float
    friction: float
    heat: str

    @property
    def warms(self) -> bool:
        """Whether it makes heat."""
        return bool(self.friction or (self.stiffness and self.damping))


@final
@dataclass(frozen=True, slots=True)
class ThermalNode:
    """A body of uniform temperature: capacity in J/K, initial temperature in K."""

    name: str
    capacity: float
    temperature: float


@final
@dataclass(frozen=True, slots=True)
class Conduction:
    """Heat conduction between two thermal nodes, or one and the environment; conductance in W/K."""

    name: str
    between: tuple[str, str]
    conductance: float
