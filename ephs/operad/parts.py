"""Parts of a pattern: junctions, ports and boxes."""

from dataclasses import dataclass
from typing import final

from ephs.operad.directory import Directory
from ephs.operad.names import Path
from ephs.operad.quantities import Interface, Quantity


@final
@dataclass(frozen=True, slots=True)
class Junction:
    """A place where ports meet: they share the state; its power ports share the effort, and their flows
    balance.

    Parameters
    ----------
    quantity
        What the ports exchange.
    exposed
        Whether there is an outer port of the junction's name.
    power
        Whether that outer port bears power; ``False`` makes it a state port. Without exposure it has no
        meaning.
    """

    quantity: Quantity
    exposed: bool = False
    power: bool = True

    def __str__(self) -> str:
        role = "" if not self.exposed else ", exposed" if self.power else ", exposed as state"
        return f"{self.quantity}{role}"

    def __repr__(self) -> str:
        exposed = ", exposed=True" if self.exposed else ""
        return f"junction({self.quantity!r}{exposed}{'' if self.power else ', power=False'})"


def junction(quantity: Quantity, exposed: bool = False, power: bool = True) -> Junction:
    """Make a junction; parameters as of `Junction`."""
    return Junction(quantity, exposed, power)


@final
@dataclass(frozen=True, slots=True)
class Port:
    """A port of an inner box: its junction, and whether it is a power port."""

    junction: Path
    power: bool

    def __str__(self) -> str:
        return f"{'' if self.power else '~'}{self.junction}"


@final
@dataclass(frozen=True, slots=True)
class Box:
    """An inner box: its ports, and the interface that they make, with the quantities of their junctions."""

    ports: Directory[Port]
    interface: Interface
