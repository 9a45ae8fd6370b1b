"""Report of the equation with the largest residual at a failed step, by its component and in words."""

from typing import final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.errors import Outcome, SolveError
from ephs.solve.methods.scales import NOTHING
from ephs.solve.model import Model, evaluate_at
from ephs.solve.sparse import Index


@final
class Blame:
    """Names the equations of a model.

    Parameters
    ----------
    dropped
        (rows,) 1 at constraint equations that are left out, as they follow from others.
    """

    def __init__(self, model: Model, dropped: Index) -> None:
        self.model, self._dropped = model, dropped == 1

    def diverged(self, residual: Array, scale: Array) -> SolveError:
        """Equation with the largest residual of a failed iteration; (stages, rows) or (rows,) each."""
        size = self.model.unknowns
        with np.errstate(all="ignore"):
            worst = np.abs(residual.reshape(-1, size)) / self._scales(scale.reshape(-1, size).max(axis=0))
        ratio = np.where(self._dropped, 0.0, worst.max(axis=0))
        return self._of(Outcome.DIVERGED, ratio)

    def contradicted(self, x: Array, z: Array, h: float) -> SolveError:
        """Omitted equation that a solution of the others violates."""
        status, _, memory = evaluate_at(self.model, x, z, h)
        if status:
            return SolveError(Outcome.CONTRADICTION, "", "")
        ratio = np.abs(memory.residual) / self._scales(memory.scale)
        return self._of(Outcome.CONTRADICTION, np.where(self._dropped, ratio, 0.0))

    def _scales(self, scale: Array) -> Array:
        """(rows,): scales of the residuals, block by block."""
        block = self.model.tables.block
        whole = np.zeros(int(block.max(initial=-1)) + 1)
        np.maximum.at(whole, block, np.nan_to_num(scale))
        return np.maximum(whole[block], NOTHING)

    def _of(self, outcome: Outcome, ratio: Array) -> SolveError:
        row = int(np.argmax(np.nan_to_num(ratio, nan=np.inf)))
        return SolveError(outcome, self.model.row_path(row), self.model.row_name(row))
