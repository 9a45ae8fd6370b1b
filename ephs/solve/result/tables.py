"""Solutions and ledgers as small HTML tables for notebooks."""

from typing import TYPE_CHECKING

from ephs.semantics.systems.markup import table

if TYPE_CHECKING:
    from ephs.solve.result.entries import LedgerEntry
    from ephs.solve.result.solution import Solution


def solution_table(solution: "Solution") -> str:
    """Summary of a run in a few lines: time, steps, balances."""
    if not len(solution):
        return table(repr(solution), (), ())
    made = float(solution.entropy[-1] - solution.entropy[0])
    rows = [
        ("time", f"{solution.t[0]:g} … {solution.t[-1]:g} s, {len(solution)} instants"),
        ("method", f"{solution.stats['method']}, {solution.stats['steps']} steps"),
        ("energy error, relative", f"{solution.energy_error.max():.1e}"),
        *([("joint gap", f"{solution.constraint_error.max():.1e} m, rad")] if solution.freedoms else []),
        ("heat", f"{solution.heat[-1]:.4g} J"),
        ("work", f"{solution.work[-1]:.4g} J"),
        ("exergy", f"{solution.exergy[0]:.5g} → {solution.exergy[-1]:.5g} J"),
        ("entropy made", f"{made:.4g} J/K"),
    ]
    return table(f"Solution of {solution.name}", (), rows)


def ledger_table(entry: "LedgerEntry") -> str:
    """A ledger with those one level below."""
    (_, *head), (_, *units), *rows = entry.rows()
    words = [f"{word} [{unit}]" for word, unit in zip(head, units, strict=True)]
    return table("Ledger", ("", *words), rows)
