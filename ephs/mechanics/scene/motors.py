"""Direct-current motors on joints."""

from collections.abc import Mapping
from typing import Self, final

from ephs.mechanics.elements.motor import motor
from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.element import AXIS, ENVIRONMENT
from ephs.mechanics.scene.schema_numbers import NonNegative, Number, Positive, Text
from ephs.mechanics.scene.site import Site
from ephs.operad import quantity
from ephs.semantics.bundles.bundle import Array


@final
class Motor(Element, section="motors", said="motors with circuit and gear on joints"):
    """A direct-current motor on a joint with one degree of freedom."""

    joint: Text = key("the driven joint, of one degree of freedom", names=AXIS)
    constant: Number = key("torque constant: torque of the rotor per current", unit="V s/rad", shown="N m/A or V s/rad")
    resistance: Positive = key("resistance of the winding", unit="Ω")
    inductance: NonNegative = key("inductance of the winding", 0.0, unit="H")
    gear: Number = key(
        "gear ratio: rate of the rotor per rate of the joint", 1.0, unit="rad/q", shown="rad/rad or rad/m"
    )
    inertia: NonNegative = key("inertia of the rotor", 0.0, unit="kg m²")
    current: Number = key("current at the start, with an inductance; {}", 0.0, unit="A")
    voltage: Number = key('voltage without an input "motors.NAME"', 0.0, unit="V")
    heat: Text = key("thermal node that takes up the heat of the winding", ENVIRONMENT, names="node")

    def build(self, site: Site) -> None:
        numbers, ports = self.number_values(), site.heated(self.heat)
        supply = site.input(quantity.charge, numbers.pop("voltage"), at="voltages")
        made = motor(site.quantity(self.joint), **numbers, heat=bool(ports))
        site.add(made, {"q": supply, "p_r": site.drive(self.joint)} | ports, initial=self._start)

    def _start(self, site: Site) -> Mapping[str, Array]:
        return {"rotor.p": self.inertia * self.gear * site.rate(self.joint)} if self.inertia else {}

    def continued(self, states: Mapping[str, Array]) -> Self:
        return self.changed(current=float(states["coil.b"][0]) / self.inductance) if self.inductance else self

    def __str__(self) -> str:
        return f"on {self.joint}, {self.resistance:g} Ω, gear {self.gear:g}"
