"""Pullback of a primitive along linear maps of its ports' efforts, as when a transformer is folded into it.

With e' = T e the relation (f', e') becomes f = Tᵀ f': Dirac structures stay Dirac structures, Onsager structures stay
Onsager structures, and over a step the same relation holds that the two components have together.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias, final

import numpy as np

from ephs.operad import Directory, Interface, Path, PortType
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.derive.closing import Closing
from ephs.semantics.derive.linear import Linear
from ephs.semantics.derive.logarithm_loss import LogarithmLoss
from ephs.semantics.derive.logarithms import LogarithmStep
from ephs.semantics.derive.maps import Maps
from ephs.semantics.derive.relations import StorageStep
from ephs.semantics.primitives import structures
from ephs.semantics.primitives.primitives import Irreversible, Kernel, Point, Reversible
from ephs.semantics.verdicts.verdict import Condition

WithoutMaps: TypeAlias = Linear | StorageStep | LogarithmStep | LogarithmLoss | Closing
"""Relations that are not seen through maps."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Map:
    """Map of the efforts at a port from those at another: e' = matrix e.

    Parameters
    ----------
    matrix
        (inner dim, dim), constant; dim 0 where the efforts vanish.
    port
        The type of the port that takes the place, None where the efforts vanish.
    """

    matrix: Array
    port: PortType | None


def pull_back(process: Reversible | Irreversible, maps: Mapping[Path, Map]) -> Reversible | Irreversible:
    """The process with other ports in the place of some: f = Tᵀ f', e' = T e.

    The ports keep their names; one whose efforts vanish is gone. A compiled relation is kept, unless a port is given
    more efforts than it had.

    Raises
    ------
    StructureError
        The result is not the structure that it claims to be: an entropy port was mapped by other than 1.
    """
    interface = _interface(process.interface, maps)
    whole = _matrix(process, maps)
    # maps of mechanical ports preserve the conserved quantities; the checks decide the rest
    sound = not any(process.interface[port].quantity.environment for port in maps)
    entries = (*process.parameters, *((f"T {port}", tuple(m.matrix.ravel().tolist())) for port, m in maps.items()))

    def carried() -> tuple[Condition, ...]:
        inner = process.verdict.conditions
        return tuple(Condition(c.statement, c.proved, ("seen", c.how)) for c in inner)

    proof = carried if sound else None

    if isinstance(process, Reversible) and not process.reads and process.discrete is None:
        skew, constraint = process.structure({})
        rows = constraint @ whole
        made = whole.T @ skew @ whole
        return structures.constant_structure(
            process.name, interface, made, rows, entries, trusted=sound, external_field=process.external_field
        )
    kernel = _kernel(process, maps)
    if isinstance(process, Irreversible):
        given = process

        def matrix(x: Point, e: Array, reference: Reference) -> Array:
            return whole.T @ given.matrix(x, whole @ e, reference) @ whole

        return Irreversible(
            process.name,
            interface,
            matrix,
            process.reads,
            entries,
            kernel,
            proof=proof,
            trusted=sound,
            one_sided=process.one_sided,
        )
    inner = process

    def structure(x: Point) -> tuple[Array, Array]:
        skew, constraint = inner.structure(x)
        return whole.T @ skew @ whole, constraint @ whole

    def discrete(h: float, x0: Point, v: Point, e: Array) -> tuple[Array, Array]:
        if inner.discrete is None:
            raise TypeError("there is no other relation over a step than that at its middle")
        constraint, residual = inner.discrete(h, x0, v, whole @ e)
        return constraint @ whole, residual

    return Reversible(
        process.name,
        interface,
        structure,
        process.reads,
        None if inner.discrete is None else discrete,
        entries,
        process.multipliers,
        kernel,
        proof=proof,
        trusted=sound,
        working=inner.working,
        external_field=inner.external_field,
    )


def pulled_ports(kernel: Kernel) -> tuple[tuple[int, int, int, int, Array], ...]:
    """(inner at, inner dim, at, dim, matrix (inner dim, dim)) of each port of a kernel that `pull_back` made."""
    maps = None if isinstance(kernel.relation, WithoutMaps) else kernel.relation.maps
    if maps is None:
        return ()
    numbers = kernel.parameters[len(kernel.parameters) - maps.numbers :]
    out: list[tuple[int, int, int, int, Array]] = []
    inside = outside = 0
    for block, rows in zip(maps.blocks, maps.rows(numbers), strict=True):
        matrix = np.array(rows, dtype=float).reshape(block.inside, block.outside)
        out.append((inside, block.inside, outside, block.outside, matrix))
        inside, outside = inside + block.inside, outside + block.outside
    return tuple(out)


def _interface(before: Interface, maps: Mapping[Path, Map]) -> Interface:
    ports = [(port, maps[port].port if port in maps else kind) for port, kind in before.items()]
    return Directory([(port, kind) for port, kind in ports if kind is not None])


def _matrix(process: Reversible | Irreversible, maps: Mapping[Path, Map]) -> Array:
    """T (inner n, n), block by block."""
    blocks = [maps[p].matrix if p in maps else np.eye(q.space.dim) for p, _, q in process.bundle.items()]
    out = np.zeros((sum(b.shape[0] for b in blocks), sum(b.shape[1] for b in blocks)))
    i = j = 0
    for block in blocks:
        out[i : i + block.shape[0], j : j + block.shape[1]] = block
        i, j = i + block.shape[0], j + block.shape[1]
    return out


def _kernel(process: Reversible | Irreversible, maps: Mapping[Path, Map]) -> Kernel | None:
    kernel = process.kernel
    if kernel is None or isinstance(kernel.relation, WithoutMaps):
        return None
    if any(m.matrix.shape[1] > m.matrix.shape[0] for m in maps.values()):
        return None
    before = [(matrix.shape[1], matrix) for *_, matrix in pulled_ports(kernel)] or [
        (dim, np.eye(dim)) for dim in (where.stop - where.start for _, where, _ in process.bundle.items()) if dim
    ]
    # a port whose efforts vanish is none of the process' any more, but still one of the relation inside
    ports = iter([port for port, where, _ in process.bundle.items() if where.stop > where.start])
    matrices: list[Array] = []
    for dim, matrix in before:
        port = next(ports) if dim else None
        matrices.append(matrix @ maps[port].matrix if port is not None and port in maps else matrix)
    made, numbers = Maps.of_matrices(matrices)
    old = kernel.relation.maps
    own = kernel.parameters[: len(kernel.parameters) - (0 if old is None else old.numbers)]
    return replace(kernel, relation=replace(kernel.relation, maps=made), parameters=(*own, *numbers))
