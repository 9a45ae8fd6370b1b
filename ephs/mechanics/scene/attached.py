"""Attachments of a scene's mechanism: motors, gears, cylinders, gas springs, actuators."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, final

from ephs.mechanics.scene.element import (
    ABOVE_ONE,
    ENVIRONMENT,
    NON_NEGATIVE,
    POSITIVE,
    Named,
    Number,
    SceneElement,
    frozen,
)
from ephs.semantics.bundle import Array


class Attachment(SceneElement):
    """Attachments to joints with one degree of freedom each."""

    __slots__ = ()
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
    """A direct-current motor on a joint with one degree of freedom."""

    # Currents do not depend on the unit of time.
    name: str
    joint: Annotated[str, Named("joint"), "the driven joint, of one degree of freedom"]
    constant: Annotated[
        float, Number(energy=1, time=1), "torque constant: torque of the rotor per current, N m/A or V s/rad"
    ]
    resistance: Annotated[float, Number(energy=1, time=1, least=POSITIVE), "resistance of the winding, Ω"]
    inductance: Annotated[float, Number(energy=1, time=2, least=NON_NEGATIVE), "inductance of the winding, H"] = 0.0
    gear: Annotated[
        float, Number(first=-1), "gear ratio: rate of the rotor per rate of the joint, rad/rad or rad/m"
    ] = 1.0
    inertia: Annotated[float, Number(energy=1, time=2, least=NON_NEGATIVE), "inertia of the rotor, kg m²"] = 0.0
    current: Annotated[float, Number(), "current at the start, with an inductance; A"] = 0.0
    voltage: Annotated[float, Number(energy=1), 'voltage without an input "motors.NAME", V'] = 0.0
    heat: Annotated[str, Named("node"), "thermal node that takes up the heat of the winding"] = ENVIRONMENT

    @property
    def warms(self) -> bool:
        return True

    def __str__(self) -> str:
        return f"on {self.joint}, {self.resistance:g} Ω, gear {self.gear:g}"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Gear(Attachment):
    """A relation of the rates of joints: that of the first is Σ ratio · rate of the others."""

    name: str
    joints: Annotated[
        tuple[str, ...],
        Named("joint"),
        "two or more joints with one degree of freedom: a gear, a belt, a differential, a mimic",
    ]
    ratio: Annotated[
        Array, Number(first=1, others=-1, each=1), "rate of the first joint = Σ ratio · rate of the others"
    ] = field(default_factory=lambda: frozen([1.0]))
    stiffness: Annotated[
        float,
        Number(energy=1, first=-2, least=NON_NEGATIVE),
        "stiffness of a belt, N m/rad or N/m of the first joint; 0: rigid",
    ] = 0.0
    damping: Annotated[
        float,
        Number(energy=1, time=1, first=-2, least=NON_NEGATIVE),
        "damping of the belt's stretch, N m s/rad or N s/m",
    ] = 0.0
    stretch: Annotated[float, Number(first=1), "initial stretch of a belt, rad or m of the first joint"] = 0.0
    friction: Annotated[
        float,
        Number(energy=1, time=1, first=-2, least=NON_NEGATIVE),
        "viscous friction on the first joint's rate, N m s/rad or N s/m",
    ] = 0.0
    heat: Annotated[str, Named("node"), "thermal node that takes up the heat of damping and friction"] = ENVIRONMENT

    @property
    def warms(self) -> bool:
        return bool(self.friction or (self.stiffness and self.damping))

    def __str__(self) -> str:
        return f"{' – '.join(self.joints)}, {', '.join(f'{x:g}' for x in self.ratio)}"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Cylinder(Attachment):
    """A hydraulic cylinder on a joint that slides, or a hydraulic motor on one that turns."""

    name: str
    joint: Annotated[
        str, Named("joint"), "a joint with one degree of freedom; chamber a pushes it to larger coordinates"
    ]
    area: Annotated[
        Array,
        Number(length=3, first=-1, count=2),
        "change of volume of chambers a and b per coordinate, m³/m or m³/rad",
    ]
    volume: Annotated[Array, Number(length=3, count=2, least=POSITIVE), "volume of oil in each chamber, m³"]
    conductance: Annotated[
        float,
        Number(energy=-1, time=-1, length=6, least=POSITIVE),
        "conductance of the line to each chamber, m³/(s Pa)",
    ]
    bulk: Annotated[float, Number(energy=1, length=-3, least=POSITIVE), "bulk modulus of the oil, Pa"] = 1.5e9
    leak: Annotated[
        float,
        Number(energy=-1, time=-1, length=6, least=NON_NEGATIVE),
        "conductance of the leak across the piston, m³/(s Pa)",
    ] = 0.0
    pressure: Annotated[
        Array,
        Number(energy=1, length=-3, count=2),
        'pressures of the supplies above world.pressure without an input "cylinders.NAME", Pa',
    ] = field(default_factory=lambda: frozen([0.0, 0.0]))
    initial_pressure: Annotated[
        Array | None,
        Number(energy=1, length=-3, count=2),
        "pressures of the oil at the start above world.pressure, Pa; default: pressure",
    ] = None
    travel: Annotated[
        float, Number(first=1), "displacement of the piston at the start from where the chambers have volume, rad or m"
    ] = 0.0
    heat: Annotated[str, Named("node"), "thermal node that takes up the heat of lines and leak"] = ENVIRONMENT

    @property
    def started(self) -> Array:
        """(2,) pressures of the oil at the start, in Pa."""
        return self.pressure if self.initial_pressure is None else self.initial_pressure

    @property
    def warms(self) -> bool:
        return True

    def __str__(self) -> str:
        return f"on {self.joint}, {' and '.join(f'{x:g}' for x in self.area)} m²"


@final
@dataclass(frozen=True, slots=True)
class GasSpring(Attachment):
    """An ideal gas behind a piston on a joint, the environment's pressure before it."""

    name: str
    joint: Annotated[str, Named("joint"), "a joint with one degree of freedom"]
    area: Annotated[
        float,
        Number(length=3, first=-1),
        "change of the gas volume per coordinate, m³/m or m³/rad; may be negative",
    ]
    volume: Annotated[float, Number(length=3, least=POSITIVE), "initial volume, m³"]
    pressure: Annotated[
        float,
        Number(energy=1, length=-3, least=POSITIVE),
        "initial absolute pressure, Pa; world.pressure acts on the other side of the piston",
    ]
    temperature: Annotated[float, Number(least=POSITIVE), "initial temperature, K"] = 293.15
    gamma: Annotated[float, Number(least=ABOVE_ONE), "ratio of specific heats"] = 1.4
    conductance: Annotated[
        float,
        Number(energy=1, time=-1, least=NON_NEGATIVE),
        "thermal conductance from the gas to its thermal node, W/K; 0: adiabatic",
    ] = 0.0
    heat: Annotated[str, Named("node"), "thermal node that exchanges heat with the gas"] = ENVIRONMENT

    @property
    def warms(self) -> bool:
        return bool(self.conductance)

    def __str__(self) -> str:
        return f"on {self.joint}, {self.volume:g} m³ at {self.pressure:g} Pa"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Actuator(Attachment):
    """A control as forces on joints, or on the length of a tendon: an input by name, for motors without dynamics."""

    name: str
    joints: Annotated[tuple[str, ...], Named("joint"), "joints with one degree of freedom"] = ()
    tendon: Annotated[str | None, Named("tendon"), "instead of joints: a tendon, on whose length it acts"] = None
    ratio: Annotated[
        Array,
        Number(energy=1, others=-1, each=0),
        'force on each by the control, the input "actuators.NAME"; N m, N',
    ] = field(default_factory=lambda: frozen([1.0]))
    limits: Annotated[Array | None, Number(count=2), "least and largest control"] = None
    heat: Annotated[str, Named("node")] = ENVIRONMENT

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
