"""Accounts of a system at one state: stored amounts and entropy production by component."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.operad import Path
from ephs.operad.charges import ENTROPY, VOLUME
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.primitives.primitives import Irreversible, Storage

if TYPE_CHECKING:
    from ephs.semantics.systems.system import System

State = Mapping[str, object]


@final
@dataclass(frozen=True, slots=True)
class Account:
    """Stored energy and exergy in J, up to a constant of each storage, entropy in J/K, volume in m³.

    Parameters
    ----------
    charges
        Amounts of all other charges by name: of elements in mol.
    """

    energy: float
    exergy: float
    entropy: float
    volume: float
    charges: Mapping[str, float] = field(default_factory=dict[str, float])

    def __add__(self, other: "Account") -> "Account":
        names = dict.fromkeys([*self.charges, *other.charges])
        return Account(
            self.energy + other.energy,
            self.exergy + other.exergy,
            self.entropy + other.entropy,
            self.volume + other.volume,
            {name: self.charges.get(name, 0.0) + other.charges.get(name, 0.0) for name in names},
        )


@final
@dataclass(frozen=True, slots=True)
class Ledger:
    """Accounts of a system; a call with a state returns the `Account` of each storage by its path.

    Over a motion, energy changes by what is supplied at the outer ports, exergy by that less θ₀ times the entropy that
    the `producers` make. A `Solution` has the same totals over time: ``sol.ledger(path)``.
    """

    system: "System"

    @property
    def storages(self) -> tuple[Path, ...]:
        """Components that store."""
        return tuple(path for path, primitive in self.system.leaves() if isinstance(primitive, Storage))

    @property
    def producers(self) -> tuple[Path, ...]:
        """Components that may make entropy."""
        return tuple(path for path, primitive in self.system.leaves() if isinstance(primitive, Irreversible))

    def __call__(self, state: State | None = None, reference: Reference | None = None) -> dict[Path, Account]:
        """The account of each storage.

        Parameters
        ----------
        state
            Values of states by path; the others are at the identity of their space.

        Raises
        ------
        AssemblyError
            An unknown path, a wrong shape, or a number that is not finite.
        """
        values = self.system.state({str(path): value for path, value in (state or {}).items()})
        given = reference or Reference()
        return {
            path: _account(primitive, {port: values[path / port] for port in primitive.bundle.ports}, given)
            for path, primitive in self.system.leaves()
            if isinstance(primitive, Storage)
        }

    def total(self, state: State | None = None, reference: Reference | None = None) -> Account:
        """The accounts of all storages together, the environment's included."""
        return sum(self(state, reference).values(), Account(0.0, 0.0, 0.0, 0.0))

    def __str__(self) -> str:
        stored = ", ".join(map(str, self.storages)) or "nothing"
        return f"stored in {stored}; entropy is made by {', '.join(map(str, self.producers)) or 'nothing'}"


def _account(storage: Storage, x: dict[Path, Array], reference: Reference) -> Account:
    held: dict[str, float] = {ENTROPY: 0.0, VOLUME: 0.0}
    for port, _, quantity in storage.bundle.items():
        for name, row in quantity.charges:
            held[name] = held.get(name, 0.0) + float(np.array(row) @ x[port])
    entropy, volume = held.pop(ENTROPY), held.pop(VOLUME)
    return Account(storage.total_energy(x, reference), storage.exergy(x, reference), entropy, volume, held)
