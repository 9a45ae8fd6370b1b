"""Stores of heat of a scene, and conduction between them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np

from ephs.mechanics.scene.element import NON_NEGATIVE, POSITIVE, Element, Number

__all__ = ["Conduction", "ThermalNode"]


@final
@dataclass(frozen=True, slots=True)
class ThermalNode(Element):
    """A body of uniform temperature: capacity in J/K, initial temperature in K.

    One that expands pulls at the elements of beams that it is the heat of, by ``pull`` (θ₀ − θ), in N/K; θ₀ is the
    ``reference`` in K.
    """

    numbers: ClassVar[Mapping[str, Number]] = {
        "capacity": Number(energy=1, least=POSITIVE),
        "temperature": Number(least=POSITIVE),
        "pull": Number(energy=1, length=-1),
        "reference": Number(),
    }
    name: str
    capacity: float
    temperature: float
    pull: float = 0.0
    reference: float = 0.0

    def temperature_of(self, states: Callable[[str], Any]) -> Any:
        """θ = θ₁ exp((s − κ e)/C) in K, of its states by name: numbers or arrays."""
        s = states("s") - self.pull * states("e") if self.pull else states("s")
        return self.temperature * np.exp(s / self.capacity)


@final
@dataclass(frozen=True, slots=True)
class Conduction(Element):
    """Heat conduction between two thermal nodes, or one and the environment; conductance in W/K."""

    names: ClassVar[Mapping[str, str]] = {"between": "node"}
    numbers: ClassVar[Mapping[str, Number]] = {"conductance": Number(energy=1, time=-1, least=NON_NEGATIVE)}
    name: str
    between: tuple[str, str]
    conductance: float
