"""Unknowns at a start where those of the storages alone are no guess: losses that vanish at rest in second order.

A damper with the force |v|·v has no slope at rest, so a step of Newton's method from there goes nowhere, although the
equations have a solution away from it.
"""

from typing import TYPE_CHECKING

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import least_squares
from ephs.solve.equations.model import Model
from ephs.solve.methods.records import STORING, efforts_of
from ephs.solve.methods.solvers import DENSE
from ephs.solve.posing.errors import SolveError

if TYPE_CHECKING:
    from ephs.solve.methods.continuous import Continuous
    from ephs.solve.methods.energies import EnergyEquations

ROUNDS = 100
"""Iterations: from far away each halves such an effort."""
SOLVED, ROUNDING = 1e-12, 1e-15
"""Parts of the terms of each equation, and of the largest of all, below which it is met."""


def unknowns_away(model: Model, equations: "Continuous | EnergyEquations", y: Array, inputs: Array) -> Array | None:
    """(unknowns,) a solution of the equations at an instant, from guesses with efforts of 1 and −1 that no storage
    gives; None where none is found, or the system is large.

    Parameters
    ----------
    y
        The numbers of the equations.
    inputs
        At the outer ports.
    """
    t, start = model.tables, equations.guess(y)
    rates, efforts = int(t.counts[0]), int(t.counts[1])
    given = efforts_of(t, np.flatnonzero(t.kind == STORING))
    free = rates + np.setdiff1d(np.arange(efforts), given)
    if not free.size or start.size > DENSE:
        return None
    for effort in (1.0, -1.0):
        z = start.copy()
        z[free] = effort
        if (found := _solved(equations, y, z, inputs)) is not None:
            return found
    return None


def _solved(equations: "Continuous | EnergyEquations", y: Array, z: Array, inputs: Array) -> Array | None:
    for _ in range(ROUNDS):
        try:
            residual = equations.residuals(y[None], z[None], inputs[None])[0]
            slopes = equations.matrices(y, z, inputs).unknowns
        except SolveError:
            return None
        whole = slopes if isinstance(slopes, np.ndarray) else slopes.toarray()
        if not (np.isfinite(whole).all() and np.isfinite(residual).all()):
            return None
        terms = np.abs(whole) @ np.abs(z)
        if np.all(np.abs(residual) <= SOLVED * terms + ROUNDING * terms.max()):
            return z
        z = z - np.asarray(least_squares(whole, residual), dtype=float)
    return None
