"""What a scene puts on its mechanism: motors, stores of heat, conduction."""

from dataclasses import dataclass
from typing import final

__all__ = ["Conduction", "Motor", "ThermalNode"]


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
