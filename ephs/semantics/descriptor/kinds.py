"""The numbering of a nested system without flattening it: each kind of part once, its copies by index maps.

Fillings of one shape are of one kind: systems with the same pattern and fillings of the same shapes, components with
the same ports, whatever their parameters. A kind is numbered on its own; a box that it fills adds its numbers to those
of the level around, through a map of the kind's junctions and states to those of the level, and all boxes of one kind
do so at once. The numbers are those of the flattened system.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np
from numpy.typing import NDArray

from ephs.operad import Path, Pattern, Quantity
from ephs.operad.disjoint import DisjointSets
from ephs.semantics.descriptor.numbering import Index, Interned, Numbering, Parts
from ephs.semantics.primitives.primitives import Primitive, Storage
from ephs.semantics.systems.system import Filling, System

WORTH = 8
"""Kinds are numbered from so many components for each of them on: a kind costs as much as some components."""
COMPONENTS, WIRES, READS, STATES, JUNCTIONS = range(5)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Kind:
    """A filling, numbered on its own.

    Junctions and states of the outside have numbers behind its own: ``junctions.size + port`` is the junction of an
    outer port, ``states.size + class`` the state of a class of outer ports that nothing inside stores.

    Parameters
    ----------
    ports
        The outer ports.
    components
        Their number.
    wires, reads, junctions, states
        As of a `Numbering`.
    bearing
        (ports,) whether a component's power port lies on the port's junction, and it is a power port itself.
    classes
        (ports,) class of each outer port: ports of one class share their state.
    stored
        (classes,) the state inside that is the class', −1 where nothing inside stores it.
    parts
        The kinds that fill its boxes, each with (copies, 5) the numbers before those of each copy.
    """

    ports: tuple[Path, ...]
    components: int
    wires: Index
    reads: Index
    junctions: Index
    states: Index
    bearing: NDArray[np.bool_]
    classes: Index
    stored: Index
    parts: "tuple[tuple[Kind, Index], ...]" = ()

    @property
    def first(self) -> Index:
        """(classes,) one outer port of each class."""
        return np.unique(self.classes, return_index=True)[1].astype(np.int64)

    @property
    def composite(self) -> bool:
        """Whether more than one component is inside."""
        return self.components > 1

    @property
    def counts(self) -> Index:
        """Numbers of components, wires, reads, states and junctions inside."""
        found = (self.wires, self.reads, self.states, self.junctions)
        return np.array([self.components, *(numbers.size for numbers in found)], dtype=np.int64)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Copies:
    """The boxes of a level that one kind fills.

    Parameters
    ----------
    box
        (copies,) their numbers in the order of the fillings.
    at
        (copies, ports) the junctions of the level on which their ports lie.
    """

    kind: Kind
    box: Index
    at: Index


def number_by_kinds(system: System) -> Numbering | None:
    """Number a system by its kinds.

    Returns
    -------
    Numbering or None
        That of the flattened system. None where a state is stored twice, or read and stored nowhere: to number the
        flattened system says where.
    """
    kinds = _Kinds()
    try:
        whole, outer = kinds.level(system, closed=True)
    except _NotStoredOnce:
        return None
    primitives = Interned[Primitive]()
    order = _index(_ordered(system, primitives, {}))
    return Numbering(
        tuple(primitives.values), tuple(kinds.quantities.values),
        order, whole.wires, whole.reads, whole.junctions, outer, whole.states, _parts(whole),
    )  # fmt: skip


def _parts(whole: Kind) -> tuple[Parts, ...]:
    """All copies of each composite kind, those inside others before them."""
    order: dict[int, Kind] = {}

    def visit(kind: Kind) -> None:
        if id(kind) not in order:
            for inner, _ in kind.parts:
                visit(inner)
            order[id(kind)] = kind

    visit(whole)
    first: dict[int, list[Index]] = {key: [] for key in order}
    first[id(whole)].append(np.zeros((1, 5), dtype=np.int64))
    found: list[Parts] = []
    for key, kind in reversed(order.items()):
        start = np.concatenate(first[key])
        for inner, before in kind.parts:
            first[id(inner)].append((start[:, None, :] + before).reshape(-1, 5))

        def inside(what: int, start: Index = start, kind: Kind = kind) -> Index:
            return start[:, what, None] + np.arange(int(kind.counts[what]))

        found.append(Parts(inside(STATES), inside(JUNCTIONS), inside(COMPONENTS)))
    return tuple(found[:0:-1])  # without the whole


def repeats(system: System) -> bool:
    """Whether so much of a system is the same that kinds are worth it."""
    shapes = _Shapes()
    return shapes.sizes[shapes.of(system)] >= WORTH * len(shapes.sizes)


def _ordered(filling: Filling, primitives: Interned[Primitive], known: dict[int, list[int]]) -> list[int]:
    """Numbers of a filling's components; each different filling is looked at once."""
    found = known.get(id(filling))
    if found is None:
        if isinstance(filling, System):
            found = [number for part in filling.fillings.values() for number in _ordered(part, primitives, known)]
        else:
            found = [primitives.number_of_object(filling)]
        known[id(filling)] = found
    return found


