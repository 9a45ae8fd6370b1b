"""Patterns as tables of elements, which rewriting takes away and adds: boxes, ports, junctions that bear power, states.

Junctions that bear no power are no elements: they are handles on a state.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

from ephs.operad.canonical import from_normal
from ephs.operad.directory import Directory
from ephs.operad.names import Path
from ephs.operad.normal import NormalForm, PowerJunction, SharedState, powered
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import Quantity

Place = tuple[Path, Path]
"""A box and the name of one of its ports."""


@final
@dataclass(frozen=True, slots=True)
class State:
    """A state: the junctions that bear power and share it, its outer state ports, the state ports that read it."""

    quantity: Quantity
    members: set[Path]
    outer: set[tuple[Path, Quantity]]
    ports: set[Place]

    @property
    def bare(self) -> bool:
        """Whether it is empty."""
        return not (self.members or self.outer or self.ports)


@final
@dataclass(frozen=True, slots=True)
class Elements:
    """The elements of a pattern.

    Parameters
    ----------
    boxes
        Their names.
    junctions
        Junction that bears power -> its quantity, and whether it is exposed as a power port.
    power
        (Box, power port) -> the junction.
    states, state_of
        The states; any junction's name -> which of them is its state, handles included.
    """

    boxes: set[Path]
    junctions: dict[Path, tuple[Quantity, bool]]
    power: dict[Place, Path]
    states: list[State]
    state_of: dict[Path, int]

    @staticmethod
    def of(pattern: Pattern) -> "Elements":
        """Take a pattern apart."""
        bearing = powered(pattern.junctions, pattern.boxes)
        found = Elements(set(pattern.boxes), {}, {}, [], {})
        for path, junction in pattern.junctions.items():
            if path not in found.state_of:
                found.state_of.update(dict.fromkeys(pattern.state_class(path), len(found.states)))
                found.states.append(State(junction.quantity, set(), set(), set()))
            state = found.states[found.state_of[path]]
            if path in bearing:
                found.junctions[path] = (junction.quantity, junction.exposed and junction.power)
                state.members.add(path)
            if junction.exposed and not junction.power:
                state.outer.add((path, junction.quantity))
        for box, content in pattern.boxes.items():
            for name, port in content.ports.items():
                if port.power:
                    found.power[box, name] = port.junction
                else:
                    found.states[found.state_of[port.junction]].ports.add((box, name))
        return found

    def pattern(self) -> Pattern:
        """Put the elements together: the canonical pattern of them."""
        on: dict[Path, set[Place]] = {path: set() for path in self.junctions}
        for place, path in self.power.items():
            on[path].add(place)
        junctions = {path: PowerJunction(q, out, frozenset(on[path])) for path, (q, out) in self.junctions.items()}
        classes = frozenset(
            SharedState(s.quantity, frozenset(s.members), frozenset(s.outer), frozenset(s.ports))
            for s in self.states
            if s.outer or s.ports or len(s.members) > 1
        )
        return from_normal(NormalForm(frozenset(self.boxes), Directory(junctions), classes))

    def ports(self) -> dict[Path, dict[Path, bool]]:
        """Box -> its ports, and whether each bears power."""
        found: dict[Path, dict[Path, bool]] = {box: {} for box in self.boxes}
        for box, name in self.power:
            found[box][name] = True
        for state in self.states:
            for box, name in state.ports:
                found[box][name] = False
        return found

    def state_at(self) -> Mapping[Place, int]:
        """(Box, state port) -> the state that it reads."""
        return {place: number for number, state in enumerate(self.states) for place in state.ports}

    def handle(self, number: int) -> Path:
        """The least name of a state among the junctions of the pattern."""
        return min(path for path, at in self.state_of.items() if at == number)
