"""The functor on patterns: the relation of a pattern with empty boxes."""

import numpy as np

from ephs.operad import Path, Pattern
from ephs.semantics.bundle import Array, Bundle
from ephs.semantics.subspace import Subspace


def pattern_relation(pattern: Pattern) -> Subspace:
    """F(f): the pattern's own relation on (flows and efforts of all inner ports, then of the outer ports).

    Fibrewise it is a Dirac structure for the form with the outer part negated; inner ports come box by box in the
    layout of their bundles, flows before efforts, then the outer flows and efforts.
    """
    parts: list[tuple[Path, Bundle]] = [(box, Bundle.of(b.interface)) for box, b in pattern.boxes.items()]
    n_in = sum(bundle.size for _, bundle in parts)
    outer = Bundle.of(pattern.interface)
    size = 2 * (n_in + outer.size)
    flows: dict[Path, list[tuple[list[int], float]]] = {}
    equations: list[Array] = []
    efforts: dict[Path, list[int]] = {}
    at = 0
    for box, bundle in [*parts, (None, outer)]:
        for port, where, _ in bundle.items():
            junction = port if box is None else pattern.boxes[box].ports[port].junction
            places = list(range(at + where.start, at + where.stop))
            flows.setdefault(junction, []).append((places, 1.0 if box is not None else -1.0))
            efforts.setdefault(junction, []).append(at + bundle.size + where.start)
        at += 2 * bundle.size
    for junction, terms in flows.items():
        for i in range(pattern.junctions[junction].quantity.space.dim):
            balance = np.zeros(size)
            for where, sign in terms:
                balance[where[i]] += sign
            equations.append(balance)
            first, *others = efforts[junction]
            for other in others:
                equal = np.zeros(size)
                equal[first + i], equal[other + i] = 1.0, -1.0
                equations.append(equal)
    return Subspace.from_kernel(np.array(equations).reshape(len(equations), size))
