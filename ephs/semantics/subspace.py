"""Linear subspaces of ℝⁿ with the operations that relations need, by orthonormal bases.

Rank is decided relative to the largest singular value, after each row of a kernel was brought to unit length:
this suits an oracle that compares relations, not an integrator.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.semantics.bundle import Array
from ephs.semantics.spaces.decompositions import svd
from ephs.semantics.spaces.rank import ELIMINATION, TINY, rank_of


@final
@dataclass(frozen=True, slots=True, eq=False)
class Subspace:
    """A subspace of ℝⁿ.

    Parameters
    ----------
    basis
        (n, r), orthonormal columns.
    condition
        Largest singular value, or the usual one, over the least that counted, and of equations the length before they
        were restricted to the subspace over that after; multiplied over the eliminations that led here: by what factor
        the basis may carry rounding.
    """

    basis: Array
    condition: float = 1.0

    @staticmethod
    def from_kernel(matrix: Array) -> "Subspace":
        """{z : matrix z = 0}; matrix (m, n)."""
        n = matrix.shape[1]
        norms = np.linalg.norm(matrix, axis=1) if matrix.size else np.zeros(0)
        rows = matrix[norms > 0.0] / norms[norms > 0.0, None] if matrix.size else matrix[:0]
        if not rows.size:
            return Subspace(np.eye(n))
        _, sigma, vt = svd(rows)
        rank = rank_of(sigma, ELIMINATION)
        return Subspace(np.ascontiguousarray(vt[rank:].T), _condition(sigma, rank, sigma[0]))

    @staticmethod
    def from_span(vectors: Array, usual: float = 0.0) -> "Subspace":
        """Span of the columns of vectors (n, r); columns small relative to the usual size count as rounding."""
        if not vectors.size:
            return Subspace(np.zeros((vectors.shape[0], 0)))
        u, sigma, _ = svd(vectors, full_matrices=False)
        rank = rank_of(sigma, ELIMINATION, usual)
        return Subspace(np.ascontiguousarray(u[:, :rank]), _condition(sigma, rank, max(sigma[0], usual)))

    @property
    def ambient(self) -> int:
        """n, the dimension of the ambient space."""
        return int(self.basis.shape[0])

    @property
    def dimension(self) -> int:
        """r, the dimension of the subspace."""
        return int(self.basis.shape[1])

    @property
    def projector(self) -> Array:
        """The orthogonal projector, (n, n)."""
        return self.basis @ self.basis.T

    def project(self, kept: Iterable[int]) -> "Subspace":
        """Keep some coordinates: ∃ the others. The rank is decided on an orthonormal basis, so it is well scaled."""
        return Subspace.from_span(self.basis[list(kept), :], 1.0)._after(self)

    def restrict(self, matrix: Array) -> "Subspace":
        """The vectors of this subspace which also satisfy matrix z = 0."""
        product = matrix @ self.basis
        # a dependent row leaves rounding, which is no equation
        lengths = np.linalg.norm(product, axis=1) / np.maximum(np.linalg.norm(matrix, axis=1), TINY)
        left = lengths > ELIMINATION
        coefficients = Subspace.from_kernel(product[left])
        shortened = 1.0 / lengths[left].min(initial=1.0)
        return Subspace(self.basis @ coefficients.basis, shortened * coefficients.condition)._after(self)

    def image(self, matrix: Array) -> "Subspace":
        """The image under a linear map, (m, n)."""
        return Subspace.from_span(matrix @ self.basis)._after(self)

    def direct_sum(self, other: "Subspace") -> "Subspace":
        """Side by side in ℝⁿ⁺ᵐ."""
        (n, r), (m, s) = self.basis.shape, other.basis.shape
        both = np.block([[self.basis, np.zeros((n, s))], [np.zeros((m, r)), other.basis]])
        return Subspace(both, max(self.condition, other.condition))

    def _after(self, before: "Subspace") -> "Subspace":
        return Subspace(self.basis, self.condition * before.condition)

    def distance(self, other: "Subspace") -> float:
        """Largest entry of the difference of the orthogonal projectors: 0 if equal, of order 1 if not."""
        if self.ambient != other.ambient:
            raise ValueError(f"subspaces of ℝ^{self.ambient} and ℝ^{other.ambient} cannot be compared")
        return float(np.abs(self.projector - other.projector).max(initial=0.0))

    def contains(self, vector: Array) -> float:
        """Distance of a vector from the subspace, relative to its length."""
        off = vector - self.basis @ (self.basis.T @ vector)
        return float(np.linalg.norm(off) / max(np.linalg.norm(vector), TINY))


def _condition(sigma: Array, rank: int, largest: float) -> float:
    return float(largest / sigma[rank - 1]) if rank else 1.0
