"""The nearest consistent state: Gauss-Newton on the poses, then a projection of the velocities, both in the
mass metric.

The least change is meant as ``½ δᵀ M δ`` with M the bodies' inertias, so that heavy bodies move least.
Redundant constraints, as every planar loop has in space, are met by least squares.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ephs.mechanics.scene.kinematics import AssemblyJoint, Scale, elements, largest_gap, largest_slip
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.decompositions import least_squares, svd, symmetric_eigen
from ephs.semantics.spaces.rank import ASSEMBLY, CONSTRAINT, LIGHT
from ephs.solve.running.threads import in_one_thread

ITERATIONS = 60


def mass_roots(masses: Array, inertias: Array) -> Array:
    """Inverse square roots (n, 6, 6) of the bodies' inertias; massless bodies count as very light."""
    roots = np.zeros((masses.shape[0], 6, 6))
    lightest = _least(masses)
    least = _least(np.trace(inertias, axis1=1, axis2=2))
    for root, mass, inertia in zip(roots, masses, inertias, strict=True):
        moments, axes = symmetric_eigen(inertia)
        root[:3, :3] = axes @ np.diag(np.maximum(moments, least) ** -0.5) @ axes.T
        root[3:, 3:] = max(mass, lightest) ** -0.5 * np.eye(3)
    return roots


def _least(values: Array) -> float:
    return LIGHT * (float(values.max(initial=0.0)) or 1.0)


@in_one_thread
def close_loops(
    links: Sequence[AssemblyJoint], poses: Array, roots: Array, held: frozenset[str], scale: Scale
) -> Array | None:
    """The nearest poses that satisfy every joint, the joints ``held`` at their coordinates; None where none
    is found."""
    poses = poses.copy()
    free = [_loose(link, held) for link in links]
    for _ in range(ITERATIONS):
        xs = elements(free, poses)
        if largest_gap(free, poses, xs, scale) < 0.01 * ASSEMBLY:
            break
        matrix, errors = constraints(free, poses, xs, roots, held, scale)
        steps = _steps(roots, _least_change(matrix, -errors))
        # Far from a solution, a full step may go round too far.
        steps /= max(1.0, float(np.abs(steps[:, :3]).max(initial=0.0)))
        poses = np.array([SE3.retract(q, v) for q, v in zip(poses, steps, strict=True)])
    return poses if largest_gap(free, poses, elements(free, poses), scale) < ASSEMBLY else None


@in_one_thread
def project_velocities(
    links: Sequence[AssemblyJoint], poses: Array, twists: Array, roots: Array, held: frozenset[str], scale: Scale
) -> Array | None:
    """The nearest twists that satisfy every joint and every prescribed rate; None where they contradict
    each other.

    The joints ``held`` keep the rates that they were given.
    """
    xs = elements(links, poses)
    blocks, wanted = [], []
    for link, x in zip(links, xs, strict=True):
        fixed = link.rate if link.name in held else None if link.motion is None else np.array([link.motion])
        forbidden = _across(link, x, scale) if fixed is None else scale.weights
        blocks.append(_row(link, x, forbidden, roots))
        wanted.append(
            forbidden.T @ (link.coupling.basis(x) @ fixed) if fixed is not None else np.zeros(forbidden.shape[1])
        )
    matrix, target = np.vstack(blocks), np.concatenate(wanted)
    start = np.concatenate([np.linalg.solve(root, u) for root, u in zip(roots, twists, strict=True)])
    change = _least_change(matrix, target - matrix @ start)
    found = _steps(roots, (start + change).reshape(-1, 6))
    fastest = max((float(np.linalg.norm(u[:3])) for u in found), default=0.0)
    fastest = max([fastest, *(float(np.linalg.norm(u[3:])) / scale.length for u in found)])
    now = Scale(scale.length, max(scale.rate, fastest))
    kept = [link if link.name in held else replace(link, rate=None) for link in links]
    return found if largest_slip(kept, found, xs, now) < ASSEMBLY else None


def _loose(link: AssemblyJoint, held: frozenset[str]) -> AssemblyJoint:
    """The joint free to take other coordinates, unless it is held."""
    if link.name in held or link.coordinates is None:
        return link
    return replace(link, coordinates=None, near=link.coupling.element(link.coordinates))


def constraints(
    links: Sequence[AssemblyJoint], poses: Array, xs: Sequence[Array], roots: Array, held: frozenset[str], scale: Scale
) -> tuple[Array, Array]:
    """Rows of the joints on all bodies' twists by roots, and by how much they are open; ``held`` ones allow nothing."""
    blocks, errors = [], []
    for link, x in zip(links, xs, strict=True):
        forbidden = scale.weights if link.name in held else _across(link, x, scale)
        blocks.append(_row(link, x, forbidden, roots))
        errors.append(forbidden.T @ link.error(poses, x))
    return np.vstack(blocks), np.concatenate(errors)


def across_rows(link: AssemblyJoint, x: Array, roots: Array, scale: Scale) -> tuple[Array, Array]:
    """Covectors (6, k) that vanish on what the joint allows, and their rows (k, 6 n) on all bodies' twists by roots."""
    across = _across(link, x, scale)
    return across, _row(link, x, across, roots)


def _across(link: AssemblyJoint, x: Array, scale: Scale) -> Array:
    """(6, 6 − d) covectors that vanish on what the joint allows, orthonormal where lengths count in the scale's."""
    basis = scale.weights @ link.coupling.basis(x)
    if not basis.shape[1]:
        return scale.weights
    return scale.weights @ svd(basis)[0][:, basis.shape[1] :]


def _row(link: AssemblyJoint, x: Array, forbidden: Array, roots: Array) -> Array:
    """The constraint's rows on all bodies, in coordinates where the mass metric is the identity."""
    row = np.zeros((forbidden.shape[1], roots.shape[0], 6))
    for body, matrix in zip((link.body1, link.body2), link.rows(x), strict=True):
        if body >= 0:
            row[:, body] += forbidden.T @ matrix @ roots[body]
    return row.reshape(forbidden.shape[1], 6 * roots.shape[0])


def _least_change(matrix: Array, target: Array) -> Array:
    """The shortest of the solutions that are best by least squares."""
    return np.asarray(least_squares(matrix, target, part=CONSTRAINT), dtype=np.float64)


def _steps(roots: Array, change: Array) -> Array:
    """From coordinates where the mass metric is the identity back to twists."""
    return np.einsum("nij,nj->ni", roots, change.reshape(-1, 6))
