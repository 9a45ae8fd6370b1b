"""Faces between points of bodies, for pictures."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.bundles.bundle import Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Faces:
    """Quadrilaterals whose corners move with bodies.

    Parameters
    ----------
    ends
        For each corner a body, or the ground, and its place (3,) in it, m.
    cells
        (n, 4) corners of each face.
    nodes
        Bodies that are corners and nothing else: they are not drawn.
    """

    ends: tuple[tuple[str, Array], ...]
    cells: NDArray[np.int64]
    nodes: frozenset[str]
