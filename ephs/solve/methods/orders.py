"""Order of an explicit Runge–Kutta method, by the conditions of its rooted trees.

The step h Σ bᵢ kᵢ is right to order p where Σ bᵢ Φᵢ(τ) = 1/γ(τ) for all rooted trees τ of up to p nodes, with
Φᵢ(τ) = Πₖ Σⱼ aᵢⱼ Φⱼ(τₖ) over the subtrees τₖ at the root, and the density γ(τ) = |τ| Πₖ γ(τₖ). Hairer, Nørsett and
Wanner, *Solving Ordinary Differential Equations I*, II.2. Each sum is held against what rounding leaves of its terms.
"""

from collections.abc import Iterator
from functools import cache
from itertools import combinations_with_replacement
from typing import Final

import numpy as np

from ephs.semantics.bundles.bundle import Array

Tree = tuple["Tree", ...]
"""A rooted tree: the trees at its root, in order."""
MOST: Final = 9
"""Highest order that is looked for: 486 trees."""
ROUNDING: Final = 8.0 * float(np.finfo(float).eps)
"""Rounding of a condition for each node of its tree, relative to the sum of its terms' sizes."""


@cache
def trees(nodes: int) -> tuple[Tree, ...]:
    """All rooted trees with so many nodes."""
    return tuple(sorted({tuple(sorted(forest)) for forest in _forests(nodes - 1, nodes - 1)}))


def _forests(nodes: int, largest: int) -> Iterator[tuple[Tree, ...]]:
    """Sets of trees with so many nodes together, none with more than ``largest``."""
    if nodes == 0:
        yield ()
    for size in range(min(nodes, largest), 0, -1):
        for count in range(1, nodes // size + 1):
            for same in combinations_with_replacement(trees(size), count):
                for rest in _forests(nodes - size * count, size - 1):
                    yield (*same, *rest)


@cache
def size_of(tree: Tree) -> int:
    """Number of nodes of a tree."""
    return 1 + sum(map(size_of, tree))


@cache
def density(tree: Tree) -> int:
    """γ of a tree."""
    found = size_of(tree)
    for each in tree:
        found *= density(each)
    return found


def order_of(a: Array, b: Array) -> int:
    """Order of the step with the stages a (s, s), strictly lower, and the weights b (s,); `MOST` at most."""
    return _first_missed(a, b, exact=True) - 1


def power_of(a: Array, error: Array) -> int:
    """Power of h with which the estimate h Σ errorᵢ kᵢ falls; `MOST` + 1 where it is higher than all looked for."""
    return _first_missed(a, error, exact=False)


def _first_missed(a: Array, weights: Array, *, exact: bool) -> int:
    """Least number of nodes of a tree whose condition fails: Σ weights Φ is 1/γ if ``exact``, else 0."""
    known: dict[Tree, tuple[Array, Array]] = {}

    def phi(tree: Tree) -> tuple[Array, Array]:
        """Φ of a tree by stages, and the same of absolute values."""
        if tree not in known:
            value, bound = np.ones(len(a)), np.ones(len(a))
            for each in tree:
                inner, outer = phi(each)
                value, bound = value * (a @ inner), bound * (np.abs(a) @ outer)
            known[tree] = value, bound
        return known[tree]

    for nodes in range(1, MOST + 1):
        for tree in trees(nodes):
            value, bound = phi(tree)
            wanted = 1.0 / density(tree) if exact else 0.0
            if abs(weights @ value - wanted) > ROUNDING * nodes * (np.abs(weights) @ bound + wanted):
                return nodes
    return MOST + 1
