"""Normal form of a pattern, by which patterns are compared.

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

from ephs.operad.directory import Directory
from ephs.operad.names import Path
from ephs.operad.parts import Box, Junction
from ephs.operad.quantities import Quantity

if TYPE_CHECKING:
    from ephs.operad.pattern import Pattern


@final
@dataclass(frozen=True, slots=True)
class PowerJunction:
    """A junction that bears power: its quantity, whether exposed as a power port, its power ports (box, port)."""

    quantity: Quantity
    exposed: bool
    ports: frozenset[tuple[Path, Path]]


@final
@dataclass(frozen=True, slots=True)
class SharedState:
    """Junctions of one state: power-bearing members, outer state ports, inner state ports (box, port).

    The quantity is that of all of them; outer ports are given with theirs, whose unit may be written otherwise.
    """

    quantity: Quantity
    members: frozenset[Path]
    outer: frozenset[tuple[Path, Quantity]]
    ports: frozenset[tuple[Path, Path]]


@final
@dataclass(frozen=True, slots=True)
class NormalForm:
    """A pattern without order and without names of inner junctions.

    Only classes that say something are among the classes: a power junction whose state nobody reads, shares or
    exposes needs none.
    """

    boxes: frozenset[Path]
    junctions: Directory[PowerJunction]
    classes: frozenset[SharedState]


def powered(junctions: Mapping[Path, Junction], boxes: Mapping[Path, Box]) -> frozenset[Path]:
    """The junctions that bear power: those with an inner power port or exposed as a power port."""
    inner = {port.junction for box in boxes.values() for port in box.ports.values() if port.power}
    outer = {path for path, junction in junctions.items() if junction.exposed and junction.power}
    return frozenset(inner | outer)


def normal_form(pattern: "Pattern") -> NormalForm:
    """Compute the normal form of a pattern, linear in its ports."""
    power_ports: dict[Path, list[tuple[Path, Path]]] = {}
    state_ports: dict[Path, list[tuple[Path, Path]]] = {}
    for box, content in pattern.boxes.items():
        for name, port in content.ports.items():
            (power_ports if port.power else state_ports).setdefault(port.junction, []).append((box, name))
    junctions: dict[Path, PowerJunction] = {}
    stateful = set(state_ports)
    for path, junction in pattern.junctions.items():
        exposed = junction.exposed and junction.power
        if exposed or path in power_ports:
            junctions[path] = PowerJunction(junction.quantity, exposed, frozenset(power_ports.get(path, ())))
        if junction.exposed and not junction.power:
            stateful.add(path)
    classes: set[SharedState] = set()
    for members in {pattern.state_class(path) for path in stateful} | pattern.links:
        first = next(iter(members))
        found = SharedState(
            pattern.junctions[first].quantity,
            frozenset(path for path in members if path in junctions),
            frozenset((p, j.quantity) for p in members if (j := pattern.junctions[p]).exposed and not j.power),
            frozenset(port for path in members for port in state_ports.get(path, ())),
        )
        if found.outer or found.ports or len(found.members) > 1:
            classes.add(found)
    return NormalForm(frozenset(pattern.boxes), Directory.trusted(junctions), frozenset(classes))
