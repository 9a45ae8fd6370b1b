"""Heat from irreversible components to thermal storages of a system, booked as energy; see `Heats`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Primitive, Storage
from ephs.solve.heats import Heats, exponential_law
from ephs.solve.methods.records import IRREVERSIBLE, STORING
from ephs.solve.model import Model


@final
@dataclass(frozen=True, slots=True, eq=False)
class Booked:
    """The heat of a step.

    Parameters
    ----------
    entropies
        (heats,) the states at the end, in J/K.
    made
        (components,) by how much more entropy each made than its quadrature says, in J/K.
    heat
        By how much more heat of friction there is than its quadrature says, in J.
    passed
        Heat that went to the storages, in J.
    """

    entropies: Array
    made: Array
    heat: float
    passed: float


@final
@dataclass(frozen=True, slots=True)
class _Store:
    """Storage of heat: its component, the effort at its junction, the entry of its state, c1 and c2, none: (1, 0)."""

    component: int
    effort: int
    state: int
    law: tuple[float, float]


@final
@dataclass(frozen=True, slots=True)
class _Port:
    """Thermal port: its component, the place of its flow, the number of the storage, and whether it is of friction."""

    component: int
    flow: int
    store: int
    friction: bool


@final
class Passages:
    """Thermal ports of irreversible components at storages of heat, of entropy alone and by an exponential law.

    A storage that anything else passes entropy to, as a reversible component or an outer port, is not one of them: what
    is passed there is an amount, which no other sum may replace.

    Attributes
    ----------
    states, components
        (heats,) entries of the state vector, and numbers of the storages.
    """

    def __init__(self, model: Model) -> None:
        t, d = model.tables, model.descriptor
        stores = _stores(model)
        ports = _ports(model, {store.effort: k for k, store in enumerate(stores)})
        self.states = np.array([store.state for store in stores], dtype=np.int64)
        self.components = np.array([store.component for store in stores], dtype=np.int64)
        self._makers = np.array([port.component for port in ports], dtype=np.int64)
        self._flows = np.array([port.flow for port in ports], dtype=np.int64)
        effort = np.array([stores[port.store].effort for port in ports], dtype=np.int64)
        self._effort, self._intensive = int(t.counts[0]) + effort, t.intensive[effort]
        ends = np.array([(-1, port.store) for port in ports], dtype=np.int64).reshape(-1, 2)
        laws = np.array([store.law for store in stores]).reshape(-1, 2)
        c1, c2 = laws[laws[:, 1] > 0.0].T
        components = np.where(laws[:, 1] > 0.0, [store.component for store in stores], -1).astype(np.int64)
        self._heats = Heats(
            tuple(d.components[store.component].path for store in stores), components, lambda: (c1, c2), ends,
            np.flatnonzero([port.friction for port in ports]), model.reference.temperature, np.arange(len(ports)),
        )  # fmt: skip
        self._rest = (t.kind == STORING).astype(float)
        self._rest[[store.component for store in stores]] = 0.0
        # energies do not count what the environment takes otherwise
        surroundings = [
            k for k, slot in enumerate(d.components)
            if isinstance(slot.primitive, Storage) and slot.primitive.environment
        ]  # fmt: skip
        self._whole = not self._rest[surroundings].any()

    def powers(self, flows: Array, z: Array) -> Array:
        """(2, passages) heat in W and entropy in W/K that go to the storages.

        Parameters
        ----------
        flows, z
            Into the ports of all components, and the unknowns.
        """
        entropies = -flows[self._flows]
        return np.array([entropies * (z[self._effort] + self._intensive), entropies])

    def booked(self, x: Array, passed: Array, missed: Array, energies: Array, work: float) -> Booked:
        """The heat of a step from the states x.

        Parameters
        ----------
        passed, missed
            (2, passages) heat in J and entropy in J/K by a quadrature, (passages,) its differences to an embedded one.
        energies
            (2, components) stored before and after, in J.
        work
            What was supplied, in J.

        Raises
        ------
        SolveError
            More heat was carried away than there is.
        """
        heat, entropy = passed
        frictions = self._heats.frictions
        lost = None
        if self._whole:
            others = float(heat.sum()) - float(heat[frictions].sum())
            lost = work - float((energies[1] - energies[0]) @ self._rest) - others
        flows = self._heats.booked(heat, missed, lost)
        before = self._heats.energies(x[self.states])
        change, made = self._heats.taken(before, flows)
        out = np.zeros(self._rest.size)
        np.add.at(out, self._makers, made - entropy)
        more = float((flows - heat)[frictions].sum())
        return Booked(self._heats.entropies(before + change), out, more, float(flows.sum()))


def _stores(model: Model) -> list[_Store]:
    t, d = model.tables, model.descriptor
    taken = {int(at) + j for at, dim, _, _ in t.outer for j in range(int(dim))}
    seen: set[int] = set()
    for slot in d.components:
        if slot.primitive.kind == "reversible":
            taken |= set(slot.efforts)
        elif slot.primitive.kind == "storage":
            taken |= seen & set(slot.efforts)
            seen |= set(slot.efforts)
    laws = [_law(primitive) for primitive in d.numbering.primitives]
    found: list[_Store] = []
    for number, slot in enumerate(d.components):
        law = laws[d.numbering.primitive[number]]
        if law is not None and t.entropy[slot.efforts[0]] == 1.0 and slot.efforts[0] not in taken:
            found.append(_Store(number, slot.efforts[0], slot.reads[0].point.start, law))
    return found


def _law(primitive: Primitive) -> tuple[float, float] | None:
    """The exponential law of a storage of one state; the environment's is linear."""
    if not isinstance(primitive, Storage) or len(primitive.interface) != 1:
        return None
    return (1.0, 0.0) if primitive.environment else exponential_law(primitive)


def _ports(model: Model, stores: Mapping[int, int]) -> list[_Port]:
    t, found = model.tables, list[_Port]()
    components = model.descriptor.components
    for number in np.flatnonzero(t.kind == IRREVERSIBLE).tolist():
        slot = components[number]
        warm = [k for k, effort in enumerate(slot.efforts) if t.entropy[effort] == 1.0]
        for k in warm:
            if slot.efforts[k] in stores:
                friction = len(warm) == 1 and len(slot.efforts) > 1
                found.append(_Port(number, int(t.e_at[number]) + k, stores[slot.efforts[k]], friction))
    return found
