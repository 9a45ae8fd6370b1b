"""Rest of shells under loads by sparse factors: small displacements, Newton's method, paths through limit points.

Loads (m, 6) are forces in the world's axes and moments in the nodes', which turn with them; ``free`` (m, 6) tells which
coordinates of the nodes move. The tangent takes the stress that the last step predicted rather than that of the moved
poses (Magisano, Leonetti and Garcea 2017): thin shells need half the iterations.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Self, final

import numpy as np
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import splu

from ephs.mechanics.elements.shell.mesh import Indices, Truths
from ephs.mechanics.elements.shell.shell import Shell, moved
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError

ITERATIONS: Final = 25
LARGEST: Final = 1.5
"""Largest turn of a node in one iteration, rad."""
SMALL: Final = 1e-9
"""Change of an iteration, in rad and in parts of the shell's size, that is its last: the next one is below rounding."""
WANTED: Final = 10
"""Iterations that a step along a path should take."""
SHORTEST: Final = 1e-6
"""Part of the first step below which a path is lost."""
SHIFTS: Final = (0.0, 1e-15, 3e-15, 1e-14)
"""Parts of a matrix's largest entry by which it is shifted until no pivot is exactly zero."""
PIVOT: Final = 1e-3
"""Part of a column's largest entry from which on the diagonal serves as the pivot."""


