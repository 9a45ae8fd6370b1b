"""Points at which laws of systems are measured, and results of measurements."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np

from ephs.operad import Directory, Path, PortType
from ephs.semantics.bundles.bundle import Array, Bundle, Reference
from ephs.semantics.descriptor.descriptor import Input
from ephs.semantics.primitives.primitives import Irreversible, Storage
from ephs.semantics.systems.system import System
from ephs.semantics.verdicts.checks import random_point


@final
@dataclass(frozen=True, slots=True, eq=False)
class Probe:
    """Point at which laws are measured: a system at a state, over a step of h seconds.

    Parameters
    ----------
    state
        Values of the states of storages, and of those that are read and nobody stores.
    inputs
        What is prescribed at the outer power ports.
    efforts
        Arguments of the Onsager matrices by component, where a relation is taken at an instant.
    ports
        Values of states that outer ports show and nobody inside stores.
    """

    system: System
    state: Mapping[Path, Array]
    inputs: Mapping[Path, Input] = field(default_factory=dict[Path, Input])
    efforts: Mapping[Path, Array] = field(default_factory=dict[Path, Array])
    reference: Reference = field(default_factory=Reference)
    h: float = 1e-2
    ports: Mapping[Path, Array] = field(default_factory=dict[Path, Array])


@final
@dataclass(frozen=True, slots=True)
class Verdict:
    """Defect of a law, and the bound of its rounding."""

    defect: float
    tolerance: float
    detail: str

    @property
    def holds(self) -> bool:
        """Whether the defect is explained by rounding."""
        return self.defect <= self.tolerance


@final
@dataclass(frozen=True, slots=True)
class SystemLaw:
    """A law of systems: name, statement, and the measure of its defect."""

    name: str
    statement: str
    measure: Callable[[Probe], Verdict]

    def __call__(self, probe: Probe) -> Verdict:
        """Measure the law at a probe."""
        return self.measure(probe)


def random_probe(system: System, seed: int = 0, *, reference: Reference | None = None, h: float = 1e-2) -> Probe:
    """A probe at random states with random flows at the outer ports; storages of one state have one value.

    The default reference has a pressure of the size of the temperature: beside 10⁵ Pa the velocities would be rounding.
    """
    rng = np.random.default_rng(seed)
    state: dict[Path, Array] = {}
    efforts: dict[Path, Array] = {}
    for path, primitive in system.leaves():
        if isinstance(primitive, Storage):
            point = random_point(primitive.bundle, primitive.bundle.ports, rng)
            state |= {path / port: value for port, value in point.items()}
        elif isinstance(primitive, Irreversible):
            size = primitive.bundle.size
            hot = primitive.bundle.indicator("entropy") == 1.0
            efforts[path] = np.where(hot, rng.uniform(-30.0, 30.0, size), rng.standard_normal(size))
    inputs = {
        port: Input(0.1 * rng.standard_normal(quantity.space.dim), False)
        for port, _, quantity in Bundle.of(system.interface).items()
    }
    reference = reference or Reference(293.15, 300.0)
    ports: dict[Path, Array] = {}
    for each in system.relation(reference).classes:
        if each.stores:
            state |= dict.fromkeys(each.stores, state[each.name])
            continue
        layout = Bundle.of(Directory({each.name: PortType(each.quantity)}))
        (ports if each.ports else state).update(
            {(each.ports or (each.name,))[0]: random_point(layout, (each.name,), rng)[each.name]}
        )
    return Probe(system, state, inputs, efforts, reference, h, ports)
