"""Linear subspaces of ℝⁿ by orthonormal bases: projectors of relations and their distances.

Rank is decided relative to the largest singular value, after each row of a kernel was brought to unit length. Nothing
of it is in the package: relations are held against it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.meaning import Instant
from ephs.semantics.spaces.rank import ELIMINATION, TINY, rank_of
from tests.numerics import largest


@final
@dataclass(frozen=True, slots=True, eq=False)
class Subspace:
    """A subspace of ℝⁿ.

    Parameters
    ----------
    basis
        (n, r), orthonormal columns.
    """

    basis: Array

    @staticmethod
    def from_kernel(matrix: Array) -> "Subspace":
        """{z : matrix z = 0}; matrix (m, n)."""
        n = matrix.shape[1]
        norms = np.linalg.norm(matrix, axis=1) if matrix.size else np.zeros(0)
        rows = matrix[norms > 0.0] / norms[norms > 0.0, None] if matrix.size else matrix[:0]
        if not rows.size:
            return Subspace(np.eye(n))
        _, sigma, vt = np.linalg.svd(rows)
        rank = rank_of(sigma, ELIMINATION)
        return Subspace(np.ascontiguousarray(vt[rank:].T))

    @staticmethod
    def from_span(vectors: Array, usual: float = 0.0) -> "Subspace":
        """Span of the columns of vectors (n, r); columns small relative to the usual size count as rounding."""
        if not vectors.size:
            return Subspace(np.zeros((vectors.shape[0], 0)))
        u, sigma, _ = np.linalg.svd(vectors, full_matrices=False)
        rank = rank_of(sigma, ELIMINATION, usual)
        return Subspace(np.ascontiguousarray(u[:, :rank]))

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
        return Subspace.from_span(self.basis[list(kept), :], 1.0)

    def distance(self, other: "Subspace") -> float:
        """Largest entry of the difference of the orthogonal projectors: 0 if equal, of order 1 if not."""
        if self.ambient != other.ambient:
            raise ValueError(f"subspaces of ℝ^{self.ambient} and ℝ^{other.ambient} cannot be compared")
        return float(largest(self.projector - other.projector, initial=0.0))

    def contains(self, vector: Array) -> float:
        """Distance of a vector from the subspace, relative to its length."""
        off = vector - self.basis @ (self.basis.T @ vector)
        return float(np.linalg.norm(off) / max(np.linalg.norm(vector), TINY))


def subspace_of(instant: Instant) -> Subspace:
    """The relation at an instant, of vectors in its order of variables."""
    return Subspace.from_kernel(instant.linear.matrix(instant.order))


def dirac(skew: Array, constraint: Array) -> Subspace:
    """{(f, e): f = L e + Cᵀ λ, 0 = C e}."""
    n, k = skew.shape[0], constraint.shape[0]
    rows = constraint / np.linalg.norm(constraint, axis=1, keepdims=True)
    kernel = np.block([[-np.eye(n), skew, rows.T], [np.zeros((k, n)), rows, np.zeros((k, k))]])
    return Subspace.from_kernel(kernel).project(range(2 * n))


def assert_dirac(skew: Array, constraint: Array) -> None:
    """The flows f = L e + Cᵀ λ at C e = 0 have half of all dimensions, and make and lose no power."""
    n, found = len(skew), dirac(skew, constraint)
    form = np.kron([[0.0, 1.0], [1.0, 0.0]], np.eye(n))
    assert found.dimension == n
    assert largest(found.basis.T @ form @ found.basis, initial=0.0) <= 1e-13
