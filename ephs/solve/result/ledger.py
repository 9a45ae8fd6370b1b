"""Ledgers of a motion: stored energy, supply, heat, and entropy production."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain
from typing import final

import numpy as np

from ephs.operad import Path
from ephs.operad.charges import ENTROPY, VOLUME
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import ComponentSlot, Descriptor, StateSlot
from ephs.semantics.descriptor.numbering import Index
from ephs.semantics.primitives.primitives import Irreversible, Reversible, Storage
from ephs.semantics.systems.kept import once
from ephs.solve.posing.problem import Problem
from ephs.solve.result.record import RunRecord

FIELDS = ("flux_linkage", "magnetic_flux")
"""Kinds of fluxes: where nothing acts on one, it is the field of a permanent magnet, which no motion exchanges."""
KINETIC, POTENTIAL, THERMAL = 1, 2, 3
"""Kinds of energies of storages."""
AMOUNTS = ("entropy", "volume", "momentum")
"""Kinds of states that have a ledger of their own, where they are numbers."""
STILL = 1e-9
"""Least fraction of the energies that counts as exchanged, above the rounding of systems at rest."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Ledgers:
    """Ledgers of a motion, all (n,).

    Parameters
    ----------
    kinetic, potential, thermal
        Energies in J of storages with momenta or fluxes, of the others, and of those with entropies or volumes. Fields
        of permanent magnets are potential.
    environment
        θ₀ s − π₀ v + Σ μ₀ n of the reference environment, in J.
    exergy
        Σ H over the storages, in J.
    entropy
        Sum of all entropies, the environment's included, in J/K.
    heat, work, supplied
        Heat of friction and damping; energy and exergy supplied through outer ports: J since the start.
    made, least
        Entropy made since the start; least production of a component in the step before: J/K.
    storages, makers, workers
        Energy of each storage in J, entropy made by each irreversible component in J/K, energy that each component
        which does work over a step has supplied in J, by path.
    entropies, volumes, momenta
        Entropy in J/K, volume in m³ and momentum in N s of each storage that has one, by path.
    exergies
        Exergy of each storage in J, by path.
    temperature
        θ₀ of the reference environment, in K.
    engines
        Whether heat makes work: a storage has entropy beside other states.
    """

    kinetic: Array
    potential: Array
    thermal: Array
    environment: Array
    exergy: Array
    entropy: Array
    heat: Array
    work: Array
    supplied: Array
    made: Array
    least: Array
    storages: Mapping[Path, Array]
    makers: Mapping[Path, Array]
    workers: Mapping[Path, Array]
    entropies: Mapping[Path, Array]
    volumes: Mapping[Path, Array]
    momenta: Mapping[Path, Array]
    exergies: Mapping[Path, Array]
    temperature: float
    engines: bool = False

    @property
    def energy(self) -> Array:
        """Energy of everything, in J."""
        return self.kinetic + self.potential + self.thermal + self.environment

    @property
    def scale(self) -> float:
        """Largest K + |V − V₀| + |heat| + |work| over the run; where nothing moves, what the storages exchange; in J.

        What is destroyed counts as heat where it is more, as of reactions and of heat that is conducted. What stands
        still moves by rounding: a billionth of the energies is the least that counts.
        """
        v = self.potential
        if not v.size:
            return 1.0
        lost = np.maximum(np.abs(self.heat), self.temperature * np.abs(self.made))
        moved = float(np.max(self.kinetic + np.abs(v - v[0]) + lost + np.abs(self.work)))
        still = STILL * float(np.abs(v).max())
        if moved > still:
            return moved
        held = np.array([*self.storages.values(), 0.0 * v])
        return max(still, float(np.abs(held - held[:, :1]).sum(axis=0).max())) or 1.0

    def defect(self, mechanical: bool) -> Array:
        """Relative defect of the energy balance since the first row, (n,); ``mechanical``: of K + V + heat − work, too.

        That holds where nothing makes work of heat.
        """
        if not self.heat.size:
            return np.zeros(0)
        work, heat = self.work - self.work[0], self.heat - self.heat[0]
        defects = [self._change(self.kinetic, self.potential, self.thermal, self.environment) - work]
        if mechanical and not self.volumes and not self.engines:
            defects.append(self._change(self.kinetic, self.potential) + heat - work)
        return np.max(np.abs(defects), axis=0) / self.scale

    @staticmethod
    def _change(*energies: Array) -> Array:
        return np.sum([e - e[0] for e in energies], axis=0)  # differences first: a sum of large energies would round


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Books:
    """What ledgers read of the records of a system, by the numbers of its components.

    Parameters
    ----------
    paths
        Of all components.
    storages, environments
        Storages; those of the environment among them.
    makers, workers
        Irreversible components; those that do work over a step.
    kind
        (components,) the kind of its energy, 0 of what has none in a ledger.
    exchanging
        States of a storage whose charges the environment has, by its number.
    amounts
        One of `AMOUNTS`, the storage that has it, and its place in the states.
    engines
        See `Ledgers`.
    """

    paths: tuple[Path, ...]
    storages: tuple[int, ...]
    environments: tuple[int, ...]
    makers: tuple[int, ...]
    workers: tuple[int, ...]
    kind: Index
    exchanging: Mapping[int, tuple[StateSlot, ...]]
    amounts: tuple[tuple[str, int, int], ...]
    engines: bool

    @staticmethod
    def of(d: Descriptor) -> "_Books":
        """Of a flat system."""
        acted, engines, kind = _acting(d), False, np.zeros(len(d.components), dtype=np.int64)
        parts = [(number, slot.primitive) for number, slot in enumerate(d.components)]
        storages = [number for number, part in parts if isinstance(part, Storage)]
        for number in storages:
            slot = d.components[number]
            charged = [{ENTROPY, VOLUME} & dict(state.quantity.charges).keys() for state in slot.reads]
            moving = any(state.quantity.parity < 0 for state in slot.reads) and not _permanent(slot, acted)
            kind[number] = THERMAL if any(charged) else KINETIC if moving else POTENTIAL
            engines = engines or (len(charged) > 1 and any(charged))
        environments = [number for number, part in parts if isinstance(part, Storage) and part.environment]
        kind[environments] = 0
        reads = {number: d.components[number].reads for number in storages}
        outer = {k: tuple(state for state in states if state.quantity.environment) for k, states in reads.items()}
        return _Books(
            tuple(slot.path for slot in d.components), tuple(storages), tuple(environments),
            tuple(number for number, part in parts if isinstance(part, Irreversible)),
            tuple(number for number, part in parts if isinstance(part, Reversible) and part.working),
            kind, {number: states for number, states in outer.items() if states},
            tuple(
                (state.quantity.kind, number, state.point.start) for number, states in reads.items() for state in states
                if state.quantity.kind in AMOUNTS and state.point.stop - state.point.start == 1
            ), engines,
        )  # fmt: skip


