"""The functor on patterns: the relation of a pattern with empty boxes."""

from collections.abc import Iterator

import numpy as np

from ephs.operad import Path, Pattern
from ephs.semantics.bundle import Array, Bundle
from ephs.semantics.subspace import Subspace

Block = tuple[list[int], Subspace]
"""Coordinates of a relation, and the relation of these."""


def pattern_relation(pattern: Pattern) -> Subspace:
    """F(f): the pattern's own relation on (flows and efforts of all inner ports, then of the outer ports).

    Fibrewise it is a Dirac structure for the form with the outer part negated; inner ports come box by box in the
    layout of their bundles, flows before efforts, then the outer flows and efforts.
    """
    blocks = list(junction_relations(pattern))
    basis = np.zeros((sum(block.ambient for _, block in blocks), sum(block.dimension for _, block in blocks)))
    at = 0
    for where, block in blocks:
        basis[where, at : at + block.dimension] = block.basis
        at += block.dimension
    return Subspace(basis, max((block.condition for _, block in blocks), default=1.0))


def junction_relations(pattern: Pattern) -> Iterator[Block]:
    """F(f) as a direct sum: junctions share neither flows nor efforts, nor do the components of one quantity."""
    parts: list[tuple[Path | None, Bundle]] = [(box, Bundle.of(b.interface)) for box, b in pattern.boxes.items()]
    flows: dict[Path, list[tuple[int, float]]] = {}
    efforts: dict[Path, list[int]] = {}
    at = 0
    for box, bundle in [*parts, (None, Bundle.of(pattern.interface))]:
        for port, where, _ in bundle.items():
            junction = port if box is None else pattern.boxes[box].ports[port].junction
            flows.setdefault(junction, []).append((at + where.start, 1.0 if box is not None else -1.0))
            efforts.setdefault(junction, []).append(at + bundle.size + where.start)
        at += 2 * bundle.size
    found: dict[tuple[float, ...], Subspace] = {}
    for junction, terms in flows.items():
        signs = tuple(sign for _, sign in terms)
        if signs not in found:
            found[signs] = Subspace.from_kernel(_equations(signs))
        starts = [*(start for start, _ in terms), *efforts[junction]]
        for i in range(pattern.junctions[junction].quantity.space.dim):
            yield [start + i for start in starts], found[signs]


def _equations(signs: tuple[float, ...]) -> Array:
    """Conditions on the flows and then the efforts of ports at one junction: a balance, and one effort."""
    n = len(signs)
    out = np.zeros((n, 2 * n))
    out[0, :n] = signs
    out[range(1, n), n] = 1.0
    out[range(1, n), range(n + 1, 2 * n)] = -1.0
    return out
