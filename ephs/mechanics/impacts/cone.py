"""Impulses in friction cones: a complementarity problem, by a semismooth Newton method with Gauss-Seidel to start it.

With ξ = c + G P, of each contact

    0 ≤ P_n ⊥ ξ_n ≥ 0,   |P_t| ≤ μ P_n,   P_t = −μ P_n ξ_t/|ξ_t| where it slips,

as roots of P − proj(P − ρ ξ) (Alart and Curnier, *Computer Methods in Applied Mechanics and Engineering* 92 (1991),
353-375). Redundant contacts leave impulses indeterminate, whose sums are not: steps of least norm find some of them.
"""

from collections.abc import Sequence

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import least_squares
from ephs.semantics.spaces.rank import CONSTRAINT

SWEEPS = 200
"""Sweeps by Gauss and Seidel between two trials of Newton's method."""
TRIALS = 20
ITERATIONS = 40
HALVINGS = 12
EXACT = 1e-13
"""Rounding of the residual, relative to its terms."""
NEARLY = 1e-8
"""Likewise for nearly dependent contacts, where iterations stagnate."""


def impulses(whole: Array, free: Array, friction: Sequence[float], start: Array | None = None) -> Array | None:
    """Impulses P (3m,) of contacts, normal and two tangential ones each; None where none were found.

    Parameters
    ----------
    whole
        G (3m, 3m), symmetric and not negative.
    free
        c (3m,).
    friction
        Coefficients μ (m,).
    start
        Impulses near by, (3m,).
    """
    mu = np.asarray(friction, dtype=float)
    m = mu.size
    weight = np.array([np.trace(whole[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]) for i in range(m)])
    rho = np.repeat(1.0 / np.where(weight > 0.0, weight, 1.0), 3)
    if not m or np.all(free[::3] >= 0.0):
        return np.zeros(3 * m)
    found = np.zeros(3 * m) if start is None else start
    terms, before = float(np.abs(rho * free).max()), np.inf
    for _ in range(TRIALS):
        found, size = _newton(whole, free, mu, rho, found, EXACT * terms)
        if size <= EXACT * terms or 0.5 * before <= size <= NEARLY * terms:
            return _inside(found, mu)
        found, before = _swept(whole, free, mu, rho, found), size
    return None


def _inside(found: Array, mu: Array) -> Array:
    """Impulses projected onto their cones, which removes rounding."""
    out = found.reshape(-1, 3).copy()
    out[:, 0] = np.maximum(out[:, 0], 0.0)
    size, most = np.hypot(out[:, 1], out[:, 2]), mu * out[:, 0]
    out[:, 1:] *= np.where(size > most, most / np.where(size > 0.0, size, 1.0), 1.0)[:, None]
    return out.ravel()


def _newton(whole: Array, free: Array, mu: Array, rho: Array, start: Array, allowed: float) -> tuple[Array, float]:
    """Impulses of Newton's method, and their residual."""
    found = start
    left, slope = _residual(whole, free, mu, rho, found)
    size = float(np.abs(left).max())
    for _ in range(ITERATIONS):
        if size <= allowed:
            break
        step = least_squares(slope, -left, part=CONSTRAINT)
        share = 1.0
        for _ in range(HALVINGS):
            tried = found + share * step
            after, turned = _residual(whole, free, mu, rho, tried)
            grown = float(np.abs(after).max())
            if grown < size:
                break
            share *= 0.5
        else:
            break
        found, left, slope, size = tried, after, turned, grown
    return found, size


def _residual(whole: Array, free: Array, mu: Array, rho: Array, found: Array) -> tuple[Array, Array]:
    """P − proj(P − ρ ξ) and its derivative."""
    count = found.size
    target = found - rho * (free + whole @ found)
    inner = np.eye(count) - rho[:, None] * whole  # d target
    projected, slope = np.zeros(count), np.zeros((count, count))
    for i, coefficient in enumerate(mu.tolist()):
        at, across = 3 * i, slice(3 * i + 1, 3 * i + 3)
        normal = target[at]
        if normal <= 0.0:
            continue
        projected[at], slope[at] = normal, inner[at]
        radius, sides = coefficient * normal, target[across]
        size = float(np.hypot(*sides))
        if size <= radius:
            projected[across], slope[across] = sides, inner[across]
        elif coefficient > 0.0:
            along = sides / size
            projected[across] = radius * along
            turning = (np.eye(2) - np.outer(along, along)) * (radius / size)
            slope[across] = turning @ inner[across] + coefficient * np.outer(along, inner[at])
    return found - projected, np.eye(count) - slope


def _swept(whole: Array, free: Array, mu: Array, rho: Array, found: Array) -> Array:
    """Impulses after sweeps over the contacts, one after the other."""
    out = found.copy()
    for _ in range(SWEEPS):
        for i, coefficient in enumerate(mu.tolist()):
            at = slice(3 * i, 3 * i + 3)
            target = out[at] - rho[at] * (free[at] + whole[at] @ out)
            normal = max(float(target[0]), 0.0)
            size, most = float(np.hypot(target[1], target[2])), coefficient * normal
            share = 1.0 if size <= most else most / size
            out[at] = normal, share * target[1], share * target[2]
    return out
