"""Collocation methods: polynomials through the stages, and Radau IIA with any odd number of them.

Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.5 and IV.8: eigenvalues of the coefficients split
Newton's method for all stages into one real and some complex systems of the size of one stage.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import final

import numpy as np
from numpy.polynomial import Legendre

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import eigen

COARSE, FINE = 3e-3, 3e-7
"""Relative tolerances above the first are for order 5, those below the second for order 13, the others for order 9.

Where forces have kinks, as between surfaces, an order is as good as the next one down to a tolerance that is finer."""
ROUNDED = 8e-9
"""Relative tolerance below which constraints that may lose rank are for order 5: near there, rounding is more than what
stages of a higher order may be off by."""


def moments(nodes: Array, theta: "Array | float") -> Array:
    """(…, stages) weights of the stages' values for the integral from 0 to theta (…) of the polynomial through them."""
    k = np.arange(1, nodes.size + 1)
    return _weights(nodes, np.power.outer(theta, k) / k)


def values(nodes: Array, theta: "Array | float") -> Array:
    """(…, stages) weights of the stages' values for those at theta (…) of the polynomial through them."""
    return _weights(nodes, np.power.outer(theta, np.arange(nodes.size)))


def _weights(nodes: Array, powers: Array) -> Array:
    found = np.linalg.solve(np.vander(nodes, increasing=True).T, powers.T).T
    return np.ascontiguousarray(found, dtype=float)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Collocation:
    """The coefficients of a method, and how they fall apart.

    Parameters
    ----------
    nodes, coefficients
        (stages,) and (stages, stages); the last stage is the end of the step.
    values
        Eigenvalues of the coefficients, the real one first, then one of each pair.
    into, back
        (values, stages) and (stages, values): a vector of all stages, such as a residual, is the real part of
        ``back @ (into @ vector)``.
    gamma, defect
        An embedded method of order ``stages`` has the weight gamma of the rate at the start; its other weights are
        (stages,) the last coefficients and the defect.
    """

    nodes: Array
    coefficients: Array
    values: tuple[complex, ...]
    into: Array
    back: Array
    gamma: float
    defect: Array

    def solved(self, right: Array, solvers: Sequence[Callable[[Array], Array]]) -> Array:
        """(stages, n) solution of a linear system of all stages, by a solver for each of the eigenvalues."""
        (real, *pairs), parts = solvers, self.into @ right
        found = [real(np.real(parts[0])), *(solve(part) for solve, part in zip(pairs, parts[1:], strict=True))]
        return np.real(self.back @ np.array(found))

    def ahead(self, length: float) -> Array:
        """(stages, stages) weights of a step's stages for those of the next, ``length`` times as long."""
        return values(self.nodes, 1.0 + length * self.nodes)


@cache
def radau(stages: int) -> Collocation:
    """Radau IIA of order 2 stages − 1, for an odd number of stages: with an even one no eigenvalue is real."""
    ends = Legendre.basis(stages - 1) - Legendre.basis(stages)
    roots = np.sort(np.real(ends.roots()))
    roots -= ends(roots) / ends.deriv()(roots)
    roots[-1] = 1.0
    nodes = 0.5 * (1.0 + roots)
    coefficients = moments(nodes, nodes)
    found, vectors = eigen(coefficients)
    turns = np.imag(found)
    kept = [int(np.argmin(np.abs(turns))), *np.flatnonzero(turns > 0.01 * np.abs(found)).tolist()]
    twice = np.array([1.0] + [2.0] * (len(kept) - 1))
    gamma = float(found[kept[0]].real)
    order = 1.0 / np.arange(1, stages + 1) - gamma * (np.arange(stages) == 0)
    return Collocation(
        nodes, coefficients, tuple(complex(found[k]) for k in kept), np.linalg.inv(vectors)[kept],
        twice * vectors[:, kept], gamma, _weights(nodes, order) - coefficients[-1],
    )  # fmt: skip


def radau_for(rtol: float | None, *, kinked: bool = False, looped: bool = False) -> Collocation:
    """Radau IIA for steps that are chosen by a relative tolerance; None: for constant steps.

    ``kinked``: whether forces have kinks; ``looped``: whether there are constraints that may lose rank.
    """
    if rtol is None or rtol > (FINE if kinked else COARSE) or (looped and rtol < ROUNDED):
        return radau(3)
    return radau(5 if kinked or rtol >= FINE else 7)
