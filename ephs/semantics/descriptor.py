"""The square descriptor form of a flat system, assembled without choosing causality.

Unknowns: the rate of every storage port, the effort of every power junction, the multipliers of the constraints, the
flow of every outer port whose effort is prescribed. Equations: e = dH at the storages, flows sum to zero at every
power junction, the constraints, e = input. So it is square for every pattern.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.operad import Path, Quantity
from ephs.semantics.behaviour import Continuous, Natural, Relating, Storing
from ephs.semantics.bundle import Array
from ephs.semantics.errors import AssemblyError
from ephs.semantics.primitives import Point, Primitive, Reversible, Storage
from ephs.semantics.spaces import manifold
from ephs.semantics.system import System

__all__ = ["Descriptor", "Input", "assemble"]


@final
@dataclass(frozen=True, slots=True)
class StateSlot:
    """Where the state of one storage port lies: x[at:at+size], its rate w[rate:rate+dim]."""

    path: Path
    quantity: Quantity
    at: int
    rate: int

    @property
    def point(self) -> slice:
        """Slice of the state vector."""
        return slice(self.at, self.at + self.quantity.space.size)

    @property
    def rates(self) -> slice:
        """Slice of the rate vector."""
        return slice(self.rate, self.rate + self.quantity.space.dim)


@final
@dataclass(frozen=True, slots=True)
class ComponentSlot:
    """One primitive: which efforts are its ports', which states it reads, where its multipliers lie."""

    path: Path
    primitive: Primitive
    efforts: tuple[int, ...]
    reads: tuple[StateSlot, ...]
    multiplier: int

    @property
    def multipliers(self) -> int:
        """Number of multipliers."""
        return self.primitive.multipliers if isinstance(self.primitive, Reversible) else 0


@final
@dataclass(frozen=True, slots=True)
class JunctionSlot:
    """One power junction: its effort e[at:at+dim]; whether it is an outer port."""

    path: Path
    quantity: Quantity
    at: int
    exposed: bool

    @property
    def efforts(self) -> slice:
        """Slice of the effort vector."""
        return slice(self.at, self.at + self.quantity.space.dim)


@final
@dataclass(frozen=True, slots=True)
class Input:
    """A prescribed flow (into the system) or effort at an outer port, (dim,)."""

    value: Array
    effort: bool


@final
@dataclass(frozen=True, slots=True, eq=False)
class Descriptor:
    """Index tables of the descriptor form, and its plain evaluation."""

    system: System
    states: tuple[StateSlot, ...]
    junctions: tuple[JunctionSlot, ...]
    components: tuple[ComponentSlot, ...]

    @property
    def point_size(self) -> int:
        """Length of the state vector."""
        return sum(slot.quantity.space.size for slot in self.states)

    @property
    def rate_size(self) -> int:
        """Number of rates."""
        return sum(slot.quantity.space.dim for slot in self.states)

    @property
    def effort_size(self) -> int:
        """Number of efforts."""
        return sum(slot.quantity.space.dim for slot in self.junctions)

    @property
    def multiplier_size(self) -> int:
        """Number of multipliers."""
        return sum(slot.multipliers for slot in self.components)

    @property
    def outer(self) -> tuple[JunctionSlot, ...]:
        """The exposed power junctions."""
        return tuple(slot for slot in self.junctions if slot.exposed)

    def pack(self, state: Mapping[Path, Array]) -> Array:
        """The state vector (point_size,) from values by path."""
        out = np.zeros(self.point_size)
        for slot in self.states:
            out[slot.point] = state[slot.path]
        return out

    def unpack(self, x: Array) -> dict[Path, Array]:
        """Values by path from the state vector (…, point_size)."""
        return {slot.path: x[..., slot.point] for slot in self.states}

    def advance(self, x: Array, v: Array) -> Array:
        """The states x·exp(v), state by state; v (rate_size,)."""
        out = np.empty_like(x)
        for slot in self.states:
            out[slot.point] = manifold(slot.quantity.space).retract(x[slot.point], v[slot.rates])
        return out

    def point(self, slot: ComponentSlot, x: Array) -> Point:
        """The states that a component reads."""
        return {port: x[state.point] for port, state in zip(slot.primitive.reads, slot.reads, strict=True)}

    def complete_inputs(self, inputs: Mapping[Path, Input] | None) -> dict[Path, Input]:
        """Check that every outer port has its input.

        Raises
        ------
        AssemblyError
            An open port without input, an input without port, or a wrong shape.
        """
        given = dict(inputs or {})
        names = {slot.path: slot for slot in self.outer}
        for path in given:
            if path not in names:
                raise AssemblyError("unknown-input", path, expected=", ".join(map(str, names)) or "none")
        for path, slot in names.items():
            if path not in given:
                raise AssemblyError("missing-input", path)
            dim = slot.quantity.space.dim
            if given[path].value.shape != (dim,):
                raise AssemblyError("input", path, found=given[path].value, expected=f"{dim} numbers")
        return given

    def residual(self, behaviour: Continuous | Natural, x: Array, inputs: Mapping[Path, Input], z: Array) -> Array:
        """All equations at the unknowns z = (rates, efforts, multipliers, outer flows).

        The slow, obvious evaluation: every compiled path is held against it.
        """
        rates, rest = z[: self.rate_size], z[self.rate_size :]
        efforts, rest = rest[: self.effort_size], rest[self.effort_size :]
        lam, outer_flows = rest[: self.multiplier_size], rest[self.multiplier_size :]
        storage_rows, balance = np.zeros(self.rate_size), np.zeros(self.effort_size)
        conditions = np.zeros(self.multiplier_size)
        for slot in self.components:
            index = list(slot.efforts)
            local = behaviour.behaviour(slot.primitive, self.point(slot, x))
            if isinstance(local, Storing):
                where = [i for s in slot.reads for i in range(s.rates.start, s.rates.stop)]
                storage_rows[where] = efforts[index] - local.effort(rates[where])
                np.add.at(balance, index, rates[where])
            else:
                mine = slice(slot.multiplier, slot.multiplier + slot.multipliers)
                read = {p: rates[s.rates] for p, s in zip(slot.primitive.reads, slot.reads, strict=True)}
                flow, conditions[mine] = _related(local, efforts[index], lam[mine], read)
                np.add.at(balance, index, flow)
        at, prescribed = 0, list[Array]()
        for slot in self.outer:
            given = inputs[slot.path]
            if given.effort:
                dim = slot.quantity.space.dim
                balance[slot.efforts] -= outer_flows[at : at + dim]
                prescribed.append(efforts[slot.efforts] - given.value)
                at += dim
            else:
                balance[slot.efforts] -= given.value
        return np.concatenate([storage_rows, balance, conditions, *prescribed])

    def unknowns(self, inputs: Mapping[Path, Input]) -> int:
        """Number of unknowns, and of equations."""
        outer = sum(slot.quantity.space.dim for slot in self.outer if inputs[slot.path].effort)
        return self.rate_size + self.effort_size + self.multiplier_size + outer