class NoEquilibrium(ArithmeticError):
    """No equilibrium was found where one was looked for."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class ShellPath:
    """Equilibria under a growing part of a load.

    Attributes
    ----------
    shares
        (k,) parts of the load; they fall beyond limit points.
    poses
        (k, m, 7) of the nodes.
    unstable
        (k,) in how many independent ways the energy falls: negative eigenvalues of the tangent.
    """

    shares: Array
    poses: Array
    unstable: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class ReducedTangent:
    """A tangent on the free coordinates.

    Attributes
    ----------
    at
        Their places among all.
    matrix
        (f, f) in sparse columns.
    """

    at: Indices
    matrix: csc_array

    @classmethod
    def of(cls, tangent: csc_array, free: Truths) -> Self:
        """That of a tangent (6m, 6m) and truths (m, 6)."""
        at = np.flatnonzero(free.ravel())
        return cls(at, csc_array(tangent[at][:, at]))

    def solver(self) -> Callable[[Array], Array]:
        """Factors as a function: (m, 6) changes of the coordinates that answer forces (m, 6).

        Raises
        ------
        NoEquilibrium
            The tangent is singular.
        """
        try:
            found = factors(self.matrix)
        except RuntimeError:
            raise NoEquilibrium("the tangent is singular: the shell is not held, or buckles here") from None

        def solved(right: Array) -> Array:
            out = np.zeros(right.size)
            out[self.at] = found.solve(right.ravel()[self.at])
            return out.reshape(-1, 6)

        return solved


def factors(matrix: csc_array) -> Any:
    """Sparse LU factors of a matrix whose pattern is symmetric, pivots on the diagonal where they can be."""
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=PIVOT, options={"SymmetricMode": True})


def negative(matrix: csc_array) -> int:
    """Number of negative eigenvalues of a symmetric sparse matrix: that of its negative pivots (Sylvester's law).

    If a pivot is exactly zero, a multiple of the unit matrix of the size of rounding is added.

    Raises
    ------
    NoEquilibrium
        The matrix is singular with each of these multiples.
    """
    symmetric: Any = csc_array(0.5 * (matrix + matrix.T))
    unit = eye_array(symmetric.shape[0], format="csc") * float(abs(symmetric).max())
    for shift in SHIFTS:
        try:
            found = splu(
                csc_array(symmetric + shift * unit), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )  # fmt: skip
        except RuntimeError:  # exactly singular
            continue
        if np.array_equal(found.perm_r, found.perm_c):
            return int((found.U.diagonal() < 0.0).sum())
    raise NoEquilibrium("the tangent is singular, so that its negative eigenvalues cannot be counted")


def displacements(shell: Shell, load: Array, free: Truths) -> Array:
    """(m, 6) small turns and shifts of the nodes under a load.

    Raises
    ------
    StructureError
        Load or free coordinates do not match the nodes.
    NoEquilibrium
        The shell is not held.
    """
    load, free = _matched(shell, load, free)
    return ReducedTangent.of(shell.tangent(shell.poses), free).solver()(load)


def equilibrium(
    shell: Shell, load: Array, free: Truths, poses: Array | None = None, *, change: Array | None = None
) -> tuple[Array, int]:
    """Poses (m, 7) at rest under a load, near given ones, and the number of iterations.

    Parameters
    ----------
    poses
        Where Newton's method starts; at rest where None.
    change
        (m, 6) by which held coordinates move first.

    Raises
    ------
    StructureError
        As of `displacements`.
    NoEquilibrium
        It does not converge: take parts of the load.
    """
    load, free = _matched(shell, load, free)
    found, count, _ = _newton(shell, free, shell.poses if poses is None else poses, lambda _: load, None, change)
    return found, count


def _newton(
    shell: Shell, free: Truths, poses: Array, load: Callable[[float], Array], plane: tuple[Array, float] | None,
    first: Array | None = None,
) -> tuple[Array, int, float]:  # fmt: skip
    """Poses, iterations and share; with a plane (normal (m, 6), share at its foot) the share is unknown, too."""
    stress, share, whole = shell.stress(poses), 0.0 if plane is None else plane[1], load(1.0)
    size = shell.size
    if first is not None and plane is not None:
        stress, poses, first = _predicted(shell, poses, first), moved(poses, first), None
    for count in range(1, ITERATIONS + 1):
        slopes, own = shell.slopes(poses, stress), shell.stress(poses)
        tangent = shell.assembled(slopes)
        force = shell.gathered(np.einsum("nij,ni->nj", slopes.strain, own)).reshape(-1, 6)
        left = load(share) - force
        if first is not None:
            left = left - (tangent @ first.ravel()).reshape(-1, 6)
        solved = ReducedTangent.of(tangent, free).solver()
        change = solved(left)
        if first is not None:
            change, first = change + first, None
        if plane is not None:
            along = solved(whole)
            below = float(np.sum(plane[0] * along))
            more = -float(np.sum(plane[0] * change)) / below if below else np.inf
            change, share = change + more * along, share + more
        largest = np.abs(change[:, :3]).max()
        if not (largest < LARGEST and np.isfinite(change).all()):
            break
        if max(largest, np.abs(change[:, 3:]).max() / size) <= SMALL:
            return moved(poses, change), count, share
        step = change.ravel()[shell.places()]
        stress = own + shell.of_changes(np.einsum("nij,nj->ni", slopes.strain, step))
        poses = moved(poses, change)
    raise NoEquilibrium(f"no equilibrium within {ITERATIONS} iterations; take smaller parts of the load")


def _predicted(shell: Shell, poses: Array, change: Array) -> Array:
    """(n, 24) stress after a change (m, 6), to first order."""
    own = shell.stress(poses)
    strain = shell.slopes(poses, own).strain
    return own + shell.of_changes(np.einsum("nij,nj->ni", strain, change.ravel()[shell.places()]))


def follow(
    shell: Shell,
    load: Array,
    free: Truths,
    until: float = 1.0,
    *,
    step: float = 0.1,
    most: int = 400,
    stop: Callable[[float, Array], bool] | None = None,
) -> ShellPath:
    """The path of equilibria from no load to a part of it, by its length through limit points (Riks).

    Parameters
    ----------
    until
        Part of the load at which it ends.
    step
        Of the first point: part of the load, as far as the shell is linear.
    most
        Points at most.
    stop
        Ends the path, called with the share and the poses (m, 7) of each point.

    Raises
    ------
    StructureError
        As of `displacements`.
    NoEquilibrium
        No point is found however short the step.
    """
    load, free = _matched(shell, load, free)
    metric = np.concatenate([np.full(3, 1.0), np.full(3, shell.size**-2)])
    here, share, before = shell.poses, 0.0, None
    reduced = ReducedTangent.of(shell.tangent(here), free)
    shares, points, unstable = [0.0], [here], [negative(reduced.matrix)]
    distance = 0.0
    while len(shares) < most:
        ahead = reduced.solver()(load)
        size = float(np.sqrt(np.sum(metric * ahead**2)))
        sign = 1.0 if before is None or np.sum(metric * ahead * before) > 0.0 else -1.0
        ahead = sign / size * ahead
        distance = step * size if before is None else distance
        plane, first = (metric * ahead, share + sign * distance / size), distance * ahead
        try:
            there, count, found = _newton(shell, free, here, lambda s: s * load, plane, first)
            last = (found - until) * (share - until) <= 0.0
            if last:
                found, (there, count, _) = until, _newton(shell, free, there, lambda _: until * load, None)
        except NoEquilibrium:
            distance *= 0.5
            if distance < SHORTEST * min(1.0, step * size):
                raise
            continue
        before, here, share = ahead, there, found
        reduced = ReducedTangent.of(shell.tangent(here), free)
        shares.append(share)
        points.append(here)
        unstable.append(negative(reduced.matrix))
        if last or (stop is not None and stop(share, here)):
            break
        distance *= float(np.clip(np.sqrt(WANTED / count), 0.5, 1.5))
    return ShellPath(np.array(shares), np.array(points), np.array(unstable))


def _matched(shell: Shell, load: Any, free: Any) -> tuple[Array, Truths]:
    shape = (len(shell.points), 6)
    load, free = np.asarray(load, dtype=float), np.asarray(free)
    for key, found, sound, expected in (
        ("load", load, np.isfinite(load).all(), "finite numbers"),
        ("free", free, free.dtype == bool and free.any(), "truths, some of them true,"),
    ):
        if found.shape != shape or not sound:
            what = f"an array of {found.dtype} of shape {found.shape}"
            raise StructureError("parameter", "shell", key=key, found=what, expected=f"{expected} {shape}")
    return load, free
