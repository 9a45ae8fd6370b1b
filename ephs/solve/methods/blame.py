"""Report of the equation with the largest residual at a failed step, by its component and in words."""

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.equations.model import Model, evaluate_at
from ephs.solve.equations.sparse import Index
from ephs.solve.methods.scales import NOTHING
from ephs.solve.posing.errors import Outcome, SolveError, worst_entry


def diverged(model: Model, dropped: Index, residual: Array, scale: Array) -> SolveError:
    """Equation with the largest residual of a failed iteration; (stages, rows) or (rows,) each.

    ``dropped`` (rows,) is 1 at constraint equations that are left out, as they follow from others.
    """
    size = model.unknowns
    with np.errstate(all="ignore"):
        worst = np.abs(residual.reshape(-1, size)) / _scales(model, scale.reshape(-1, size).max(axis=0))
    return _worst(Outcome.DIVERGED, model, np.where(dropped == 1, 0.0, worst.max(axis=0)))


def contradicted(model: Model, dropped: Index, x: Array, z: Array, h: float) -> SolveError:
    """Omitted equation that a solution of the others violates."""
    status, _, memory = evaluate_at(model, x, z, h)
    if status:
        return SolveError(Outcome.CONTRADICTION, "", "")
    ratio = np.abs(memory.residual) / _scales(model, memory.scale)
    return _worst(Outcome.CONTRADICTION, model, np.where(dropped == 1, ratio, 0.0))


def _scales(model: Model, scale: Array) -> Array:
    """(rows,): scales of the residuals, block by block."""
    block = model.tables.block
    whole = np.zeros(int(block.max(initial=-1)) + 1)
    np.maximum.at(whole, block, np.nan_to_num(scale))
    return np.maximum(whole[block], NOTHING)


def _worst(outcome: Outcome, model: Model, ratio: Array) -> SolveError:
    row = worst_entry(ratio)
    return SolveError(outcome, model.row_path(row), model.row_name(row))
