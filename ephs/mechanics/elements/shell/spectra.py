"""Modes and critical loads of shells by sparse eigensolvers, counted by the signs of pivots so that none is missed."""

from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import LinearOperator, eigsh

from ephs.mechanics.elements.shell.mesh import Truths
from ephs.mechanics.elements.shell.shell import Shell
from ephs.mechanics.elements.shell.statics import ReducedTangent, displacements, factors, negative
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import symmetric_eigen

SHIFT: Final = 1e-9
"""Distance below 0, in parts of the largest frequency's square, from which eigenvalues are looked for."""
APART: Final = 1e-6
"""Relative distance above the last eigenvalue at which those below are counted."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Spectrum:
    """Eigenvalues, the lowest first, and their shapes.

    Attributes
    ----------
    values
        (k,) angular frequencies in rad/s (imaginary ones as negative numbers), or critical parts of a load.
    shapes
        (k, m, 6) turns and shifts of the nodes.
    """

    values: Array
    shapes: Array


def modes(shell: Shell, free: Truths, count: int, poses: Array | None = None) -> Spectrum:
    """The lowest angular frequencies at rest, or of a stressed equilibrium at poses (m, 7) under a load of dead forces.

    Parameters
    ----------
    free
        (m, 6) which coordinates move.
    count
        Number of frequencies; there are more where the last one is multiple, since all of its shapes are given.
    """
    reduced = ReducedTangent.of(shell.tangent(shell.poses if poses is None else poses), free)
    root = 1.0 / np.sqrt(shell.inertia.ravel()[reduced.at])
    scaled = diags_array(root) @ reduced.matrix @ diags_array(root)
    scaled = csc_array(0.5 * (scaled + scaled.T))
    size = float(abs(scaled).sum(axis=0).max())
    shift, ones = -SHIFT * size, diags_array(np.ones(len(root)))

    def counted(value: float) -> int:
        return negative(csc_array(scaled - value * ones))

    while counted(shift):  # ends at the largest column sum, below which there is no eigenvalue (Gershgorin)
        shift *= 10.0

    def lowest(k: int) -> tuple[Any, Any]:
        _, vectors = eigsh(scaled, k=k, sigma=shift, v0=_drawn(len(root)))
        values, turn = symmetric_eigen(vectors.T @ (scaled @ vectors))  # those of the inverse lose digits
        return values, vectors @ turn

    values, vectors = _complete(lowest, counted, count, len(root) - 1, SHIFT * size)
    return Spectrum(np.copysign(np.sqrt(np.abs(values)), values), _spread(shell, reduced, root[:, None] * vectors))


def buckling(shell: Shell, load: Array, free: Truths, count: int = 1) -> Spectrum:
    """The lowest positive parts of a load at which the shell buckles from its linear state.

    The geometric stiffness is that of the stress of small displacements; the eigenvalues are complete: the tangent has
    as many negative ones just above the last.

    Raises
    ------
    StructureError, NoEquilibrium
        As of `displacements`.
    """
    change = displacements(shell, load, free).ravel()[shell.places()]
    slopes = shell.slopes(shell.poses, np.zeros((len(shell.cells), 24)))
    stress = shell.of_changes(np.einsum("nij,nj->ni", slopes.strain, change))
    reduced = ReducedTangent.of(shell.assembled(slopes), free)
    bare = ReducedTangent.of(shell.assembled(shell.slopes(shell.poses, stress), elastic=False), free).matrix
    geometric = csc_array(0.5 * (bare + bare.T))
    stiff = csc_array(0.5 * (reduced.matrix + reduced.matrix.T))
    inverse = LinearOperator(stiff.shape, factors(stiff).solve, dtype=float)  # pyright: ignore

    def lowest(k: int) -> tuple[Array, Array]:
        values, vectors = eigsh(-geometric, k=k, M=stiff, Minv=inverse, which="LA", v0=_drawn(len(reduced.at)))
        kept = values > 0.0
        return 1.0 / values[kept], vectors[:, kept]

    values, vectors = _complete(
        lowest, lambda value: negative(csc_array(stiff + value * geometric)), count, len(change), 0.0
    )
    return Spectrum(values, _spread(shell, reduced, vectors))


def _complete(lowest: Any, counted: Any, count: int, most: int, apart: float) -> tuple[Array, Array]:
    """Eigenvalues in order, at least so many, and vectors: more are asked for until all below the last are there."""
    asked = min(count + 2, most)
    while True:
        values, vectors = lowest(asked)
        order = np.argsort(values)
        values, vectors = values[order], vectors[:, order]
        k = min(count, len(values))
        while k < len(values) and values[k] - values[k - 1] <= APART * abs(values[k - 1]) + apart:
            k += 1
        last = values[k - 1] + APART * abs(values[k - 1]) + apart if k else 0.0
        if not k or counted(last) <= k or asked >= most:
            return values[:k], vectors[:, :k]
        asked = min(2 * asked, most)


def _drawn(size: int) -> Array:
    """(size,) start of an iteration: the same in every call, and of no symmetry that would hide a mode."""
    return np.random.default_rng(0).standard_normal(size)


def _spread(shell: Shell, reduced: ReducedTangent, vectors: Array) -> Array:
    out = np.zeros((vectors.shape[1], 6 * len(shell.points)))
    out[:, reduced.at] = vectors.T
    return out.reshape(len(out), -1, 6)
