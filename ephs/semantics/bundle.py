"""Port bundles: how the flows and efforts of an interface lie in one vector.

All fibres are left-trivialised, so a port of a quantity Q carries a flow and an effort in ℝᵏ, k = Q.space.dim,
whatever the state (Lohmayer, Capobianco, Leyendecker, section 2).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import final

import numpy as np
from numpy.typing import NDArray

from ephs.operad import Interface, Path, PortType, Quantity

__all__ = ["POSITIVE", "Array", "Bundle", "Reference"]

Array = NDArray[np.float64]
Span = slice
"""A range of indices: `slice`, whose own name a method of `Bundle` bears."""
POSITIVE = ("volume", "amount")
"""Kinds of quantity whose states are positive, so that steps are relative to them."""


@final
@dataclass(frozen=True, slots=True)
class Reference:
    """The reference environment: its absolute temperature θ₀ in K and its pressure π₀ in Pa."""

    temperature: float = 293.15
    pressure: float = 101325.0

    def __post_init__(self) -> None:
        if not (self.temperature > 0.0 and np.isfinite(self.temperature)):
            raise ValueError(f"reference temperature is {self.temperature!r} K, expected a number > 0")
        if not (self.pressure >= 0.0 and np.isfinite(self.pressure)):
            raise ValueError(f"reference pressure is {self.pressure!r} Pa, expected a number ≥ 0")

    def intensive(self, quantity: Quantity) -> float:
        """Energy effort of the quantity in the reference environment: θ₀, −π₀, 0 otherwise."""
        if quantity.kind == "entropy":
            return self.temperature
        return -self.pressure if quantity.kind == "volume" else 0.0


@final
@dataclass(frozen=True, slots=True)
class Bundle:
    """The fibre ⊕ V ⊕ V* over the power ports of an interface, and the base over its read ports."""

    interface: Interface
    ports: tuple[Path, ...]
    offsets: tuple[int, ...]
    size: int

    @staticmethod
    def of(interface: Interface) -> "Bundle":
        """Lay the power ports of an interface side by side, in the interface's order."""
        return _bundle(tuple(interface.items()))  # equal interfaces may differ in order, and the order counts here

    def slice(self, port: Path) -> Span:
        """Where the port's flow and effort lie in the fibre vectors."""
        i = self.ports.index(port)
        return Span(self.offsets[i], self.offsets[i] + self.quantity(port).space.dim)

    def quantity(self, port: Path) -> Quantity:
        """The quantity of a port."""
        return self.interface[port].quantity

    def items(self) -> Iterator[tuple[Path, Span, Quantity]]:
        """Iterate over power ports with their slices and quantities."""
        for port in self.ports:
            yield port, self.slice(port), self.quantity(port)

    def split(self, vector: Array) -> dict[Path, Array]:
        """Cut a fibre vector into the ports' parts."""
        return {port: vector[where] for port, where, _ in self.items()}

    def indicator(self, kind: str) -> Array:
        """The constant covector 1_κ: one on every port of environment quantity κ, zero elsewhere."""
        out = np.zeros(self.size)
        for _, where, quantity in self.items():
            if quantity.kind == kind:
                out[where] = 1.0
        return out

    def environment_kinds(self) -> tuple[str, ...]:
        """The environment quantities that occur, each once."""
        return tuple(dict.fromkeys(q.kind for _, _, q in self.items() if q.environment))

    def intensive(self, reference: Reference) -> Array:
        """What to add to the exergetic efforts to have the energy efforts eᴱ = e + θ₀1_s − π₀1_v."""
        out = np.zeros(self.size)
        for _, where, quantity in self.items():
            out[where] = reference.intensive(quantity)
        return out

    def parity(self) -> Array:
        """Diagonal of the parity matrix ϵ."""
        out = np.ones(self.size)
        for _, where, quantity in self.items():
            out[where] = float(quantity.parity)
        return out


@lru_cache(maxsize=1024)
def _bundle(items: tuple[tuple[Path, PortType], ...]) -> Bundle:
    ports: list[Path] = []
    offsets: list[int] = []
    size = 0
    for port, port_type in items:
        if port_type.power:
            ports.append(port)
            offsets.append(size)
            size += port_type.quantity.space.dim
    return Bundle(Interface(items), tuple(ports), tuple(offsets), size)
