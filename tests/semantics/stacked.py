"""The relation of a system at a state, as one stack of equations: an oracle that glues nothing and flattens nothing.

Unknowns are the flow and effort of each power port of each box at each level, the rates of stored states, multipliers
of constraints, and a coordinate that is constantly one. Levels are lists of boxes, not paths: an identity's box, at the
root path, is a level of its own.
"""

from itertools import pairwise

import numpy as np

from ephs.operad import Path
from ephs.semantics import Reference, Reversible, Storage, System

RANK = 1e-10
"""Part of the largest singular value below which one is zero: a rounding error over a condition of 1e5."""


def levels_of(system, at=()):
    """Each level with the boxes that lead to it."""
    yield at, system
    for box, part in system.fillings.items():
        if isinstance(part, System):
            yield from levels_of(part, (*at, box))


def components_of(system):
    """Each component with the boxes that lead to it."""
    return [
        ((*at, box), part)
        for at, level in levels_of(system)
        for box, part in level.fillings.items()
        if not isinstance(part, System)
    ]


def path_of(boxes, *names):
    """Path of what lies inside these boxes."""
    return Path([name for path in (*boxes, *names) for name in path])


def states_of(system):
    """Classes of ports (boxes, name) that share one state: of components, and of the whole, whose boxes are ()."""
    classes = {}

    def join(*nodes):
        whole = set().union(*(classes.get(node, {node}) for node in nodes))
        classes.update((node, whole) for node in whole)

    for at, level in levels_of(system):
        for group in level.pattern.links:
            join(*((at, "junction", path) for path in group))
        for box, content in level.pattern.boxes.items():
            for port, wire in content.ports.items():
                join(((*at, box), port), (at, "junction", wire.junction))
        for path, junction in level.pattern.junctions.items():
            if junction.exposed:
                join((at, path), (at, "junction", path))
    ends = {(), *(boxes for boxes, _ in components_of(system))}
    found = ({node for node in each if len(node) == 2 and node[0] in ends} for each in classes.values())
    return list(dict.fromkeys(frozenset(each) for each in found if each))


def equations_of(system, value, efforts, reference, unit):
    """Equations as coefficient by unknown.

    Parameters
    ----------
    value
        Of the state at a component's port, (boxes, name).
    efforts
        Arguments of the Onsager matrices, by component's boxes.
    unit
        The value of the coordinate that is constantly one.
    """
    for at, level in levels_of(system):
        for path, junction in level.pattern.junctions.items():
            ports = [
                ((*at, box), port)
                for box, content in level.pattern.boxes.items()
                for port, wire in content.ports.items()
                if wire.power and wire.junction == path
            ]
            outer = [(at, path)] if junction.exposed and junction.power else []
            for i in range(junction.quantity.space.dim):
                yield {("flow", p, i): 1.0 for p in ports} | {("flow", p, i): -1.0 for p in outer}
                yield from ({("effort", p, i): 1.0, ("effort", q, i): -1.0} for p, q in pairwise(ports + outer))
    for boxes, part in components_of(system):
        at = [((boxes, port), i) for port, where, _ in part.bundle.items() for i in range(where.stop - where.start)]
        x = {port: value(boxes, port) for port in part.reads}
        if isinstance(part, Storage):
            for k, effort in zip(at, part.effort(x, reference), strict=True):
                yield {("flow", *k): 1.0, ("rate", *k): -1.0}
                yield {("effort", *k): 1.0, ("one",): -effort / unit}
            continue
        if isinstance(part, Reversible):
            dynamic, constraint = part.structure(x)
        else:
            dynamic, constraint = (
                part.matrix(x, efforts[boxes], reference) / reference.temperature,
                np.zeros((0, len(at))),
            )
        for row, k in enumerate(at):
            drive = {("effort", *j): entry for j, entry in zip(at, dynamic[row], strict=True)}
            force = {("multiplier", boxes, j): column[row] for j, column in enumerate(constraint)}
            yield {("flow", *k): -1.0, **drive, **force}
        yield from ({("effort", *j): entry for j, entry in zip(at, row, strict=True)} for row in constraint)
    stores = {
        (boxes, port): part for boxes, part in components_of(system) if isinstance(part, Storage) for port in part.reads
    }
    for group in states_of(system):
        for p, q in pairwise(sorted(group & stores.keys())):
            size = stores[p].interface[p[1]].quantity.space.dim
            yield from ({("rate", p, i): 1.0, ("rate", q, i): -1.0} for i in range(size))


def stacked(system, value, *, efforts=None, reference=None, unit=1.0):
    """An orthonormal basis (n, r) of (rates by path, outer flows, outer efforts, one), and its condition.

    Rows are brought to unit length before the rank is decided. Arguments as of `equations_of`.
    """
    rows = [
        row for row in equations_of(system, value, efforts or {}, reference or Reference(), unit) if any(row.values())
    ]
    rates = sorted(
        (path_of(boxes, port), ("rate", (boxes, port), i))
        for boxes, part in components_of(system) if isinstance(part, Storage)
        for port, _, quantity in part.bundle.items() for i in range(quantity.space.dim)
    )  # fmt: skip
    outer = sorted((p, i) for p, of in system.interface.items() if of.power for i in range(of.quantity.space.dim))
    kept = (
        [key for _, key in rates] + [(kind, ((), p), i) for kind in ("flow", "effort") for p, i in outer] + [("one",)]
    )
    names = list(dict.fromkeys([*kept, *(key for row in rows for key in row)]))
    place = {name: i for i, name in enumerate(names)}
    matrix = np.zeros((len(rows) + 1, len(names)))
    for i, row in enumerate(rows):
        for key, entry in row.items():
            matrix[i, place[key]] = entry
        matrix[i] /= np.linalg.norm(matrix[i])
    _, sizes, transposed = np.linalg.svd(matrix)
    rank = int(np.sum(sizes > RANK * sizes[0])) if rows else 0
    span, lengths, _ = np.linalg.svd(transposed[rank:].T[: len(kept)], full_matrices=False)
    count = int(np.sum(lengths > RANK))
    condition = (sizes[0] / sizes[rank - 1] if rank else 1.0) / (lengths[count - 1] if count else 1.0)
    return span[:, :count], condition