@final
class _Shapes:
    """Consecutive numbers of shapes of fillings. Objects are recognised by identity: keep them alive.

    Attributes
    ----------
    sizes
        Number of components of each shape.
    """

    def __init__(self) -> None:
        self.sizes: list[int] = []
        self._by_id: dict[int, int] = {}
        self._by_content: dict[Hashable, int] = {}

    def of(self, filling: Filling) -> int:
        """The shape of a filling."""
        found = self._by_id.get(id(filling))
        if found is None:
            content: Hashable
            if isinstance(filling, System):
                inner = tuple((box, self.of(part)) for box, part in filling.fillings.items())
                content, size = (id(filling.pattern), inner), sum(self.sizes[shape] for _, shape in inner)
            else:
                content, size = (id(filling.interface), None if isinstance(filling, Storage) else filling.reads), 1
            found = self._by_content.setdefault(content, len(self.sizes))
            if found == len(self.sizes):
                self.sizes.append(size)
            self._by_id[id(filling)] = found
        return found


class _NotStoredOnce(Exception):
    """A state is stored twice, or read and stored nowhere."""


@final
class _Kinds:
    """The kinds that were met."""

    def __init__(self) -> None:
        self.quantities = Interned[Quantity]()
        self.shapes = _Shapes()
        self._known: dict[int, Kind] = {}

    def of(self, filling: Filling) -> Kind:
        """The kind of a filling."""
        shape = self.shapes.of(filling)
        found = self._known.get(shape)
        if found is None:
            found = self.level(filling)[0] if isinstance(filling, System) else self._primitive(filling)
            self._known[shape] = found
        return found

    def _primitive(self, primitive: Primitive) -> Kind:
        """A component: one class per outer port; the ports of a storage are states."""
        ports = tuple(primitive.interface)
        bundle, place = primitive.bundle, {port: i for i, port in enumerate(ports)}
        storing = isinstance(primitive, Storage)
        stored = np.full(len(ports), -1)
        if storing:
            stored[[place[port] for port in bundle.ports]] = np.arange(len(bundle.ports))
        states = (
            [self.quantities.number(bundle.quantity(port).in_frame(None)) for port in bundle.ports] if storing else []
        )
        reads = range(len(bundle.ports)) if storing else [place[port] for port in primitive.reads]
        return Kind(
            ports=ports,
            components=1,
            wires=_index([place[port] for port in bundle.ports]),
            reads=_index(reads),
            junctions=_index([]),
            states=_index(states),
            bearing=np.array([primitive.interface[port].power for port in ports], dtype=np.bool_),
            classes=np.arange(len(ports)),
            stored=stored,
        )

    def level(self, system: System, *, closed: bool = False) -> tuple[Kind, Index]:
        """A pattern and its components, numbered, with the junctions of its outer power ports.

        Parameters
        ----------
        closed
            Whether nothing is around: the outer ports' junctions are numbered among its own.
        """
        pattern, copies = system.pattern, self._copies(system)
        start, total = _starts(system, copies)
        exposed = np.array([j.exposed for j in pattern.junctions.values()], dtype=np.bool_)
        power = exposed & np.array([j.power for j in pattern.junctions.values()], dtype=np.bool_)
        bearing = np.zeros(exposed.size, dtype=np.bool_)
        for c in copies:
            bearing[c.at[:, c.kind.bearing]] = True
        own = (bearing | power) if closed else (bearing & ~power)
        inner = int(own.sum())
        number = np.full(exposed.size, -1)
        number[own] = np.arange(inner)
        start[JUNCTIONS] += inner
        total[JUNCTIONS] += inner
        ports = np.flatnonzero(exposed)
        outer = number[power]
        if not closed:
            number[ports] = np.where(power[ports], total[JUNCTIONS] + np.arange(ports.size), number[ports])
        label = _labels(pattern, copies)
        stores = self._stores(copies, start, label)
        found, classes = np.unique(label[ports], return_inverse=True)
        outside = np.full(exposed.size, -1)
        outside[found] = total[STATES] + np.arange(found.size)
        state = np.where(stores >= 0, stores, outside)[label]
        arrays = [np.empty(int(count), dtype=np.int64) for count in total]
        # frames are no part of numbers, and come from the levels above, too
        quantities = [
            j.quantity.in_frame(None) for j, mine in zip(pattern.junctions.values(), own, strict=True) if mine
        ]
        arrays[JUNCTIONS][:inner] = [self.quantities.number(quantity) for quantity in quantities]
        for c in copies:
            kind = c.kind
            junctions = _map(start[JUNCTIONS, c.box], kind.junctions.size, number[c.at])
            states = _map(start[STATES, c.box], kind.states.size, state[c.at[:, kind.first]])
            blocks = (junctions[:, kind.wires], states[:, kind.reads], kind.states, kind.junctions)
            for i, block in enumerate(blocks, WIRES):
                arrays[i][start[i, c.box][:, None] + np.arange(block.shape[-1])] = block
        read = arrays[READS]
        if (read < 0).any() or (closed and (read >= total[STATES]).any()):
            raise _NotStoredOnce
        kind = Kind(
            tuple(pattern.interface), int(total[COMPONENTS]), arrays[WIRES], arrays[READS], arrays[JUNCTIONS],
            arrays[STATES], (bearing & power)[ports], classes.astype(np.int64), stores[found],
            tuple((c.kind, start[:, c.box].T) for c in copies if c.kind.composite),
        )  # fmt: skip
        return kind, outer

    def _copies(self, system: System) -> list[Copies]:
        pattern = system.pattern
        index = {path: i for i, path in enumerate(pattern.junctions)}
        boxes: dict[int, list[int]] = {}
        wiring: dict[int, list[list[int]]] = {}
        kinds: dict[int, Kind] = {}
        for number, (box, filling) in enumerate(system.fillings.items()):
            same = self.shapes.of(filling)
            if same not in kinds:
                kinds[same], boxes[same], wiring[same] = self.of(filling), [], []
            ports = pattern.boxes[box].ports
            boxes[same].append(number)
            wiring[same].append([index[ports[port].junction] for port in kinds[same].ports])
        return [
            Copies(kind, _index(boxes[same]), _index(wiring[same]).reshape(len(boxes[same]), len(kind.ports)))
            for same, kind in kinds.items()
        ]

    def _stores(self, copies: list[Copies], start: Index, label: Index) -> Index:
        """(labels,) the state that lives on the junctions of each label, −1 where none does."""
        out = np.full(label.size, -1)
        places: list[Index] = [_index([])]
        states: list[Index] = [_index([])]
        for c in copies:
            storing = np.flatnonzero(c.kind.stored >= 0)
            if storing.size:
                places.append(label[c.at[:, c.kind.first[storing]]].ravel())
                states.append((start[STATES, c.box][:, None] + c.kind.stored[storing]).ravel())
        place, state = np.concatenate(places), np.concatenate(states)
        out[place] = state
        if (out[place] != state).any():
            raise _NotStoredOnce
        return out


