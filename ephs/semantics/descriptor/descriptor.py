"""The square descriptor form of a system, assembled without choosing causality.

Unknowns: the rate of every storage port, the effort of every power junction, the multipliers of the constraints, the
flow of every outer port whose effort is prescribed. Equations: e = dH at the storages, flows sum to zero at every
power junction, the constraints, e = input. So it is square for every pattern.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain, islice
from typing import final

import numpy as np

from ephs.operad import Path, Quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import AssemblyError, listed
from ephs.semantics.descriptor.numbering import Index, Numbering, bearing_junctions, number_flat, starts
from ephs.semantics.primitives.behaviour import ContinuousBehaviour, NaturalBehaviour, Relating, Storing
from ephs.semantics.primitives.primitives import Irreversible, Point, Primitive, Reversible, Storage
from ephs.semantics.spaces import Pair, manifold
from ephs.semantics.systems.kept import Kept, once
from ephs.semantics.systems.system import System


@final
@dataclass(frozen=True, slots=True)
class StateSlot:
    """Position of the state of one storage port: x[at:at+size], its rate w[rate:rate+dim]."""

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

    def element(self, value: Array) -> Array:
        """The state as the relations read it, of its value in a solution: a relative pose as element of its group."""
        relative = self.quantity.kind == "relative_pose"
        return Pair.from_space(self.quantity.space).element(value) if relative else value


@final
@dataclass(frozen=True, slots=True)
class ComponentSlot:
    """One primitive: indices of its ports' efforts, of the states that it reads, and of its multipliers."""

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
    """The descriptor form of a system, and its plain evaluation.

    Parameters
    ----------
    system
        The system, nested or flat; slots have the paths of the flattened one, and are made when they are asked for.
    numbering
        Which component lies on which junctions and reads which states.
    """

    system: System
    numbering: Numbering
    _kept: Kept = field(default_factory=Kept, init=False, repr=False)
    _states: tuple[StateSlot, ...] | None = field(default=None, init=False, repr=False)
    _junctions: tuple[JunctionSlot, ...] | None = field(default=None, init=False, repr=False)
    _components: tuple[ComponentSlot, ...] | None = field(default=None, init=False, repr=False)

    @property
    def states(self) -> tuple[StateSlot, ...]:
        """The states, storage by storage."""
        if self._states is None:
            object.__setattr__(self, "_states", tuple(self._state_slots()))
        return self._states or ()

    @property
    def junctions(self) -> tuple[JunctionSlot, ...]:
        """The power junctions."""
        if self._junctions is None:
            n, outer = self.numbering, set(self.numbering.outer.tolist())
            of: list[int] = n.junctions.tolist()
            at: list[int] = self._efforts.tolist()
            found = tuple(
                JunctionSlot(path, n.quantities[of[i]], at[i], i in outer)
                for i, path in enumerate(bearing_junctions(self.system.flatten()))
            )
            object.__setattr__(self, "_junctions", found)
        return self._junctions or ()

    @property
    def components(self) -> tuple[ComponentSlot, ...]:
        """The components."""
        if self._components is None:
            object.__setattr__(self, "_components", tuple(self._component_slots()))
        return self._components or ()

    @property
    def storages(self) -> list[tuple[ComponentSlot, Storage]]:
        """The components that store energy, with their primitives."""
        return [(slot, slot.primitive) for slot in self.components if isinstance(slot.primitive, Storage)]

    @property
    def outer(self) -> tuple[JunctionSlot, ...]:
        """The exposed power junctions."""

        def slots() -> tuple[JunctionSlot, ...]:
            n, efforts = self.numbering, self._efforts
            ports = [path for path, port in self.system.interface.items() if port.power]
            return tuple(
                JunctionSlot(path, n.quantities[n.junctions[i]], int(efforts[i]), True)
                for path, i in zip(ports, n.outer.tolist(), strict=True)
            )

        return once(self, "outer", slots)

    @property
    def strikes(self) -> Path | None:
        """The first component that has impulses; None where none has."""

        def first() -> Path | None:
            n = self.numbering
            struck = [isinstance(one, Irreversible) and one.impulse is not None for one in n.primitives]
            found = np.flatnonzero(np.array(struck, dtype=bool)[n.primitive])
            return self.components[int(found[0])].path if found.size else None

        return once(self, "strikes", first)

    @property
    def point_size(self) -> int:
        """Length of the state vector."""
        return int(self.numbering.sizes(self.numbering.states).sum())

    @property
    def rate_size(self) -> int:
        """Number of rates."""
        return int(self.numbering.dims(self.numbering.states).sum())

    @property
    def effort_size(self) -> int:
        """Number of efforts."""
        return int(self.numbering.dims(self.numbering.junctions).sum())

    @property
    def multiplier_size(self) -> int:
        """Number of multipliers."""
        return int(self.numbering.multipliers.sum())

    @property
    def _efforts(self) -> Index:
        """(junctions,) index of each effort."""
        return starts(self.numbering.dims(self.numbering.junctions))

    def _state_slots(self) -> Iterator[StateSlot]:
        at = rate = 0
        for path, primitive in self.system.leaves():
            if isinstance(primitive, Storage):
                for port, _, quantity in primitive.bundle.items():
                    yield StateSlot(path / port, quantity, at, rate)
                    at += quantity.space.size
                    rate += quantity.space.dim

    def _component_slots(self) -> Iterator[ComponentSlot]:
        n, states = self.numbering, self.states
        dims: list[int] = n.dims(n.junctions).tolist()
        numbers = iter(range(self.effort_size))
        on = [tuple(islice(numbers, dim)) for dim in dims]  # shared by all components on a junction
        wired: list[int] = n.wires.tolist()
        at = [on[i] for i in wired]
        multipliers = starts(n.multipliers).tolist()
        reads: list[int] = n.reads.tolist()
        wire = read = 0
        counts: dict[int, tuple[int, int]] = {}  # equal elements share their primitives
        for (path, primitive), multiplier in zip(self.system.leaves(), multipliers, strict=True):
            if id(primitive) not in counts:
                counts[id(primitive)] = len(primitive.bundle.ports), len(primitive.reads)
            wires, width = counts[id(primitive)]
            index = at[wire] if wires == 1 else tuple(chain.from_iterable(at[wire : wire + wires]))
            slots = tuple(states[i] for i in reads[read : read + width])
            yield ComponentSlot(path, primitive, index, slots, multiplier)
            wire, read = wire + wires, read + width

    def pack(self, state: Mapping[Path, Array]) -> Array:
        """The state vector (point_size,) from values by path."""
        return np.concatenate([np.zeros(0), *(state[slot.path] for slot in self.states)])

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
                raise AssemblyError("unknown-input", path, expected=listed(path, names))
        for path, slot in names.items():
            if path not in given:
                raise AssemblyError("missing-input", path)
            dim = slot.quantity.space.dim
            if given[path].value.shape != (dim,):
                raise AssemblyError("input", path, found=given[path].value, expected=f"{dim} numbers")
        return given

    def residual(
        self, behaviour: ContinuousBehaviour | NaturalBehaviour, x: Array, inputs: Mapping[Path, Input], z: Array
    ) -> Array:
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


def descriptor_of(system: System) -> Descriptor:
    """Descriptor form of a system, numbered component by component.

    Raises
    ------
    AssemblyError
        A state stored twice, or read and stored nowhere.
    """
    return Descriptor(system, number_flat(system.flatten()))
