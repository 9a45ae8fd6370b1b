"""The base of a relation: partition of ports by shared state, and the points of evaluation.

An interconnection identifies states. So the states of a composite are classes of outer ports, of storages' ports and
of ports that components read, and the classes of its parts compose by a pushout: parts that show one state at two
outer ports identify two states of their surroundings, whether or not they store it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from ephs.operad import Path, Pattern, Quantity
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.meaning.fields import ROUNDED, Field, Rounded
from ephs.semantics.meaning.partition import pushout
from ephs.semantics.primitives.primitives import Point, Primitive, Storage
from ephs.semantics.spaces import manifold
from ephs.semantics.systems.initial import read_state

Values = Mapping[str, object] | Mapping[Path, object] | Mapping[Path, Array]
"""Values of states by path."""


@final
@dataclass(frozen=True, slots=True)
class StateClass:
    """Ports that share one state, for which a point of the base has one value.

    Parameters
    ----------
    quantity
        The state's quantity, without frame.
    ports
        Outer ports, sorted.
    stores
        Ports of storages, each by the path of the component and its own, sorted.
    readers
        Ports of reversible and irreversible components that read the state, likewise.
    """

    quantity: Quantity
    ports: tuple[Path, ...] = ()
    stores: tuple[Path, ...] = ()
    readers: tuple[Path, ...] = ()

    @property
    def name(self) -> Path:
        """Least path: of a storage's port, of a reader's where no storage has the state, else of an outer port."""
        return min(self.stores or self.readers or self.ports)

    @property
    def free(self) -> bool:
        """Whether the state is free: neither stored nor exposed; the relation is defined at each of its values."""
        return not (self.stores or self.ports)


@final
@dataclass(frozen=True, slots=True, eq=False)
class BasePoint:
    """A point of the base, with the other arguments of the fibre over it.

    Parameters
    ----------
    states
        Value at each port of a component that stores or reads a state, by full path.
    names
        Name of the state at each of these ports: storages of one state have one rate.
    efforts
        Arguments e of the Onsager matrices by component; zero where missing.
    field
        The numbers in which the fibre is computed.
    storages
        Whether the efforts of storages are those of the states; else they stay open, as `Variable`s of their ports.
    processes
        Whether irreversible components say anything; else their flows and efforts stay open.
    """

    states: Mapping[Path, Array]
    names: Mapping[Path, Path]
    efforts: Mapping[Path, Array] = field(default_factory=dict[Path, Array])
    reference: Reference = field(default_factory=Reference)
    field: Field[Any] = field(default_factory=Rounded)
    storages: bool = True
    processes: bool = True

    def read(self, path: Path, primitive: Primitive) -> Point:
        """The states that the component at this path reads, by its ports."""
        return {port: self.states[path / port] for port in primitive.reads}


def names_of(classes: Sequence[StateClass]) -> dict[Path, Path]:
    """Name of the state at each port of a component that stores or reads it."""
    return {path: each.name for each in classes for path in (*each.stores, *each.readers)}


def component_classes(primitive: Primitive) -> tuple[StateClass, ...]:
    """The states of a primitive: each port has its own."""
    stores, reads = isinstance(primitive, Storage), set(primitive.reads)
    return tuple(
        StateClass(
            port_type.quantity.in_frame(None),
            (port,),
            (port,) if stores else (),
            (port,) if port in reads and not stores else (),
        )
        for port, port_type in sorted(primitive.interface.items())
    )


def glued_classes(pattern: Pattern, parts: Mapping[Path, Sequence[StateClass]]) -> tuple[StateClass, ...]:
    """The states of a composite, the pushout of those of its parts along the pattern; sorted by name.

    A state that nobody stores or reads is left out where no outer port shows it: the relation does not depend on it.
    """
    found: list[StateClass] = []
    shown = {box: [(each.ports, each) for each in classes] for box, classes in parts.items()}
    for ports, members in pushout(pattern, shown):
        stores = tuple(sorted(box / path for box, each in members for path in each.stores))
        readers = tuple(sorted(box / path for box, each in members for path in each.readers))
        if members and (ports or stores or readers):
            found.append(StateClass(members[0][1].quantity, ports, stores, readers))
    return tuple(sorted(found, key=lambda each: each.name))


def place(classes: Sequence[StateClass], state: Values, ports: Values) -> tuple[dict[Path, Array], str]:
    """Value at each port that stores or reads a state, and the contradictions, if any.

    Parameters
    ----------
    state, ports
        Values by a port of a component, or by an outer port, of a class; at the identity where none is given. Two
        values of one class that differ contradict.

    Raises
    ------
    AssemblyError
        An unknown path, a wrong shape, or a number that is not finite.
    """
    inner = {path: each for each in classes for path in (*each.stores, *each.readers)}
    outer = {path: each for each in classes for path in each.ports}
    given: dict[Path, list[tuple[str, Array]]] = {}
    for kind, known, values in (("state", inner, state), ("port", outer, ports)):
        for name, value in values.items():
            path = Path.of(name)
            if path not in known:
                expected = ", ".join(sorted(map(str, known))) or "none"
                raise AssemblyError(f"unknown-{kind}", path, expected=expected)
            each = known[path]
            given.setdefault(each.name, []).append((f"{kind} {path}", read_state(path, each.quantity, value)))
    states: dict[Path, Array] = {}
    apart: list[str] = []
    for each in classes:
        values = given.get(each.name) or [("", manifold(each.quantity.space).identity())]
        if not all(_equal(each.quantity, values[0][1], value) for _, value in values[1:]):
            apart.append("one state has several values: " + "; ".join(f"{name} = {value}" for name, value in values))
        states |= dict.fromkeys((*each.stores, *each.readers), values[0][1])
    return states, "; ".join(apart)


def _equal(quantity: Quantity, one: Array, other: Array) -> bool:
    space = manifold(quantity.space)
    # rounding of a coordinate is relative to the largest one
    size = max(1.0, float(np.abs(one).max(initial=0.0)))
    return float(np.abs(space.increment(one, other)).max(initial=0.0)) <= ROUNDED * space.size * size
