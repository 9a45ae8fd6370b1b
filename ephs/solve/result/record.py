"""Kept instants of a run, as arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.solve.running.stepping import Instants, Row

UNSOLVED: Mapping[str, Any] = MappingProxyType({
    "method": "none", "form": "paper", "steps": 0, "rejected": 0, "unknowns": 0, "setup_s": 0.0, "integrate_s": 0.0,
    "least_production": 0.0,
})  # fmt: skip
"""Statistics of what no run has computed."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class RunRecord:
    """The kept rows of a run.

    Parameters
    ----------
    t
        (n,) in s.
    x
        (n, point_size) the states.
    energies
        (n, components): energy of each storage in J, entropy made by each irreversible component in J/K.
    ledgers
        (n, 5): heat, energy supplied, exergy supplied in J, entropy made in J/K, and the least entropy production of
        a component in the step that ended there.
    """

    t: Array
    x: Array
    energies: Array
    ledgers: Array

    def __getitem__(self, where: slice) -> "RunRecord":
        """Some of its rows."""
        return RunRecord(*(getattr(self, field.name)[where] for field in fields(RunRecord)))

    def row(self, k: int) -> Row:
        """The instant of a number."""
        return Row(self.x[k], self.energies[k], self.ledgers[k, :4])

    @property
    def rows(self) -> list[Row]:
        """Its instants one by one."""
        return list(map(self.row, range(self.t.size)))


def record_of(taken: Instants[Any], rows: Sequence[Row]) -> RunRecord:
    """Rows of states that were taken: times, states, and the least production in the step before each."""
    return RunRecord(
        np.array([t for t, _, _ in taken]),
        np.array([row.x for row in rows]),
        np.array([row.energies for row in rows]),
        np.array([[*row.sums, least] for row, (_, _, least) in zip(rows, taken, strict=True)]),
    )


def joined(records: Sequence[RunRecord]) -> RunRecord | None:
    """One after the other as one; None of none."""
    if len(records) < 2:
        return records[0] if records else None
    return RunRecord(*(np.concatenate([getattr(r, f.name) for r in records]) for f in fields(RunRecord)))


@final
class RowBlocks:
    """Recorded instants in blocks, and the number of those in the journal."""

    def __init__(self) -> None:
        self._blocks: list[RunRecord] = []
        self._written = 0

    def add(self, record: RunRecord, *, written: bool = False) -> None:
        """Another block."""
        self._blocks.append(record)
        if written:
            self._written = len(self._blocks)

    def ending_at(self, t: float) -> RunRecord | None:
        """The last instant; None where there is none, or it is at another time."""
        last = self._blocks[-1] if self._blocks else None
        if last is None or not last.t.size or last.t[-1] != t:
            return None
        return last[-1:]

    def fresh(self) -> RunRecord | None:
        """Instants since the last call."""
        found = joined(self._blocks[self._written :])
        self._written = len(self._blocks)
        return found

    def whole(self, descriptor: Descriptor) -> RunRecord:
        """Everything."""
        empty = np.zeros((0, descriptor.point_size)), np.zeros((0, len(descriptor.components))), np.zeros((0, 5))
        return joined(self._blocks) or RunRecord(np.zeros(0), *empty)
