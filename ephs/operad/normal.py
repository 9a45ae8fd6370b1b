"""The normal form of a pattern: what two patterns must share to be equal.

Power is exchanged at junctions, states are shared by classes of linked junctions. So power ports and power
exposures attach to the junctions that bear power, state ports and state exposures to classes. A junction that
bears no power is only a handle on its class, and its name does not count, unless it is exposed.

A class without power-bearing members and without outer names stays anonymous. Naming it by its least path
would depend on history: f ∘ₐ (g ∘_b h) may drop the handle b.k below an exposed one, and (f ∘ₐ g) ∘_{a.b} h
keep it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from ephs.operad.names import Path
from ephs.operad.quantities import Quantity

if TYPE_CHECKING:
    from ephs.operad.pattern import Box, Junction, Pattern

__all__ = ["NormalForm", "PowerJunction", "StateClass", "normal_form", "powered"]


@final
@dataclass(frozen=True, slots=True)
class PowerJunction:
    """A junction that bears power: name, quantity, whether exposed as a power port, inner power ports."""

    path: Path
    quantity: Quantity
    exposed: bool
    ports: frozenset[tuple[Path, Path]]


@final
@dataclass(frozen=True, slots=True)
class StateClass:
    """Junctions of one state: power-bearing members, outer state ports, inner state ports (box, port)."""

    quantity: Quantity
    members: frozenset[Path]
    outer: frozenset[Path]
    ports: frozenset[tuple[Path, Path]]


@final
@dataclass(frozen=True, slots=True)
class NormalForm:
    """A pattern without names that do not matter, and without order."""

    boxes: frozenset[Path]
    junctions: frozenset[PowerJunction]
    classes: frozenset[StateClass]


def powered(junctions: "Mapping[Path, Junction]", boxes: "Mapping[Path, Box]") -> frozenset[Path]:
    """The junctions that bear power: those with an inner power port or exposed as a power port."""
    inner = {port.junction for box in boxes.values() for port in box.ports.values() if port.power}
    outer = {path for path, junction in junctions.items() if junction.exposed and junction.power}
    return frozenset(inner | outer)


def normal_form(pattern: "Pattern") -> NormalForm:
    """Compute the normal form of a pattern."""
    bearing = powered(pattern.junctions, pattern.boxes)
    power_ports: dict[Path, list[tuple[Path, Path]]] = {path: [] for path in bearing}
    state_ports: dict[Path, list[tuple[Path, Path]]] = {path: [] for path in pattern.junctions}
    for box, content in pattern.boxes.items():
        for name, port in content.ports.items():
            (power_ports if port.power else state_ports)[port.junction].append((box, name))
    junctions = frozenset(
        PowerJunction(
            path,
            pattern.junctions[path].quantity,
            pattern.junctions[path].exposed and pattern.junctions[path].power,
            frozenset(power_ports[path]),
        )
        for path in bearing
    )
    classes: set[StateClass] = set()
    for members in {pattern.state_class(path) for path in pattern.junctions}:
        outer = {p for p in members if pattern.junctions[p].exposed and not pattern.junctions[p].power}
        ports = frozenset(port for path in members for port in state_ports[path])
        classes.add(StateClass(_common(pattern, members), members & bearing, frozenset(outer), ports))
    return NormalForm(frozenset(pattern.boxes), junctions, frozenset(classes))


def _common(pattern: "Pattern", members: frozenset[Path]) -> Quantity:
    """The quantity of a class: in the frame of those members that carry one, they agree."""
    quantities = [pattern.junctions[path].quantity for path in members]
    return next((q for q in quantities if q.frame is not None), quantities[0])
