"""The fastest oscillation of a system at a state: the largest stiffness in relation to the inertia that it moves.

With velocities e = Z ν that satisfy the constraints, kinetic storages hold ½ eᵀ M e, and others, whose states have the
rates w = N e, the stiffness K: ω² are the eigenvalues of (N Z)ᵀ K (N Z) in the metric Zᵀ M Z. Dense, without losses.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.descriptor.curvature import curvature
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.semantics.primitives.primitives import Reversible
from ephs.semantics.spaces.decompositions import pseudoinverse, svd, symmetric_eigen
from ephs.semantics.spaces.rank import CONSTRAINT, ELIMINATION, TINY, rank_of
from ephs.solve.equations.instant import constraints_of, stored_efforts
from ephs.solve.equations.sparse import Index
from ephs.solve.posing.errors import SolveError
from ephs.solve.posing.problem import Problem

MOST = 600
"""Number of velocities above which the dense problem takes longer than what it explains."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Oscillations:
    """Undamped oscillations at a state, the slowest first.

    Parameters
    ----------
    rates
        (n,) angular frequencies in rad/s; 0 where nothing drives back.
    energies
        (n,) of each in J, kinetic and potential, about the equilibrium of the linearised forces.
    springs
        Path of the storage that holds most of the potential energy of each, by number.
    """

    rates: Array
    energies: Array
    springs: tuple[Path, ...]


def fastest_of(problem: Problem, x: Array) -> tuple[float, Path] | None:
    """Angular frequency in rad/s of the fastest oscillation about the states x, and its spring; None of none."""
    try:
        with np.errstate(all="ignore"):
            found = oscillations(problem, x)
    except (SolveError, SemanticsError, ArithmeticError, np.linalg.LinAlgError):  # as states of a failed run may be
        return None
    return (float(found.rates[-1]), found.springs[-1]) if found is not None and found.rates[-1] > 0.0 else None


def oscillations(problem: Problem, x: Array, pull: Array | None = None) -> Oscillations | None:
    """The oscillations about the states x (point_size,); None where nothing oscillates, or there is too much.

    Springs that losses hold back, or that move on slowly with all else, are stretched without oscillating, and so do
    masses move on whose springs give way, such as oil through a valve: with the rates of all states ``pull``
    (effort_size,), of momenta in N or N m, energies are no more than these say.
    """
    d = problem.descriptor
    moving = np.zeros(d.effort_size, dtype=bool)
    for slot in d.junctions:
        moving[slot.efforts] = slot.quantity.parity < 0
    kinetic, springs = _storages(d, problem, x, moving)
    if not kinetic or not springs or int(moving.sum()) > MOST:
        return None
    span = _velocities(problem, x, moving)
    inertia = np.zeros((d.effort_size, d.effort_size))
    for at, matrix in kinetic:
        inertia[np.ix_(at, at)] += pseudoinverse(matrix)
    held = span.T @ inertia @ span
    size = np.sqrt(np.maximum(np.diag(held), TINY))
    weights, axes = symmetric_eigen(held / np.outer(size, size))
    kept = weights > ELIMINATION * weights.max(initial=0.0)
    span = (span / size) @ (axes[:, kept] / np.sqrt(weights[kept]))  # of unit inertia; what has none is left out
    if not span.shape[1]:
        return None
    rates = _rates(d, x, span)
    parts = [rates[at].T @ (0.5 * (matrix + matrix.T)) @ rates[at] for _, at, matrix in springs]
    squares, modes = symmetric_eigen(np.sum(parts, axis=0))
    efforts = stored_efforts(d, problem.reference, x)
    known = np.array([efforts.get(i, 0.0) for i in range(d.effort_size)])
    push = np.sum([rates[at].T @ known[at] for _, at, _ in springs], axis=0) @ modes
    speed = (span @ modes).T @ inertia @ np.where(moving, known, 0.0)
    if pull is not None:
        push = np.minimum(np.abs(push), np.abs((span @ modes).T @ pull))
        jerk = np.abs(np.sum([rates[at].T @ matrix @ pull[at] for _, at, matrix in springs], axis=0) @ modes)
        speed = np.divide(jerk, squares, out=np.abs(speed), where=squares * np.abs(speed) > jerk)
    omega = np.sqrt(np.maximum(squares, 0.0))
    stiffest = np.argmax([np.sum(modes * (part @ modes), axis=0) for part in parts], axis=0)
    potential = np.divide(push, omega, out=np.zeros_like(push), where=omega > 0.0)
    return Oscillations(omega, 0.5 * (speed**2 + potential**2), tuple(springs[int(i)][0] for i in stiffest))


def _storages(
    d: Descriptor, problem: Problem, x: Array, moving: Array
) -> tuple[list[tuple[Index, Array]], list[tuple[Path, Index, Array]]]:
    """Kinetic storages and others: path, places of their efforts, derivative of these by their states."""
    kinetic: list[tuple[Index, Array]] = []
    springs: list[tuple[Path, Index, Array]] = []
    for slot, storage in d.storages:
        if not storage.environment and slot.efforts:
            at = np.array(slot.efforts, dtype=np.int64)
            if moving[at].all():
                kinetic.append((at, curvature(storage, d.point(slot, x), problem.reference)))
            elif not moving[at].any():
                springs.append((slot.path, at, curvature(storage, d.point(slot, x), problem.reference)))
    return kinetic, springs


def _rates(d: Descriptor, x: Array, span: Array) -> Array:
    """(effort_size, k) flows into storages alone on a junction, by efforts (effort_size, k)."""
    out = np.zeros_like(span)
    for slot in d.components:
        if isinstance(slot.primitive, Reversible):
            at = np.array(slot.efforts, dtype=np.int64)
            np.subtract.at(out, at, slot.primitive.structure(d.point(slot, x))[0] @ span[at])
    return out


def _velocities(problem: Problem, x: Array, moving: NDArray[np.bool_]) -> Array:
    """(effort_size, k) orthonormal velocities that satisfy all constraints, zero at ports with prescribed effort."""
    d = problem.descriptor
    rows = constraints_of(d, x)
    given = [np.eye(d.effort_size)[slot.efforts] for slot in d.outer if slot.path in problem.prescribed]
    matrix = np.vstack([rows, *given])[:, moving]
    norms = np.linalg.norm(matrix, axis=1)
    matrix = matrix[norms > 0.0] / norms[norms > 0.0, None]
    out = np.zeros((d.effort_size, int(moving.sum())))
    out[moving] = np.eye(out.shape[1])
    if not matrix.size:
        return out
    _, sigma, vt = svd(matrix)
    return out @ vt[rank_of(sigma, CONSTRAINT) :].T
