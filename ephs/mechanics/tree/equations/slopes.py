"""Directional derivatives of a mechanism's dense equations, several at a time, by dual numbers."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, final

import numpy as np

from ephs.mechanics.tree.engine.residuals import ACTIVE
from ephs.semantics.bundles.bundle import Array
from ephs.solve.equations.sparse import Index

if TYPE_CHECKING:
    from ephs.mechanics.tree.equations.residual import Residual

DIRECTIONS: Final = 4
"""Directions of one call: vector units take four."""


@final
class EquationSlopes:
    """Derivatives where a mechanism's equations were evaluated last."""

    def __init__(self, residual: "Residual") -> None:
        self._residual = residual
        names = (*ACTIVE, "a")
        self._slopes = {name: np.zeros((*residual.arrays[name].shape, DIRECTIONS)) for name in names}
        self._calls: dict[str, Any] = {}
        self._outs: dict[str, Array] = {}

    def _call(self, name: str) -> Any:
        if name not in self._calls:
            found, out = self._residual, self._residual.outs[name]
            program = found.program.tangent(name, DIRECTIONS)
            pairs: dict[str, Any] = {key: (found.arrays[key], slopes) for key, slopes in self._slopes.items()}
            self._outs[name] = np.zeros((out.size, DIRECTIONS))
            self._calls[name] = found.bound(program.compiled(), name, **pairs, out=(out, self._outs[name]))
        return self._calls[name]

    def of(self, name: str, seeds: Mapping[str, Array], count: int, beside: str = "value") -> tuple[Array, Array]:
        """(size, count) derivatives of a function along the last axes of seeds, arguments by name, and those of an
        argument that the function writes, with ``count`` as its last axis.

        Parameters
        ----------
        name
            ``residual`` or ``action``.
        """
        call, written = self._call(name), self._slopes[beside]
        out = self._outs[name]
        found, other = np.empty((out.shape[0], count)), np.empty((*written.shape[:-1], count))
        for first in range(0, count, DIRECTIONS):
            here = min(DIRECTIONS, count - first)
            for key, seed in seeds.items():
                self._slopes[key][..., :here] = seed[..., first : first + here]
                self._slopes[key][..., here:] = 0.0
            call()
            found[:, first : first + here] = out[:, :here]
            other[..., first : first + here] = written[..., :here]
        for key in seeds:
            self._slopes[key][:] = 0.0
        return found, other

    def along(self, name: str, arguments: Sequence[str], wanted: Index | None = None) -> Array:
        """(size, k) derivatives by all entries of vectors, in their order, or by those that are wanted."""
        sizes = [self._slopes[key].shape[0] for key in arguments]
        units = np.eye(sum(sizes))
        units = units if wanted is None else units[:, wanted]
        parts = np.split(units, np.cumsum(sizes)[:-1])
        return self.of(name, dict(zip(arguments, parts, strict=True)), units.shape[1])[0]
