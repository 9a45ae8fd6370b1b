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
from ephs.semantics.descriptor.descriptor import ComponentSlot
from ephs.semantics.primitives.primitives import Irreversible, Reversible, Storage
from ephs.solve.posing.problem import Problem
from ephs.solve.result.record import RunRecord

FIELDS = ("flux_linkage", "magnetic_flux")
"""Kinds of fluxes: where nothing acts on one, it is the field of a permanent magnet, which no motion exchanges."""
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
        exchanged = [np.abs(energy - energy[0]) for energy in self.storages.values()]
        return max(still, float(np.max(np.sum(exchanged, axis=0), initial=0.0))) or 1.0

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


def ledgers(problem: Problem, record: RunRecord) -> Ledgers:
    """Ledgers of a run's records."""
    n = record.t.size
    reference = problem.reference
    kinetic, potential, thermal, environment, exergy, entropy = (np.zeros(n) for _ in range(6))
    storages: dict[Path, Array] = {}
    makers: dict[Path, Array] = {}
    workers: dict[Path, Array] = {}
    entropies: dict[Path, Array] = {}
    amounts: dict[str, dict[Path, Array]] = {"entropy": entropies, "volume": {}, "momentum": {}}
    exergies: dict[Path, Array] = {}
    engines, acted = False, _acting(problem)
    for number, slot in enumerate(problem.descriptor.components):
        primitive = slot.primitive
        if isinstance(primitive, Irreversible):
            makers[slot.path] = record.energies[:, number]
        if isinstance(primitive, Reversible) and primitive.working:
            workers[slot.path] = record.energies[:, number]
        if not isinstance(primitive, Storage):
            continue
        exchanged: Array | None = None  # most storages are not involved: no arrays for them
        for state in slot.reads:
            if state.quantity.environment:
                share = record.x[:, state.point] @ reference.intensive(state.quantity)
                exchanged = share if exchanged is None else exchanged + share
            values = record.x[:, state.point]
            if state.quantity.kind in amounts and values.shape[1] == 1:
                book = amounts[state.quantity.kind]
                book[slot.path] = book.get(slot.path, 0.0) + values[:, 0]
            if state.quantity.kind == "entropy":
                entropy = entropy + values[:, 0]
        if primitive.environment:
            storages[slot.path] = np.zeros(n) if exchanged is None else exchanged
            environment = environment + storages[slot.path]
            exergies[slot.path] = np.zeros(n)
            continue
        energy = storages[slot.path] = record.energies[:, number]
        exergies[slot.path] = energy if exchanged is None else energy - exchanged
        exergy = exergy + exergies[slot.path]
        charged = [{ENTROPY, VOLUME} & dict(state.quantity.charges).keys() for state in slot.reads]
        if any(charged):
            thermal, engines = thermal + energy, engines or len(charged) > 1
        elif any(state.quantity.parity < 0 for state in slot.reads) and not _permanent(slot, acted):
            kinetic = kinetic + energy
        else:
            potential = potential + energy
    heat, work, supplied, made, least = record.ledgers.T
    return Ledgers(
        kinetic, potential, thermal, environment, exergy, entropy, heat, work, supplied, made, least,
        storages, makers, workers, entropies, amounts["volume"], amounts["momentum"], exergies, reference.temperature,
        engines,
    )  # fmt: skip


def _acting(problem: Problem) -> Counter[int]:
    """Number of components and outer ports with a flow at each effort."""
    d = problem.descriptor
    ports = (range(j.efforts.start, j.efforts.stop) for j in d.junctions if j.exposed)
    return Counter(chain.from_iterable((*(slot.efforts for slot in d.components), *ports)))


def _permanent(slot: ComponentSlot, acted: Counter[int]) -> bool:
    """Whether a storage is a flux that only it has a flow of: a field that stays as it is."""
    return all(state.quantity.kind in FIELDS for state in slot.reads) and all(acted[e] == 1 for e in slot.efforts)
