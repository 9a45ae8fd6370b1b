"""Port bundles: layout of an interface's flows and efforts in one vector.

All fibres are left-trivialised, so a port of a quantity Q carries a flow and an effort in ℝᵏ, k = Q.space.dim,
whatever the state (Lohmayer, Capobianco, Leyendecker, section 2).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import final

import numpy as np
from numpy.typing import NDArray

from ephs.operad import Interface, Path, PortType, Quantity
from ephs.operad.charges import ENTROPY, VOLUME

Array = NDArray[np.float64]
Span = slice
"""A range of indices: `slice`, whose own name a method of `Bundle` bears."""


@final
@dataclass(frozen=True, slots=True)
class Reference:
    """The reference environment: its absolute temperature θ₀ in K, its pressure π₀ in Pa, its chemical potentials.

    Parameters
    ----------
    potentials
        μ₀ of each further charge in J per unit, 0 by default; of elements in J/mol. The reference potential of a
        species is the sum over its atoms, and no reaction changes it.
    """

    temperature: float = 293.15
    pressure: float = 101325.0
    potentials: Mapping[str, float] = field(default_factory=dict[str, float], hash=False)

    def __post_init__(self) -> None:
        if not (self.temperature > 0.0 and np.isfinite(self.temperature)):
            raise ValueError(f"reference temperature is {self.temperature!r} K, expected a number > 0")
        if not (self.pressure >= 0.0 and np.isfinite(self.pressure)):
            raise ValueError(f"reference pressure is {self.pressure!r} Pa, expected a number ≥ 0")
        for charge, value in self.potentials.items():
            if charge in (ENTROPY, VOLUME):
                raise ValueError(f"reference potential of {charge}: expected temperature=… and pressure=… in its place")
            if not np.isfinite(value):
                raise ValueError(f"reference potential of {charge} is {value!r} J, expected a finite number")
        object.__setattr__(self, "potentials", dict(sorted(self.potentials.items())))

    def potential(self, charge: str) -> float:
        """Intensive value of a charge: θ₀ of entropy, −π₀ of volume, μ₀ of other charges."""
        given = {ENTROPY: self.temperature, VOLUME: -self.pressure}
        return given[charge] if charge in given else self.potentials.get(charge, 0.0)

    def intensive(self, quantity: Quantity) -> Array:
        """Energy efforts of the quantity in the reference environment, (dim,): the potentials of what it carries."""
        out = np.zeros(quantity.space.dim)
        for charge, row in quantity.charges:
            out += self.potential(charge) * np.array(row)
        return out


@final
@dataclass(frozen=True, slots=True)
class Bundle:
    """The fibre ⊕ V ⊕ V* over the power ports of an interface, and the base over its read ports."""

    interface: Interface
    ports: tuple[Path, ...]
    offsets: tuple[int, ...]
    size: int
    _items: tuple[tuple[Path, Span, Quantity], ...] = field(compare=False, repr=False)

    @staticmethod
    def of(interface: Interface) -> "Bundle":
        """Lay the power ports of an interface side by side, in the interface's order."""
        return _bundle(tuple(interface.items()))  # equal interfaces may differ in order, and the order counts here

    def slice(self, port: Path) -> Span:
        """Slice of the port's flow and effort in the fibre vectors."""
        i = self.ports.index(port)
        return Span(self.offsets[i], self.offsets[i] + self.quantity(port).space.dim)

    def quantity(self, port: Path) -> Quantity:
        """The quantity of a port."""
        return self.interface[port].quantity

    def items(self) -> Iterator[tuple[Path, Span, Quantity]]:
        """Iterate over power ports with their slices and quantities."""
        return iter(self._items)

    def split(self, vector: Array) -> dict[Path, Array]:
        """Cut a fibre vector into the ports' parts."""
        return {port: vector[where] for port, where, _ in self.items()}

    def indicator(self, charge: str) -> Array:
        """The constant covector 1_κ: charge κ per unit of each port's flow, zero at ports without it."""
        out = np.zeros(self.size)
        for _, where, quantity in self.items():
            for name, row in quantity.charges:
                if name == charge:
                    out[where] = row
        return out

    @property
    def charges(self) -> tuple[str, ...]:
        """The charges that occur, each once: rows of the element matrix, whose entries are the `indicator`s."""
        return tuple(dict.fromkeys(name for _, _, quantity in self.items() for name, _ in quantity.charges))

    def intensive(self, reference: Reference) -> Array:
        """Difference from the exergetic efforts to the energy efforts eᴱ = e + θ₀1_s − π₀1_v + Σ μ₀1_κ."""
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
    found: list[tuple[Path, Span, Quantity]] = []
    size = 0
    for port, port_type in items:
        if port_type.power:
            dim = port_type.quantity.space.dim
            found.append((port, Span(size, size + dim), port_type.quantity))
            size += dim
    offsets = tuple(span.start for _, span, _ in found)
    return Bundle(Interface(items), tuple(port for port, _, _ in found), offsets, size, tuple(found))
