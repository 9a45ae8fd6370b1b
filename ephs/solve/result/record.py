"""Recording of a run: every step, or dense output at the times asked for."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Protocol, final

import numpy as np

from ephs.semantics.bundle import Array
from ephs.semantics.descriptor import Descriptor
from ephs.solve.methods.natural import Chunk
from ephs.solve.snapshot import Snapshot
from ephs.solve.stepping import Row

__all__ = ["Inside", "Record", "Recorder", "Rows", "joined", "record_of"]


class Inside(Protocol):
    """Dense output: from (time, states, energies, ledgers) at a step's start to the same at a time within the step."""

    def __call__(self, start: tuple[float, Array, Array, Array], when: float) -> tuple[Array, Array, Array]:
        """States, energies and ledgers then."""
        ...

    def snapshot(self) -> Snapshot | None:
        """Memory from one time to the next."""
        ...

    def restore(self, snapshot: Snapshot | None) -> None:
        """Go on from a snapshot."""
        ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class Record:
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


def record_of(times: Sequence[float], rows: Sequence[Row], least: Sequence[float]) -> Record:
    """Rows at some times, with the least production in the step before each."""
    return Record(
        np.array(times),
        np.array([row.x for row in rows]),
        np.array([row.energies for row in rows]),
        np.array([[*row.sums, production] for row, production in zip(rows, least, strict=True)]),
    )


def joined(records: Sequence[Record]) -> Record | None:
    """One after the other as one; None of none."""
    if len(records) < 2:
        return records[0] if records else None
    return Record(*(np.concatenate([getattr(r, f.name) for r in records]) for f in fields(Record)))


@final
class Rows:
    """Recorded instants in blocks, and the number of those in the journal."""

    def __init__(self) -> None:
        self._blocks: list[Record] = []
        self._written = 0

    def add(self, record: Record, *, written: bool = False) -> None:
        """Another block."""
        self._blocks.append(record)
        if written:
            self._written = len(self._blocks)

    def fresh(self) -> Record | None:
        """Instants since the last call."""
        found = joined(self._blocks[self._written :])
        self._written = len(self._blocks)
        return found

    def whole(self, descriptor: Descriptor) -> Record:
        """Everything."""
        empty = np.zeros((0, descriptor.point_size)), np.zeros((0, len(descriptor.components))), np.zeros((0, 5))
        return joined(self._blocks) or Record(np.zeros(0), *empty)


class Recorder:
    """Collects chunks of steps.

    Parameters
    ----------
    save_at
        Times to keep, ascending, or None for every step.
    inside
        (time, states, energies, ledgers) at a step's start, and a time within the step -> the same there.
    """

    def __init__(
        self, descriptor: Descriptor, t0: float, x0: Array, save_at: Array | None, inside: "Inside | None" = None
    ) -> None:
        self._d, self._t0, self._x0, self._inside = descriptor, t0, x0, inside
        self._save_at = None if save_at is None else np.asarray(save_at, dtype=float)
        self._next = 0
        self.rows = Rows()
        self._least = np.inf
        self._first: tuple[Array, Array, Array, Array] | None = None

    def start(self, energies: Array) -> None:
        """The row at t₀."""
        self._first = self._last = (np.array([self._t0]), self._x0[None, :], energies[None, :], np.zeros((1, 5)))
        if self._save_at is None or (self._save_at.size and self._save_at[0] == self._t0):
            self.rows.add(Record(*self._last))
            self._next = 1

    def add(self, t: Array, chunk: Chunk) -> None:
        """Rows of some steps that follow."""
        self._least = min(self._least, float(chunk.ledgers[:, 4].min(initial=np.inf)))
        fresh = (t, chunk.x, chunk.energies, chunk.ledgers)
        if self._save_at is None:
            self.rows.add(Record(*fresh))
        else:
            first = self._next
            self._next = int(np.searchsorted(self._save_at, t[-1], side="right"))
            wanted = self._save_at[first : self._next]
            if wanted.size:
                whole = tuple(np.concatenate([a, b]) for a, b in zip(self._last, fresh, strict=True))
                self.rows.add(Record(*self._between(wanted, *whole)))
        self._last = tuple(a[-1:] for a in fresh)

    def result(self) -> Record:
        """Everything kept so far."""
        return self.rows.whole(self._d)

    def snapshot(self) -> Snapshot:
        """Position of the recorder, without the rows."""
        inside = self._inside.snapshot() if self._inside is not None else None
        return {"next": self._next, "last": list(self._last), "least": float(self._least), "inside": inside}

    def restore(self, snapshot: Snapshot, rows: Record | None) -> None:
        """Position and rows of a recorder of the same run."""
        self._next, self._last = snapshot["next"], tuple(snapshot["last"])
        self._least = snapshot["least"]
        if self._inside is not None:
            self._inside.restore(snapshot["inside"])
        self.rows = Rows()
        if rows is not None:
            self.rows.add(rows, written=True)

    def ends(self) -> list[Record]:
        """The first row and that at the end of the last step, kept or not; none of a run that did not start."""
        if self._first is None:
            return []
        return [Record(*self._first), Record(*self._last)]

    @property
    def latest(self) -> tuple[Array, Array, Array]:
        """States, energies and sums at the end of the last step, kept or not."""
        _, x, energies, sums = self._last
        return x[-1], energies[-1], sums[-1]

    @property
    def least(self) -> float:
        """The least entropy production over all steps, kept or not, in J/K."""
        return float(self._least) if np.isfinite(self._least) else 0.0

    def _between(
        self, wanted: Array, t: Array, x: Array, energies: Array, ledgers: Array
    ) -> tuple[Array, Array, Array, Array]:
        i = np.clip(np.searchsorted(t, wanted, side="left") - 1, 0, t.size - 2)
        rows: list[tuple[Array, Array, Array]] = []
        for k, when in zip(i, wanted, strict=True):
            if when == t[k + 1] or self._inside is None:
                rows.append((x[k + 1], energies[k + 1], ledgers[k + 1]))
            elif when == t[k]:
                rows.append((x[k], energies[k], ledgers[k]))
            else:
                rows.append(self._inside((float(t[k]), x[k], energies[k], ledgers[k]), float(when)))
        states, stored, sums = (np.array(column) for column in zip(*rows, strict=True))
        return wanted, states, stored, sums
