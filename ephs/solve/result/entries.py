"""Ledger of a component or subsystem: stored amounts, destruction, and the resulting supply.

Balances hold step by step: energy is supplied or stays; exergy is supplied, stays, or is destroyed, θ₀ times the
entropy made; entropy is supplied, stays, or is made; volume is supplied or stays. What the whole was supplied with is
known; what its changes leave beside that is the defect of the method's steps. What crossed the boundary of a part is
what its own changes leave, so a part's share of the defect is in there, and the parts' supplies add up to supply and
defect of the whole.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import reduce
from typing import final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.solve.result.ledger import Ledgers


@final
@dataclass(frozen=True, slots=True, eq=False)
class LedgerEntry:
    """The ledger of a component or subsystem, (n,) each.

    Parameters
    ----------
    path
        Where it is in the hierarchy; the root for the whole system.
    energy, exergy
        Stored, in J; of the reference environment the energy θ₀ s − π₀ v + Σ μ₀ n, and no exergy.
    entropy, volume, momentum
        Stored, in J/K, m³, N s; momenta are those of point masses, which add up.
    made, destroyed
        Entropy made since the start in J/K, and the exergy that this destroyed in J.
    defect, exergy_defect
        Of the whole: energy and exergy since the start, in J, that nothing supplied and nothing destroyed accounts for;
        zero of its parts.
    parts
        Entries one level below, by name.
    """

    path: Path
    energy: Array
    exergy: Array
    entropy: Array
    volume: Array
    momentum: Array
    made: Array
    destroyed: Array
    defect: Array
    exergy_defect: Array
    parts: Mapping[str, "LedgerEntry"] = field(default_factory=dict[str, "LedgerEntry"])

    @property
    def energy_supplied(self) -> Array:
        """(n,) energy that came in through the boundary since the start, in J."""
        return self.energy - self.energy[:1] - self.defect

    @property
    def exergy_supplied(self) -> Array:
        """(n,) exergy that came in through the boundary since the start, in J."""
        return self.exergy - self.exergy[:1] + self.destroyed - self.exergy_defect

    @property
    def entropy_supplied(self) -> Array:
        """(n,) entropy that came in through the boundary since the start, in J/K."""
        return self.entropy - self.entropy[:1] - self.made

    def __repr__(self) -> str:
        """Totals from the first to the last instant, here and one level below."""
        cells = self.rows()
        widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
        return "\n".join(
            "  ".join(
                cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths, strict=True))
            )
            for row in cells
        )

    def _repr_html_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        from ephs.solve.result.tables import ledger_table

        return ledger_table(self)

    def rows(self) -> list[tuple[str, ...]]:
        """The same as table cells: headings, units, then this level and each part one level below."""
        head = ("", "exergy stored", "supplied", "destroyed", "defect", "energy stored", "entropy stored", "made")
        units = ("", "J", "J", "J", "J", "J", "J/K", "J/K")
        rows = [
            (str(self.path) if self.path else "all", self),
            *((f"  {name}", part) for name, part in self.parts.items()),
        ]
        return [head, units, *((name, *map(_number, entry.changes())) for name, entry in rows)]

    def changes(self) -> tuple[float, ...]:
        """From first to last: exergy stored, supplied, destroyed, its defect; energy stored; entropy stored, made."""

        def change(values: Array) -> float:
            return float(values[-1] - values[0]) if values.size else 0.0

        exergies = (self.exergy, self.exergy_supplied, self.destroyed, self.exergy_defect)
        ledgers = (*exergies, self.energy, self.entropy, self.made)
        return tuple(change(values) for values in ledgers)


def entry_of(ledgers: Ledgers, path: Path) -> LedgerEntry | None:
    """Entry of a component or subsystem, None where no ledger exists at or below the path."""
    leaves = {leaf: entry for leaf, entry in _leaves(ledgers).items() if path.is_prefix_of(leaf)}
    if not leaves:
        return None
    found = _tree(path, leaves)
    if path or not found.energy.size:
        return found
    first = slice(None, 1)
    energy = found.energy - found.energy[first] - (ledgers.work - ledgers.work[first])
    exergy = found.exergy_supplied - found.exergy_supplied[first] - (ledgers.supplied - ledgers.supplied[first])
    return replace(found, defect=energy, exergy_defect=exergy)


def _tree(path: Path, leaves: Mapping[Path, LedgerEntry]) -> LedgerEntry:
    if path in leaves:
        return leaves[path]
    below: dict[str, dict[Path, LedgerEntry]] = {}
    for leaf, entry in leaves.items():
        below.setdefault(next(iter(leaf.relative_to(path))), {})[leaf] = entry
    parts = {name: _tree(path / Path((name,)), inner) for name, inner in below.items()}
    names = [field.name for field in fields(LedgerEntry)][1:-1]  # but its path and its parts
    sums = {name: reduce(np.add, [getattr(part, name) for part in parts.values()]) for name in names}
    return LedgerEntry(path, **sums, parts=parts)


def _leaves(ledgers: Ledgers) -> dict[Path, LedgerEntry]:
    nothing, out = np.zeros(ledgers.heat.size), dict[Path, LedgerEntry]()
    stored = ledgers.storages, ledgers.exergies, ledgers.entropies, ledgers.volumes, ledgers.momenta
    for path in dict.fromkeys([*ledgers.storages, *ledgers.makers]):
        *held, made = (book.get(path, nothing) for book in (*stored, ledgers.makers))
        out[path] = LedgerEntry(path, *[*held, made, ledgers.temperature * made, nothing, nothing])
    return out


def _number(value: float) -> str:
    return f"{value:.5g}"
