"""Velocities put on the joints by the least change in the mass metric: of a few bodies, and of many by sparse matrices.

Where there are many, of each joint only the directions count that it does not allow. With the bodies' twists scaled by
the roots of their masses the change is Aᵀ λ with A Aᵀ λ = defect: a sparse matrix that couples joints at the same body.
Constraints may depend on one another; the iteration below then converges to one of the λ that serve.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from ephs.semantics.bundle import Array
from ephs.semantics.spaces.rank import CONSTRAINT, TINY
from ephs.solve.sparse import Index

__all__ = ["Held", "project", "project_dense"]

SHIFT = 1e-12
"""Added to the diagonal of A Aᵀ, relative to its largest entry."""
ROUNDS = 4
"""Each takes what the shift left of the defect by a factor of shift over eigenvalue."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """Constraint of a joint at n instants: Σ rows[body] · twist + basis · rate = 0, a prescribed rate being ``rate``.

    Parameters
    ----------
    rows
        Number of a body -> (n, 6, 6).
    basis
        (6, d), the same at all instants.
    """

    rows: Mapping[int, Array]
    basis: Array
    rate: float | None

    def across(self) -> Array:
        """(k, 6) the directions that count: all where the rate is prescribed, else those that the joint bars."""
        if self.rate is not None:
            return np.eye(6)
        return np.linalg.svd(self.basis, full_matrices=True)[0][:, self.basis.shape[1] :].T


def project(joints: Sequence[Held], roots: Array, twists: Array) -> tuple[Array, list[Array]]:
    """Twists on the joints, and the joints' rates.

    Parameters
    ----------
    roots
        (b, 6, 6) symmetric roots of the bodies' inverse inertias.
    twists
        (n, b, 6) in the bodies' frames.

    Returns
    -------
    (n, b, 6) twists, and (n, d) rates joint by joint.
    """
    from scipy.sparse import csr_array, identity
    from scipy.sparse.linalg import splu

    n, bodies = twists.shape[:2]
    values, places, right = _tabulated(joints, roots, n)
    shape = (right.size, 6 * bodies)
    out = np.array(twists)
    for i in range(n if right.size else 0):
        scaled: Any = csr_array((values[i], places), shape=shape)
        change = np.zeros(6 * bodies)
        # the defect at the given twists: A is applied to root⁻¹ u, which is known body by body
        white = np.linalg.solve(roots, twists[i][:, :, None]).reshape(-1)
        defect = right - scaled @ white
        normal = (scaled @ scaled.T).tocsc()
        shift = SHIFT * max(float(np.abs(normal.data).max(initial=0.0)), TINY)
        factors: Any = splu(normal + shift * identity(right.size, format="csc"))
        for _ in range(ROUNDS):
            change += scaled.T @ factors.solve(defect - scaled @ change)
        out[i] += np.einsum("bij,bj->bi", roots, change.reshape(bodies, 6))
    return out, [_rate(joint, out) for joint in joints]


def _tabulated(joints: Sequence[Held], roots: Array, n: int) -> tuple[Array, tuple[Index, Index], Array]:
    """Entries (n, ·) of A, their rows and columns, and the right-hand side."""
    entries: list[Array] = []
    rows: list[Index] = []
    columns: list[Index] = []
    right: list[Array] = []
    at = 0
    for joint in joints:
        across = joint.across()
        count = across.shape[0]
        for body, block in joint.rows.items():
            entries.append((across @ block @ roots[body]).reshape(n, -1))
            rows.append(np.repeat(np.arange(at, at + count), 6))
            columns.append(np.tile(np.arange(6 * body, 6 * body + 6), count))
        right.append(np.zeros(count) if joint.rate is None else -across @ joint.basis[:, 0] * joint.rate)
        at += count
    if at == 0:
        return np.zeros((n, 0)), (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)), np.zeros(0)
    return np.hstack(entries), (np.concatenate(rows), np.concatenate(columns)), np.concatenate(right)


def _rate(joint: Held, twists: Array) -> Array:
    """(n, d) of a joint, from the twists of its bodies."""
    if joint.rate is not None:
        return np.full((twists.shape[0], 1), joint.rate)
    relative = sum((np.einsum("nij,nj->ni", block, twists[:, body]) for body, block in joint.rows.items()), np.zeros(6))
    return -relative @ np.linalg.pinv(joint.basis).T


def project_dense(known: Array, unknown: Array, right: Array, twists: Array, roots: list[Array]) -> tuple[Array, Array]:
    """Twists nearest to the given ones in the mass metric with known·u + unknown·r = right, and such r."""
    inverse_of_unknown = np.linalg.pinv(unknown, rcond=CONSTRAINT) if unknown.shape[2] else np.zeros(unknown.shape).mT
    whitened = np.zeros_like(known)
    for i, root in enumerate(roots):
        where = slice(6 * i, 6 * i + 6)
        whitened[:, :, where] = known[:, :, where] @ root
    defect = np.einsum("nij,nj->ni", known, twists) - right
    rest = defect - np.einsum("nij,nj->ni", unknown @ inverse_of_unknown, defect)
    kept = whitened - unknown @ (inverse_of_unknown @ whitened)
    out = twists.copy()
    if roots:
        shift = np.einsum("nij,nj->ni", np.linalg.pinv(kept, rcond=CONSTRAINT), rest)
        for i, root in enumerate(roots):
            where = slice(6 * i, 6 * i + 6)
            out[:, where] -= shift[:, where] @ root
    r = -np.einsum("nij,nj->ni", inverse_of_unknown, np.einsum("nij,nj->ni", known, out) - right)
    return out, r
