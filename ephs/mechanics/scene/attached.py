"""Attachments of a scene's mechanism: motors, gears, cylinders, gas springs, actuators."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.scene.element import NON_NEGATIVE, POSITIVE, Element, Number

__all__ = [
    "ATTACHED",
    "Actuator",
    "Attachment",
    "Cylinder",
    "GasSpring",
    "Gear",
    "Motor",
]

Array = NDArray[np.float64]


class Attachment(Element):
    """Attachments to joints with one degree of freedom each."""

    __slots__ = ()
    names: ClassVar[Mapping[str, str]] = {"joint": "joint", "heat": "node"}
    heat: str

    @property
    @abstractmethod
    def warms(self) -> bool:
        """Whether it makes heat."""

    @property
    def tied(self) -> tuple[str, ...]:
        """Its joints."""
        return self.named("joint")

    @property
    def commanded(self) -> bool:
        """Whether it is an input of runs."""
        return isinstance(self, Motor | Cylinder | Actuator)

    @abstractmethod
    def __str__(self) -> str:
        """In a few words."""


@final
@dataclass(frozen=True, slots=True)
class Motor(Attachment):
    """A direct-current motor on a joint with one degree of freedom.

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

    # Currents do not depend on the unit of time.
    numbers: ClassVar[Mapping[str, Number]] = {
        "constant": Number(energy=1, time=1),
        "resistance": Number(energy=1, time=1, least=POSITIVE),
        "inductance": Number(energy=1, time=2, least=NON_NEGATIVE),
        "gear": Number(first=-1),
        "inertia": Number(energy=1, time=2, least=NON_NEGATIVE),
        "voltage": Number(energy=1),
    }
    name: str
    joint: str
    constant: float
    resistance: float
    inductance: float
    gear: float
    inertia: float
    voltage: float
    heat: str

    @property
    def warms(self) -> bool:
        return True

    def __str__(self) -> str:
        return f"on {self.joint}, {self.resistance:g} Ω, gear {self.gear:g}"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Gear(Attachment):
    """A relation of the rates of joints: that of the first is Σ ratio · rate of the others.

    Attributes
    ----------
    ratio
        A number for each joint but the first.
    stiffness, damping
        Of a belt or a tendon that stretches, N m/rad and N m s/rad, or N/m and N s/m, of the first joint; a rigid gear
        has none.
    friction
        On the first joint's rate.
    stretch
        Of the belt at the start, rad or m of the first joint.
    """

    names: ClassVar[Mapping[str, str]] = {"joints": "joint", "heat": "node"}
    numbers: ClassVar[Mapping[str, Number]] = {
        "ratio": Number(first=1, others=-1, each=1),
        "stiffness": Number(energy=1, first=-2, least=NON_NEGATIVE),
        "damping": Number(energy=1, time=1, first=-2, least=NON_NEGATIVE),
        "friction": Number(energy=1, time=1, first=-2, least=NON_NEGATIVE),
        "stretch": Number(first=1),
    }
    name: str
    joints: tuple[str, ...]
    ratio: Array
    stiffness: float
    damping: float
    friction: float
    heat: str
    stretch: float = 0.0

    @property
    def warms(self) -> bool:
        return bool(self.friction or (self.stiffness and self.damping))

    def __str__(self) -> str:
        return f"{' – '.join(self.joints)}, {', '.join(f'{x:g}' for x in self.ratio)}"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Cylinder(Attachment):
    """A hydraulic cylinder on a joint that slides, or a hydraulic motor on one that turns.

    Attributes
    ----------
    area
        (2,) volume of chambers a and b by the coordinate, m³/m or m³/rad; a pushes towards larger coordinates.
    volume
        (2,) oil in each, m³.
    bulk
        Its bulk modulus, Pa.
    conductance, leak
        Of the line to each chamber, and across the piston, m³/(s Pa).
    pressure
        (2,) of the supplies of a and b above the environment's, Pa, where no input is given; the chambers start there.
    """

    numbers: ClassVar[Mapping[str, Number]] = {
        "area": Number(length=3, first=-1, count=2),
        "volume": Number(length=3, count=2, least=POSITIVE),
        "bulk": Number(energy=1, length=-3, least=POSITIVE),
        "conductance": Number(energy=-1, time=-1, length=6, least=POSITIVE),
        "leak": Number(energy=-1, time=-1, length=6, least=NON_NEGATIVE),
        "pressure": Number(energy=1, length=-3, count=2),
    }
    name: str
    joint: str
    area: Array
    volume: Array
    bulk: float
    conductance: float
    leak: float
    pressure: Array
    heat: str

    @property
    def warms(self) -> bool:
        return True

    def __str__(self) -> str:
        return f"on {self.joint}, {' and '.join(f'{x:g}' for x in self.area)} m²"


@final
@dataclass(frozen=True, slots=True)
class GasSpring(Attachment):
    """An ideal gas behind a piston on a joint, the environment's pressure before it.

    Attributes
    ----------
    area
        Volume of the gas by the coordinate, m³/m or m³/rad; negative where it shrinks towards larger coordinates.
    volume, pressure, temperature
        Of the gas at the start: m³, Pa (absolute), K.
    gamma
        Its ratio of specific heats.
    conductance
        From the gas to ``heat``, W/K.
    """

    numbers: ClassVar[Mapping[str, Number]] = {
        "area": Number(length=3, first=-1),
        "volume": Number(length=3, least=POSITIVE),
        "pressure": Number(energy=1, length=-3, least=POSITIVE),
        "temperature": Number(least=POSITIVE),
        "gamma": Number(least=(1.0, True)),
        "conductance": Number(energy=1, time=-1, least=NON_NEGATIVE),
    }
    name: str
    joint: str
    area: float
    volume: float
    pressure: float
    temperature: float
    gamma: float
    conductance: float
    heat: str

    @property
    def warms(self) -> bool:
        return bool(self.conductance)

    def __str__(self) -> str:
        return f"on {self.joint}, {self.volume:g} m³ at {self.pressure:g} Pa"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Actuator(Attachment):
    """A control as forces on joints, or on the length of a tendon: an input by name, for motors without dynamics.

    Attributes
    ----------
    ratio
        Force on each joint, or on the length, by the control, N m or N.
    limits
        (2,) least and largest control; None for none.
    """

    names: ClassVar[Mapping[str, str]] = {"joints": "joint", "tendon": "tendon", "heat": "node"}
    numbers: ClassVar[Mapping[str, Number]] = {
        "ratio": Number(energy=1, others=-1, each=0),
        "limits": Number(count=2),
    }
    name: str
    joints: tuple[str, ...]
    ratio: Array
    limits: Array | None
    heat: str = "environment"
    tendon: str | None = None

    @property
    def warms(self) -> bool:
        return False

    def __str__(self) -> str:
        return f"{self.tendon or ' – '.join(self.joints)}, {', '.join(f'{x:g}' for x in self.ratio)}"


ATTACHED: Mapping[str, type[Attachment]] = {
    "motors": Motor,
    "gears": Gear,
    "cylinders": Cylinder,
    "gas_springs": GasSpring,
    "actuators": Actuator,
}
"""Kinds of attachments, by their sections of scene files."""