def ledgers(problem: Problem, record: RunRecord) -> Ledgers:
    """Ledgers of a run's records."""
    d, reference, nothing = problem.descriptor, problem.reference, np.zeros(record.t.size)
    books = once(d, "books", lambda: _Books.of(d))
    paths, columns = books.paths, list(record.energies.T)
    shares = {
        k: sum((record.x[:, state.point] @ reference.intensive(state.quantity) for state in states), start=nothing)
        for k, states in books.exchanging.items()
    }
    energies = {k: columns[k] for k in books.storages} | {k: shares.get(k, nothing) for k in books.environments}
    free = {k: energies[k] - share for k, share in shares.items()} | dict.fromkeys(books.environments, nothing)
    kept: dict[str, dict[Path, Array]] = {kind: {} for kind in AMOUNTS}
    for kind, number, at in books.amounts:
        kept[kind][paths[number]] = kept[kind].get(paths[number], 0.0) + record.x[:, at]
    alone = books.kind > 0
    alone[list(free)] = False
    makers, workers = ({paths[k]: columns[k] for k in numbers} for numbers in (books.makers, books.workers))
    heat, work, supplied, made, least = record.ledgers.T
    return Ledgers(
        *(record.energies.sum(axis=1, where=books.kind == kind) for kind in (KINETIC, POTENTIAL, THERMAL)),
        environment=sum((energies[k] for k in books.environments), start=nothing),
        exergy=sum(free.values(), start=record.energies.sum(axis=1, where=alone)),
        entropy=sum(kept["entropy"].values(), start=nothing),
        heat=heat, work=work, supplied=supplied, made=made, least=least,
        storages={paths[k]: energy for k, energy in energies.items()}, makers=makers, workers=workers,
        entropies=kept["entropy"], volumes=kept["volume"], momenta=kept["momentum"],
        exergies={paths[k]: free.get(k, energy) for k, energy in energies.items()},
        temperature=reference.temperature, engines=books.engines,
    )  # fmt: skip


def _acting(d: Descriptor) -> Counter[int]:
    """Number of components and outer ports with a flow at each effort."""
    ports = (range(j.efforts.start, j.efforts.stop) for j in d.junctions if j.exposed)
    return Counter(chain.from_iterable((*(slot.efforts for slot in d.components), *ports)))


def _permanent(slot: ComponentSlot, acted: Counter[int]) -> bool:
    """Whether a storage is a flux that only it has a flow of: a field that stays as it is."""
    return all(state.quantity.kind in FIELDS for state in slot.reads) and all(acted[e] == 1 for e in slot.efforts)
