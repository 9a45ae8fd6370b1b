"""Stores of heat of a scene."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, final

import numpy as np

from ephs.mechanics.scene.element import POSITIVE, Measured, NumberForm


@final
@dataclass(frozen=True, slots=True)
class ThermalNode(Measured):
    """A body of uniform temperature.

    One that expands pulls at the elements of beams that it is the heat of, by ``pull`` (θ₀ − θ), in N/K; θ₀ is the
    ``reference`` in K.
    """

    name: str
    capacity: Annotated[float, NumberForm(energy=1, least=POSITIVE), "heat capacity, J/K"]
    temperature: Annotated[float, NumberForm(least=POSITIVE), "initial temperature, K"]
    pull: Annotated[float, NumberForm(energy=1, length=-1)] = 0.0
    reference: Annotated[float, NumberForm()] = 0.0

    def temperature_of(self, states: Callable[[str], Any]) -> Any:
        """θ = θ₁ exp((s − κ e)/C) in K, of its states by name: numbers or arrays."""
        s = states("s") - self.pull * states("e") if self.pull else states("s")
        return self.temperature * np.exp(s / self.capacity)