def _related(local: Relating, e: Array, lam: Array, read: Mapping[Path, Array]) -> tuple[Array, Array]:
    return local.relate(e, lam, read)


def assemble(flat: System) -> Descriptor:
    """Number the unknowns of a flat system.

    Raises
    ------
    AssemblyError
        A state stored twice, or read and stored nowhere.
    """
    pattern = flat.pattern
    junctions: list[JunctionSlot] = []
    at = 0
    bearing = {port.junction for box in pattern.boxes.values() for port in box.ports.values() if port.power}
    for path, junction in pattern.junctions.items():
        exposed = junction.exposed and junction.power
        if path in bearing or exposed:
            junctions.append(JunctionSlot(path, junction.quantity, at, exposed))
            at += junction.quantity.space.dim
    by_path = {slot.path: slot for slot in junctions}
    states, provider = _states(flat)
    components: list[ComponentSlot] = []
    multiplier = 0
    for path, primitive in flat.fillings.items():
        assert not isinstance(primitive, System)
        ports = pattern.boxes[path].ports
        efforts: list[int] = []
        for port, _, _ in primitive.bundle.items():
            where = by_path[ports[port].junction].efforts
            efforts.extend(range(where.start, where.stop))
        reads: list[StateSlot] = []
        for port in primitive.reads:
            junction = ports[port].junction
            slot = provider.get(_class_key(pattern.state_class(junction)))
            if slot is None:
                raise AssemblyError("unread-state", path, port=port, junction=junction)
            reads.append(slot)
        component = ComponentSlot(path, primitive, tuple(efforts), tuple(reads), multiplier)
        multiplier += component.multipliers
        components.append(component)
    return Descriptor(flat, tuple(states), tuple(junctions), tuple(components))


def _class_key(members: frozenset[Path]) -> Path:
    return min(members)


def _states(flat: System) -> tuple[list[StateSlot], dict[Path, StateSlot]]:
    states: list[StateSlot] = []
    provider: dict[Path, StateSlot] = {}
    at = rate = 0
    for path, primitive in flat.fillings.items():
        if not isinstance(primitive, Storage):
            continue
        for port, _, quantity in primitive.bundle.items():
            junction = flat.pattern.boxes[path].ports[port].junction
            key = _class_key(flat.pattern.state_class(junction))
            if key in provider:
                found = f"{provider[key].path} and {path / port}"
                raise AssemblyError("two-storages", path, junction=junction, found=found)
            slot = StateSlot(path / port, quantity, at, rate)
            provider[key] = slot
            states.append(slot)
            at += quantity.space.size
            rate += quantity.space.dim
    return states, provider
