"""A solution made of given states, not of a run: stored energies are theirs, heat and work what is given."""

from collections.abc import Sequence

import numpy as np

from ephs.mechanics.solve.integrate import solution_of
from ephs.mechanics.solve.model import Model
from ephs.mechanics.solve.natural import stored_energies
from ephs.mechanics.solve.problem import Problem
from ephs.mechanics.solve.record import Record
from ephs.mechanics.solve.solution import Solution
from ephs.semantics.bundle import Array
from ephs.semantics.primitives import Irreversible

__all__ = ["replay"]


def replay(
    problem: Problem,
    model: Model,
    t: Array,
    x: Sequence[Array],
    sums: Array | None = None,
    remark: str = "given states",
) -> Solution:
    """The solution of states x at the times t.

    Parameters
    ----------
    x
        (n,) of (point_size,) states.
    sums
        (n, 4 + components): heat, energy supplied, exergy supplied in J, entropy made in J/K, and the entropy that each
        component made; zero where None.
    """
    n, count = len(x), len(model.descriptor.components)
    kept = np.zeros((n, 4 + count)) if sums is None else sums
    makers = np.array([isinstance(slot.primitive, Irreversible) for slot in model.descriptor.components], dtype=bool)
    energies = np.array(
        [np.where(makers, row[4:], stored_energies(model, point)) for row, point in zip(kept, x, strict=True)]
    )
    ledgers = np.column_stack([kept[:, :4], np.zeros(n)])
    record = Record(np.asarray(t, dtype=float), np.array(x).reshape(n, -1), energies.reshape(n, count), ledgers)
    stats = {
        "method": remark, "form": "paper", "steps": max(0, n - 1), "rejected": 0, "setup_s": 0.0, "integrate_s": 0.0,
        "unknowns": model.unknowns, "least_production": 0.0,
    }  # fmt: skip
    return solution_of(problem, record, stats)
