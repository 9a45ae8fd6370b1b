"""A primitive seen through linear maps of its ports' efforts: what is left of it where a transformer is folded in.

With e' = T e the relation (f', e') becomes f = Tᵀ f': Dirac structures stay Dirac structures, Onsager structures stay
Onsager structures, and over a step the same relation holds that the two components have together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.operad import Directory, Interface, Path, PortType
from ephs.semantics import structures
from ephs.semantics.bundle import Array, Reference
from ephs.semantics.primitives import Irreversible, Kernel, Point, Reversible
from ephs.semantics.verdict import Condition

__all__ = ["Map", "pull_back", "pulled_ports"]

KERNELS = "ephs.semantics.pullback_kernels"


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
    # maps of mechanical ports leave the conserved quantities alone; all else the checks decide
    sound = not any(process.interface[port].quantity.environment for port in maps)
    entries = (*process.parameters, *((f"T {port}", tuple(m.matrix.ravel().tolist())) for port, m in maps.items()))

    def carried() -> tuple[Condition, ...]:
        inner = process.verdict.conditions
        return tuple(Condition(c.statement, c.proved, f"{c.how}; seen through e' = T e") for c in inner)

    proof = carried if sound else None

    if isinstance(process, Reversible) and not process.reads and process.discrete is None:
        skew, constraint = process.structure({})
        rows = constraint @ whole
        made = whole.T @ skew @ whole
        return structures.constant_structure(process.name, interface, made, rows, entries, trusted=sound)
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
    )


def pulled_ports(kernel: Kernel) -> tuple[tuple[int, int, int, int, Array], ...]:
    """(inner at, inner dim, at, dim, matrix (inner dim, dim)) of each port of a kernel that `pull_back` made."""
    if kernel.inner is None:
        return ()
    numbers = kernel.parameters
    count = int(numbers[1])
    out: list[tuple[int, int, int, int, Array]] = []
    at = 2 + 5 * count
    for i in range(count):
        a, da, b, db, is_matrix = (int(value) for value in numbers[2 + 5 * i : 7 + 5 * i])
        matrix = np.eye(da)
        if is_matrix:
            matrix = np.array(numbers[at : at + da * db]).reshape(da, db)
            at += da * db
        out.append((a, da, b, db, matrix))
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
    if kernel is None or any(m.matrix.shape[1] > m.matrix.shape[0] for m in maps.values()):
        return None
    before = pulled_ports(kernel) if kernel.module == KERNELS else _plain(process)
    inside = kernel.inner if kernel.module == KERNELS and kernel.inner is not None else kernel
    blocks: list[tuple[int, int, Array]] = []
    # a port whose efforts vanish is none of the process' any more, but still one of the relation inside
    ports = iter([port for port, where, _ in process.bundle.items() if where.stop > where.start])
    for a, da, _, db, matrix in before:
        port = next(ports) if db else None
        blocks.append((a, da, matrix @ maps[port].matrix if port is not None and port in maps else matrix))
    return _tabulate(inside, blocks)


def _plain(process: Reversible | Irreversible) -> Sequence[tuple[int, int, int, int, Array]]:
    spans = [(where.start, where.stop - where.start) for _, where, _ in process.bundle.items()]
    return [(at, dim, at, dim, np.eye(dim)) for at, dim in spans if dim]


def _tabulate(inside: Kernel, blocks: Sequence[tuple[int, int, Array]]) -> Kernel:
    layout: list[float] = []
    matrices: list[float] = []
    at = 0
    for a, da, matrix in blocks:
        db = matrix.shape[1]
        plain = da == db and np.array_equal(matrix, np.eye(da))
        layout += [a, da, at, db, 0.0 if plain else 1.0]
        if not plain:
            matrices += matrix.ravel().tolist()
        at += db
    inner = sum(da for _, da, _ in blocks)
    return Kernel(KERNELS, "pulled", (float(inner), float(len(blocks)), *layout, *matrices), inner=inside)
