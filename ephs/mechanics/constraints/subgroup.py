"""The smallest connected subgroup of SE(3) with given twists in its Lie algebra.

Bodies that are moved by joints with world twists ξ₁ … ξₖ (at one configuration) are displaced by products of
exp(ξᵢ sᵢ): they never leave the subgroup whose algebra is the closure of the ξᵢ under sums and brackets.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import least_squares, svd
from ephs.semantics.spaces.rank import ASSEMBLY


@final
@dataclass(frozen=True, slots=True, eq=False)
class Subgroup:
    """A connected subgroup of SE(3).

    Parameters
    ----------
    basis
        (6, n): an orthonormal basis of its algebra, angular part first, in the frame of the twists that generate it.
    """

    basis: Array

    @property
    def dim(self) -> int:
        """Its dimension."""
        return self.basis.shape[1]

    @property
    def translations(self) -> Array:
        """(3, k): an orthonormal basis of the translations in it."""
        turning = self.basis[:3]
        _, sizes, right = svd(turning)
        rank = int(np.sum(sizes > ASSEMBLY))
        return self.basis[3:] @ right[rank:].T

    @property
    def turning(self) -> Array:
        """(3, k): an orthonormal basis of its rotation axes."""
        left, sizes, _ = svd(self.basis[:3], full_matrices=False)
        return left[:, sizes > ASSEMBLY]

    def pitch(self) -> float:
        """Advance in m/rad along its one axis of rotation, without its translations."""
        axis = self.turning[:, 0]
        twist = self.basis @ least_squares(self.basis[:3], axis)
        free = self.translations
        return float(axis @ (twist[3:] - free @ (free.T @ twist[3:])))

    @property
    def name(self) -> str:
        """The usual name of its conjugacy class."""
        turns, shifts = self.turning.shape[1], self.translations.shape[1]
        if turns == 0:
            return ("1", "ℝ", "ℝ²", "ℝ³")[shifts]
        if turns == 1 and shifts <= 2 and abs(self.pitch()) > ASSEMBLY:
            return ("H", "H×ℝ", "H⋉ℝ²")[shifts]
        if turns == 1:
            return ("SO(2)", "SO(2)×ℝ", "SE(2)", "SE(2)×ℝ")[shifts]
        return "SO(3)" if shifts == 0 else "SE(3)"


def generated(twists: Array) -> Subgroup:
    """The smallest subgroup whose algebra has these twists (n, 6), angular part first, in one frame."""
    basis = np.zeros((6, 0))
    queue = [np.asarray(twist, dtype=float) for twist in twists]
    while queue and basis.shape[1] < 6:
        twist = queue.pop(0)
        size = float(np.linalg.norm(twist))
        if size <= ASSEMBLY:
            continue
        rest = twist / size
        for _ in range(2):
            rest = rest - basis @ (basis.T @ rest)
        left = float(np.linalg.norm(rest))
        if left <= ASSEMBLY:
            continue
        new = rest / left
        queue += [SE3.ad(basis[:, i]) @ new for i in range(basis.shape[1])]
        basis = np.column_stack([basis, new])
    return Subgroup(basis)
