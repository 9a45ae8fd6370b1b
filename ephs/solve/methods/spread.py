"""Tables of a model for the stages of a step: velocities of joints, stores of heat, places in the system of all."""

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.derive.holonomic import Holonomic
from ephs.semantics.primitives.primitives import Kernel
from ephs.semantics.primitives.pullback import pulled_ports
from ephs.semantics.spaces.codes import SE3
from ephs.solve.equations.model import Model
from ephs.solve.equations.sparse import Index
from ephs.solve.methods.records import STORING
from ephs.solve.methods.scheme import Groups, GroupsOf, Stages, StagesOf


def groups_of(model: Model, stages: int) -> Groups:
    """The velocities of joints: twists of two frames, and a velocity on the pair's group; storages of entropy alone."""
    where, node = _places(model, stages), _nodes(model)
    velocity, metric = _velocities(model)
    of = np.full(model.tables.row.size, -1)
    of[node[:, 3]] = np.arange(len(node))
    i, j, source = where.T
    at = np.flatnonzero((source >= 0) & (of[source] >= 0))
    entry = np.zeros((len(node), stages, stages), dtype=np.int64)
    entry[of[source[at]], i[at], j[at]] = at
    return GroupsOf(velocity, metric, node, entry, where)


def memory_of(model: Model, groups: Groups, stages: int) -> Stages:
    """Scratch memory of the stages."""
    t, n, k, nodes = model.tables, model.unknowns, stages, len(groups.node)
    size, entries, rates = int(model.descriptor.point_size), int(t.row.size), int(t.counts[0])
    shapes = {
        "x": (k, size), "v": (k, rates), "turn": (k, 8), "outer": (k, 8), "whole": rates, "mean": n, "gradient": rates,
        "share": (nodes, k), "factor": nodes, "end": nodes, "gap": n, "energy": t.kind.size, "residual": (k, n),
        "scale": (k, n), "data": (k, entries), "slope": (k, entries), "matrix": len(groups.where), "one": 8,
        **dict.fromkeys(("change", "dense", "pivot"), k * n),
    }  # fmt: skip
    return StagesOf(**{name: np.zeros(shape) for name, shape in shapes.items()})


def closing_of(model: Model, groups: Groups) -> NDArray[np.bool_]:
    """(rows,) the equations of components whose relation holds over a step."""
    t, out = model.tables, np.zeros(model.unknowns, dtype=np.bool_)
    for number in np.unique(groups.velocity[:, 0]):
        first = int(t.counts[0] + t.counts[1] + t.multiplier_at[number])
        out[first : first + int(t.dims[number, 1])] = True
    return out


def _velocities(model: Model) -> tuple[Index, Array]:
    """(groups, 4) `Velocity`, and the metrics in which the components measure them."""
    rows: list[tuple[int, int, int, int]] = []
    metrics = [np.zeros(0)]
    numbering = model.descriptor.numbering
    joints = [
        k for k, one in enumerate(numbering.primitives) if one.kernel and isinstance(one.kernel.relation, Holonomic)
    ]
    for number in np.flatnonzero(np.isin(numbering.primitive, joints)).tolist():
        slot = model.descriptor.components[number]
        kernel, efforts = slot.primitive.kernel, list(slot.efforts)
        assert kernel is not None
        assert isinstance(kernel.relation, Holonomic)
        for (first, matrix), code in zip(_ports(kernel, len(efforts)), (SE3, SE3, kernel.relation.code), strict=True):
            if dim := matrix.shape[1]:
                rows.append((number, code, efforts[first], dim))
                metric = np.zeros((6, 6))
                metric[:dim, :dim] = matrix.T @ matrix
                metrics.append(metric.ravel())
    return np.array(rows, dtype=np.int64).reshape(-1, 4), np.concatenate(metrics)


def _nodes(model: Model) -> Index:
    """(nodes, 4) `Node`: storages of entropy alone whose temperature depends on it."""
    t = model.tables
    c = np.flatnonzero((t.kind == STORING) & (t.dims[:, 0] == 1))
    effort, slope = t.e_index[t.e_at[c]], t.jacobian[t.jacobian_at[c]]
    c, effort, slope = (part[(t.entropy[effort] == 1.0) & (slope >= 0)] for part in (c, effort, slope))
    return np.stack([c, t.read_w[t.read_w_at[c]], t.counts[0] + effort, slope], axis=1)


def _ports(kernel: Kernel, size: int) -> list[tuple[int, Array]]:
    """(first of its efforts, the map by which the relation sees them) of the two frames and the degrees of freedom of a
    joint.
    """
    found = [(at, matrix) for _, _, at, _, matrix in pulled_ports(kernel)]
    if not found:
        return [(0, np.eye(6)), (6, np.eye(6)), (12, np.eye(size - 12))]
    return found if len(found) == 3 else [*found, (size, np.zeros((0, 0)))]


def _places(model: Model, stages: int) -> Index:
    """(entries, 3): stage of the row, stage of the column, entry of the model's matrix; −1 − row: its place holder."""
    t, n = model.tables, model.unknowns
    i, source, j = np.indices((stages, t.row.size - n, stages)).reshape(3, -1)
    chosen = (i == j) | (t.column[source] < t.counts[0])
    stage, row = np.indices((stages, n)).reshape(2, -1)
    found = np.stack([i, j, source], axis=1)[chosen]
    return np.concatenate([found, np.stack([stage, stage, -1 - row], axis=1)]).astype(np.int64)
