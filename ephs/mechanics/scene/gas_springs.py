"""Gas springs on joints."""

from collections.abc import Mapping
from typing import Self, final

import numpy as np

from ephs.mechanics.elements.cylinder import gas_spring
from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.element import AXIS, ENVIRONMENT
from ephs.mechanics.scene.schema_numbers import NonNegative, Number, Positive, Text
from ephs.mechanics.scene.site import Site
from ephs.semantics.bundles.bundle import Array


@final
class GasSpring(Element, section="gas_springs", said="gas springs on joints"):
    """An ideal gas behind a piston on a joint, the environment's pressure before it."""

    joint: Text = key("a joint with one degree of freedom", names=AXIS)
    area: Number = key(
        "change of the gas volume per coordinate, {}; may be negative", unit="m³/q", shown="m³/m or m³/rad"
    )
    volume: Positive = key("initial volume", unit="m³")
    pressure: Positive = key(
        "initial absolute pressure, {}; world.pressure acts on the other side of the piston", unit="Pa"
    )
    temperature: Positive = key("initial temperature", 293.15, unit="K")
    gamma: float = key("ratio of specific heats", 1.4, unit="1", gt=1.0)
    conductance: NonNegative = key(
        "thermal conductance from the gas to its thermal node, {}; 0: adiabatic", 0.0, unit="W/K"
    )
    heat: Text = key("thermal node that exchanges heat with the gas", ENVIRONMENT, names="node")

    def build(self, site: Site) -> None:
        ports = site.heated(self.heat) if self.conductance else {}
        made = gas_spring(site.quantity(self.joint), **self.number_values(), heat=bool(ports))
        site.add(made, {"p_r": site.drive(self.joint)} | ports)

    def continued(self, states: Mapping[str, Array]) -> Self:
        volume, heats = float(states["gas.v"][0]), 1.0 / (self.gamma - 1.0)
        capacity = heats * self.pressure * self.volume / self.temperature
        hot = self.temperature * (self.volume / volume) ** (self.gamma - 1.0) * np.exp(states["gas.s"][0] / capacity)
        return self.changed(volume=volume, temperature=float(hot), pressure=float(capacity * hot / heats / volume))

    def __str__(self) -> str:
        return f"on {self.joint}, {self.volume:g} m³ at {self.pressure:g} Pa"
