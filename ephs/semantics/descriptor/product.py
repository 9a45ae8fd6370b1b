"""Independent parts: the systems that a system is the product of.

A junction whose effort is prescribed, whatever flows there, lets nothing pass between the components on it: that of a
fixed frame, of the environment, or of an outer port with a prescribed effort. Each part has such components and ports
for itself. The system's relation is then the product of theirs, for what prescribes the effort takes any flow, and so
the sum of the flows that it takes in the parts.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import final

import numpy as np
from numpy.typing import NDArray

from ephs.operad import Directory, Path, Pattern, Quantity
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.semantics.descriptor.numbering import Index, Numbering, spans, starts
from ephs.semantics.primitives.primitives import Primitive, Reversible, Storage
from ephs.semantics.systems.kept import once
from ephs.semantics.systems.system import System

Mask = NDArray[np.bool_]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Factor:
    """A part of a system that shares nothing but prescribed efforts with the others.

    Parameters
    ----------
    descriptor
        That of the part; its paths are those of the whole.
    components
        (components of the part,) the number of each in the whole, ascending.
    states
        (point_size of the part,) the place of each number of its states among those of the whole.
    """

    descriptor: Descriptor
    components: Index
    states: Index


def factors_of(
    descriptor: Descriptor, prescribed: frozenset[Path], counts: Callable[[Quantity], bool] = lambda _: True
) -> tuple[Factor, ...]:
    """The independent parts of a system that store something, in the order of their components.

    Parameters
    ----------
    prescribed
        Its outer ports whose effort is.
    counts
        Whether what stores a quantity is a part for itself; what stores nothing of the kind goes with a part that is
        on its junctions, as the friction of a fixed joint does, else with the first one.
    """
    key = "factors", prescribed, counts
    return once(descriptor, key, lambda: tuple(_factors(descriptor, prescribed, counts)))


def _factors(descriptor: Descriptor, prescribed: frozenset[Path], counts: Callable[[Quantity], bool]) -> list[Factor]:
    n, flat = descriptor.numbering, descriptor.system.flatten()
    power = [path for path, port in descriptor.system.interface.items() if port.power]
    wires = _wires_of(n, np.array([path in prescribed for path in power], dtype=bool))
    wanted = np.array([counts(one) for one in n.quantities], dtype=bool)[n.states] & ~wires.holds[wires.storing]
    numbers, stored = np.arange(n.primitive.size), np.unique(wires.storing[wanted])
    parts = list(dict.fromkeys(wires.label[stored].tolist()))
    if len(parts) < 2:
        return [Factor(descriptor, numbers, np.arange(descriptor.point_size))]
    label = wires.joined(parts)
    sizes, paths = n.sizes(n.states), list(flat.fillings)
    at, found = starts(sizes), list[Factor]()
    for part in parts:
        mine = wires.beside(label == part if found else ~np.isin(label, parts[1:]))
        states = np.flatnonzero(mine[wires.storing])
        system = _restricted(flat, [paths[i] for i in np.flatnonzero(mine).tolist()])
        found.append(Factor(system.descriptor(), numbers[mine], spans(at[states], sizes[states])))
    return found


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Wires:
    """Wires between components and junctions, and the sets of components that exchange power or states.

    Parameters
    ----------
    owner, junction
        (wires,) component and junction of each.
    storing
        (states,) the component that stores each.
    holds
        (components,) whether each does nothing but prescribe efforts of others.
    label
        (components,) the number of the set of each.
    """

    owner: Index
    junction: Index
    storing: Index
    holds: Mask
    label: Index

    def joined(self, parts: list[int]) -> Index:
        """(components,) numbers of sets where others are joined to one of the parts that are on their junctions."""
        own = self.label[self.owner]
        counted = np.isin(own, parts)
        there = np.full(self.junction.max(initial=-1) + 1, -1)
        ends = counted & ~self.holds[self.owner]
        there[self.junction[ends]] = own[ends]
        met = ~counted & ~self.holds[self.owner] & (there[self.junction] >= 0)
        to = np.arange(int(self.label.max(initial=-1)) + 1, dtype=np.int64)
        to[own[met]] = there[self.junction[met]]
        return to[self.label]

    def beside(self, part: Mask) -> Mask:
        """(components,) whether each belongs to a part, or prescribes an effort in it."""
        mine = part & ~self.holds
        met = self.holds[self.owner] & np.isin(self.junction, self.junction[mine[self.owner]])
        mine[self.owner[met]] = True
        return mine


def _wires_of(n: Numbering, prescribed: Mask) -> _Wires:
    """The wires of a system; ``prescribed`` (outer ports,) says of which the effort is."""
    numbers = np.arange(n.primitive.size)

    def each(values: list[int]) -> Index:
        return np.array(values, dtype=np.int64)[n.primitive]

    owner = np.repeat(numbers, each([len(one.bundle.ports) for one in n.primitives]))
    reader = np.repeat(numbers, each([len(one.reads) for one in n.primitives]))
    storing = np.repeat(numbers, each([len(one.bundle.ports) * isinstance(one, Storage) for one in n.primitives]))
    source = storing[n.reads]
    holds = each([_holds_efforts(one) for one in n.primitives]).astype(bool)
    holds[source[source != reader]] = False  # others read what it stores
    held = np.zeros(n.junctions.size, dtype=bool)
    lost = numbers
    while lost.size:  # what does not hold all of its junctions holds none
        held[:] = False
        held[n.wires[holds[owner]]] = True
        held[n.outer] = prescribed
        lost = np.flatnonzero(holds & np.isin(numbers, owner[~held[n.wires]]))
        holds[lost] = False
    passing = ~held[n.wires]
    holds &= np.isin(numbers, owner[np.isin(n.wires, n.wires[~holds[owner]])])
    ends = np.concatenate([owner[passing], reader]), np.concatenate([numbers.size + n.wires[passing], source])
    return _Wires(owner, n.wires, storing, holds, _sets_of(numbers.size + n.junctions.size, *ends)[: numbers.size])


def _sets_of(size: int, ones: Index, others: Index) -> Index:
    """(size,) equal numbers for what is joined by pairs."""
    sparse, csgraph = import_module("scipy.sparse"), import_module("scipy.sparse.csgraph")  # only runs ask
    joined = sparse.coo_array((np.ones(ones.size), (ones, others)), (size, size))
    return np.asarray(csgraph.connected_components(joined, directed=False)[1], dtype=np.int64)


def _holds_efforts(primitive: Primitive) -> bool:
    """Whether it prescribes the effort of all of its ports, and takes any flow."""
    if isinstance(primitive, Storage):
        return primitive.environment
    if not isinstance(primitive, Reversible) or primitive.reads or primitive.multipliers != primitive.bundle.size:
        return False
    return np.array_equal(primitive.structure({})[1], np.eye(primitive.bundle.size))


def _restricted(flat: System, boxes: list[Path]) -> System:
    """A flat system without all boxes but these, and without junctions on which none of these lies."""
    pattern = flat.pattern
    met = {port.junction for box in boxes for port in pattern.boxes[box].ports.values()}
    junctions = {path: one for path, one in pattern.junctions.items() if path in met}
    classes = [shared for members in pattern.links if len(shared := members & met) > 1]
    shared = {path: members for members in classes for path in members}
    kept = Pattern.trusted(
        Directory.trusted(junctions), Directory.trusted({box: pattern.boxes[box] for box in boxes}), shared
    )
    return System.trusted(kept, Directory.trusted({box: flat.fillings[box] for box in boxes}))
