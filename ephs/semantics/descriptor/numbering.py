"""Numbers for the states, junctions and components of a square descriptor form, and the numbering of a flat system."""

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from ephs.operad import Path, Quantity
from ephs.semantics.bundles.errors import AssemblyError
from ephs.semantics.primitives.primitives import Primitive, Reversible, Storage
from ephs.semantics.systems.system import System

Index = NDArray[np.int64]
T = TypeVar("T", bound=Hashable)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Numbering:
    """The incidences of a closed system as arrays; in them a list of lists is one array, row after row.

    Parameters
    ----------
    primitives, quantities
        Those that occur, each once.
    primitive
        (components,) primitive of each component.
    wires
        (power ports of all components,) the junction that each lies on; of a component in its bundle's order.
    reads
        (read ports of all components,) the state that lives at each, in the order of ``primitive.reads``.
    junctions
        (junctions,) quantity of each junction that bears power.
    outer
        (outer ports,) their junctions.
    states
        (states,) quantity of each; they come in the order of the storages and their ports.
    """

    primitives: tuple[Primitive, ...]
    quantities: tuple[Quantity, ...]
    primitive: Index
    wires: Index
    reads: Index
    junctions: Index
    outer: Index
    states: Index

    def dims(self, numbers: Index) -> Index:
        """Dimensions of the fibres over so many quantities."""
        return np.array([q.space.dim for q in self.quantities], dtype=np.int64)[numbers]

    def sizes(self, numbers: Index) -> Index:
        """Numbers that a state of these quantities has."""
        return np.array([q.space.size for q in self.quantities], dtype=np.int64)[numbers]

    @property
    def multipliers(self) -> Index:
        """(components,) the multipliers of each."""
        each = [p.multipliers if isinstance(p, Reversible) else 0 for p in self.primitives]
        return np.array(each, dtype=np.int64)[self.primitive]


@final
class Interned(Generic[T]):
    """Consecutive numbers of distinct values. Objects are recognised by identity, and so kept."""

    def __init__(self) -> None:
        self.values: list[T] = []
        self._met: list[T] = []  # else another object could have the identity of one that is gone
        self._by_id: dict[int, int] = {}
        self._by_value: dict[T, int] = {}

    def number(self, value: T) -> int:
        """The number of a value, by equality."""
        found = self._by_id.get(id(value))
        if found is None:
            found = self._by_value.setdefault(value, len(self.values))
            if found == len(self.values):
                self.values.append(value)
            self._met.append(value)
            self._by_id[id(value)] = found
        return found

    def number_of_object(self, value: T) -> int:
        """The number of an object, by identity."""
        found = self._by_id.setdefault(id(value), len(self.values))
        if found == len(self.values):
            self.values.append(value)
        return found


def starts(length: Index) -> Index:
    """Start indices of consecutive rows."""
    return np.cumsum(length) - length


def spans(at: Index, length: Index) -> Index:
    """The ranges at[i] … at[i] + length[i] − 1, one after the other."""
    return np.repeat(at - starts(length), length) + np.arange(int(length.sum()), dtype=np.int64)


def sums(values: Index, length: Index) -> Index:
    """Sums over consecutive rows."""
    whole = np.append(0, np.cumsum(values))
    return whole[np.cumsum(length)] - whole[starts(length)]


def bearing_junctions(flat: System) -> list[Path]:
    """The junctions of a flat system that bear power, or are exposed so, in the pattern's order."""
    pattern = flat.pattern
    bearing = {port.junction for box in pattern.boxes.values() for port in box.ports.values() if port.power}
    return [path for path, j in pattern.junctions.items() if path in bearing or (j.exposed and j.power)]


def number_flat(flat: System) -> Numbering:
    """Number a flat system, component by component.

    Raises
    ------
    AssemblyError
        A state stored twice, or read and stored nowhere.
    """
    pattern, least = flat.pattern, _least(flat)
    primitives, quantities = Interned[Primitive](), Interned[Quantity]()
    number = {path: i for i, path in enumerate(bearing_junctions(flat))}
    states, provider = _states(flat, least, quantities)
    order: list[int] = []
    wires: list[int] = []
    reads: list[int] = []
    for path, primitive in flat.fillings.items():
        assert not isinstance(primitive, System)
        on = {port: wire.junction for port, wire in pattern.boxes[path].ports.items()}
        order.append(primitives.number_of_object(primitive))
        wires += [number[on[port]] for port in primitive.bundle.ports]
        for port in primitive.reads:
            junction = on[port]
            state = provider.get(least.get(junction, junction))
            if state is None:
                raise AssemblyError("unread-state", path, port=port, junction=junction)
            reads.append(state)
    of = [quantities.number(pattern.junctions[path].quantity.in_frame(None)) for path in number]
    outer = [i for path, i in number.items() if pattern.junctions[path].exposed and pattern.junctions[path].power]
    index = [np.array(numbers, dtype=np.int64) for numbers in (order, wires, reads, of, outer, states)]
    return Numbering(tuple(primitives.values), tuple(quantities.values), *index)


def _least(flat: System) -> dict[Path, Path]:
    """The least junction of the class of each linked one."""
    return {path: least for members in flat.pattern.links for least in (min(members),) for path in members}


def _states(flat: System, least: dict[Path, Path], quantities: Interned[Quantity]) -> tuple[list[int], dict[Path, int]]:
    """The quantity of each state, and the state that lives on each class of junctions, by its least path."""
    states: list[int] = []
    provider: dict[Path, int] = {}
    paths: list[Path] = []
    for path, primitive in flat.fillings.items():
        if not isinstance(primitive, Storage):
            continue
        for port in primitive.bundle.ports:
            junction = flat.pattern.boxes[path].ports[port].junction
            key = least.get(junction, junction)
            if key in provider:
                found = f"{paths[provider[key]]} and {path / port}"
                raise AssemblyError("two-storages", path, junction=junction, found=found)
            provider[key] = len(states)
            paths.append(path / port)
            states.append(quantities.number(primitive.interface[port].quantity.in_frame(None)))
    return states, provider
