"""Attachments of a mechanism as one network with its own states, coupled at rates of joints and at heat.

Constant relations, the equality of efforts on a junction and the sum of its flows are contracted once. They form one
Dirac structure, so with the efforts e = N z of all junctions the flows that belong to z are Nᵀ f: what is left is to
call storages, and components that depend on states or make entropy. Here z are the rates of joints, temperatures of
heat that is booked as energy, prescribed efforts, efforts of storages, and efforts and multipliers that only a balance
of flows determines.

A storage whose effort constant relations tie to the rate of one joint has no state of its own: E = ½ J (g r)² is
inertia of the joint. What ties rates of joints to each other is a constraint of the mechanism, as the closing of a loop
is.
"""

from dataclasses import dataclass, field
from typing import final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import StateSlot


@final
@dataclass(frozen=True, slots=True)
class JointInertia:
    """A storage of E = p²/(2 J) whose effort is g times the rate of a joint: its state is J g r.

    Parameters
    ----------
    rate
        Place of the rate among those of the network.
    """

    component: int
    state: StateSlot
    rate: int
    ratio: float
    inertia: float


@final
@dataclass(frozen=True, slots=True)
class Tie:
    """A constant relation among rates of joints, as of a gear: Σ ratio · rate = 0.

    Parameters
    ----------
    terms
        (place of the rate among those of the network, ratio).
    """

    component: int
    terms: tuple[tuple[int, float], ...]


@final
@dataclass(frozen=True, slots=True)
class Injection:
    """A flow that is prescribed at an outer port, and the row (z,) by which it enters the balances."""

    port: Path
    place: int
    row: Array


@final
@dataclass(frozen=True, slots=True)
class Attached:
    """A component that is called: one that depends on states, or makes entropy.

    Parameters
    ----------
    rows
        (efforts + multipliers, z): the efforts, then the multipliers, of z.
    reads
        Paths of the states that it reads.
    heated
        Of each port of entropy, its effort and what takes it: a place among the booked entropies, then the states; −1
        where nothing is stored.
    """

    component: int
    rows: Array
    reads: tuple[Path, ...]
    heated: tuple[tuple[int, int], ...]


@final
@dataclass(frozen=True, slots=True)
class Network:
    """All attachments of a mechanism.

    Parameters
    ----------
    rates
        (junction, degree of freedom) of the rates in z.
    nodes
        Booked entropies whose temperatures are in z.
    inputs
        (port, place) of the prescribed efforts in z.
    storages
        (component, place of its first state among the states).
    states
        All states, in the order of their efforts in z.
    unknown
        How many entries of z, the last ones, follow from balances.
    skew
        (z, z): flows by efforts of the constant relations.
    """

    rates: tuple[tuple[int, int], ...] = ()
    nodes: tuple[int, ...] = ()
    inputs: tuple[tuple[Path, int], ...] = ()
    storages: tuple[tuple[int, int], ...] = ()
    states: tuple[StateSlot, ...] = ()
    unknown: int = 0
    skew: Array = field(default_factory=lambda: np.zeros((0, 0)))
    attached: tuple[Attached, ...] = ()
    inertias: tuple[JointInertia, ...] = ()
    injections: tuple[Injection, ...] = ()
    ties: tuple[Tie, ...] = ()

    @property
    def known(self) -> int:
        """Number of given entries of z."""
        return self.skew.shape[0] - self.unknown

    @property
    def state_at(self) -> int:
        """Start of the efforts of storages in z."""
        return len(self.rates) + len(self.nodes) + len(self.inputs)

    @property
    def acts(self) -> bool:
        """Whether something is left to evaluate: flows, efforts of storages, or what is given."""
        return bool(self.attached or self.storages or self.inputs or self.injections or self.skew.any())

    def ports(self) -> set[Path]:
        """Outer ports on it."""
        return {port for port, _ in self.inputs} | {one.port for one in self.injections}
