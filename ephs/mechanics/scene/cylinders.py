"""Hydraulic cylinders on joints."""

from collections.abc import Mapping
from typing import Self, final

from ephs.mechanics.elements.cylinder import hydraulic_cylinder
from ephs.mechanics.scene.custom import Element, key
from ephs.mechanics.scene.element import AXIS, ENVIRONMENT
from ephs.mechanics.scene.schema_numbers import Couple, NonNegative, Number, Positive, Sizes, Text
from ephs.mechanics.scene.site import Site
from ephs.operad import quantity
from ephs.semantics.bundles.bundle import Array


@final
class Cylinder(Element, section="cylinders", said="hydraulic cylinders on joints"):
    """A hydraulic cylinder on a joint that slides, or a hydraulic motor on one that turns."""

    joint: Text = key("a joint with one degree of freedom; chamber a pushes it to larger coordinates", names=AXIS)
    area: Couple = key("change of volume of chambers a and b per coordinate", unit="m³/q", shown="m³/m or m³/rad")
    volume: Sizes = key("volume of oil in each chamber", unit="m³")
    conductance: Positive = key("conductance of the line to each chamber", unit="m³/(s Pa)")
    bulk: Positive = key("bulk modulus of the oil", 1.5e9, unit="Pa")
    leak: NonNegative = key("conductance of the leak across the piston", 0.0, unit="m³/(s Pa)")
    pressure: Couple = key(
        'pressures of the supplies above world.pressure without an input "cylinders.NAME"', [0.0, 0.0], unit="Pa"
    )
    initial_pressure: Couple | None = key(
        "pressures of the oil at the start above world.pressure, {}; default: pressure", None, unit="Pa"
    )
    travel: Number = key("displacement of the piston at the start from where the chambers have volume", 0.0, unit="q")
    heat: Text = key("thermal node that takes up the heat of lines and leak", ENVIRONMENT, names="node")

    def build(self, site: Site) -> None:
        numbers, ports = self.number_values(), site.heated(self.heat)
        pressure, started = numbers["pressure"], numbers.pop("initial_pressure")
        numbers["pressure"] = pressure if started is None else started
        made = hydraulic_cylinder(site.quantity(self.joint), **numbers, heat=bool(ports))
        supplies = {
            port: site.input(quantity.liquid, value, port, at="pressures")
            for port, value in zip("ab", pressure, strict=True)
        }
        site.add(made, supplies | {"p_r": site.drive(self.joint)} | ports)

    def continued(self, states: Mapping[str, Array]) -> Self:
        travel = float(states["oil.q"][0])
        held = [float(states[f"oil.v_{port}"][0]) for port in "ab"]
        pressures = [
            self.bulk * (v - area * x - volume) / volume
            for v, area, volume, x in zip(held, self.area, self.volume, (travel, -travel), strict=True)
        ]
        return self.changed(travel=travel, initial_pressure=pressures)

    def __str__(self) -> str:
        return f"on {self.joint}, {' and '.join(f'{x:g}' for x in self.area)} m²"