def _starts(system: System, copies: list[Copies]) -> tuple[Index, Index]:
    """(5, boxes) numbers before those of each box, and (5,) how many there are in all boxes."""
    count = np.zeros((5, len(system.fillings)), dtype=np.int64)
    for c in copies:
        count[:, c.box] = c.kind.counts[:, None]
    start = np.cumsum(count, axis=1) - count
    number = {box: i for i, box in enumerate(system.fillings)}
    order = _index([number[box] for box in system.pattern.boxes])  # junctions come in the pattern's order
    start[JUNCTIONS, order] = np.cumsum(count[JUNCTIONS, order]) - count[JUNCTIONS, order]
    return start, count.sum(axis=1)


def _labels(pattern: Pattern, copies: list[Copies]) -> Index:
    """(junctions,) equal for junctions that share their state, by links or by the systems in the boxes."""
    index = {path: i for i, path in enumerate(pattern.junctions)}
    pairs = [(index[a], index[b]) for group in pattern.links for a, b in pairwise(group)]
    for c in copies:
        first = c.kind.first[c.kind.classes]
        for port in np.flatnonzero(first != np.arange(first.size)):
            pairs += zip(c.at[:, first[port]].tolist(), c.at[:, port].tolist(), strict=True)
    sets = DisjointSets[int]()
    for a, b in pairs:
        sets.join(b, a)
    every = range(len(index))
    return _index(sets.leaders(every) if pairs else every)


def _map(start: Index, inner: int, outside: Index) -> Index:
    """(copies, inner + outside) indices on the level of a kind's numbers, copy by copy."""
    return np.hstack([start[:, None] + np.arange(inner), outside])


def _index(numbers: Sequence[int] | Sequence[Sequence[int]]) -> Index:
    return np.array(numbers, dtype=np.int64)
