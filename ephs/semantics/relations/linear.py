"""The fibre of a relation over a point of its base: a linear subspace, of one component or glued along a pattern."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np

from ephs.operad import Interface, Path, Pattern
from ephs.semantics.bundle import Array, Reference
from ephs.semantics.linear.sums import unit_rows
from ephs.semantics.primitives import Point, Primitive, Reversible, Storage
from ephs.semantics.relations.base import BasePoint
from ephs.semantics.subspace import Subspace

AFFINE = 1e-8
"""Last entry of unit vectors of a relation below which it has no affine part: the root of rounding."""

Coordinates: TypeAlias = tuple[tuple[Path, int], ...]
"""Names and dimensions, sorted by name."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class LinearRelation:
    """A relation at a base point, as a subspace of (rates, outer flows, outer efforts, unit).

    Parameters
    ----------
    rates, ports
        Names and dimensions, sorted by name, in the order in which they lie in the subspace.
    unit
        The value of the last coordinate on the relation proper: of the size of the efforts, so that projectors do not
        lose the small ones beside a pressure.
    contradiction
        Which values of one state differ, where the point is none of the base; the relation is empty there.
    """

    rates: Coordinates
    ports: Coordinates
    subspace: Subspace
    unit: float
    contradiction: str = ""

    @staticmethod
    def nothing(rates: Coordinates, ports: Coordinates, contradiction: str) -> "LinearRelation":
        """The empty relation."""
        size = sum(dim for _, dim in rates) + 2 * sum(dim for _, dim in ports) + 1
        return LinearRelation(rates, ports, Subspace(np.zeros((size, 0))), 1.0, contradiction)

    @property
    def projector(self) -> Array:
        """The orthogonal projector on the subspace."""
        return self.subspace.projector

    @property
    def dimension(self) -> int:
        """Dimension of the subspace, the constant coordinate included."""
        return self.subspace.dimension

    @property
    def empty(self) -> bool:
        """Whether no rates, flows and efforts are possible: the state violates a constraint, or has several values."""
        return float(np.abs(self.subspace.basis[-1]).max(initial=0.0)) < AFFINE

    def distance(self, other: "LinearRelation") -> float:
        """Largest entry of the difference of projectors; 0 if both are empty, 1 if one is. The names must agree."""
        if (self.rates, self.ports) != (other.rates, other.ports):
            raise ValueError(f"relations on {self.rates}, {self.ports} and {other.rates}, {other.ports} differ in kind")
        if self.empty or other.empty:
            return float(self.empty != other.empty)
        if self.unit != other.unit:
            raise ValueError(f"the constant coordinates are {self.unit} and {other.unit}: relations of unlike states")
        return self.subspace.distance(other.subspace)


def power_ports(interface: Interface) -> Coordinates:
    """The power ports of an interface with their dimensions, sorted by name."""
    return tuple((port, kind.quantity.space.dim) for port, kind in sorted(interface.items()) if kind.power)


def linear_parts(primitive: Primitive, x: Point, e: Array | None, reference: Reference) -> tuple[Array, Array, Array]:
    """(A, C, g): f = A e + Cᵀ λ, 0 = C e for a process; e = g for a storage (A, C empty). M is taken at e.

    Rows of C are of length one, or zero.
    """
    n = primitive.bundle.size
    if isinstance(primitive, Storage):
        return np.zeros((n, n)), np.zeros((0, n)), primitive.effort(x, reference)
    if isinstance(primitive, Reversible):
        skew, constraint = primitive.structure(x)
        return skew, unit_rows(constraint), np.zeros(n)
    at = np.zeros(n) if e is None else e
    primitive.require_temperature(at, reference)
    return primitive.matrix(x, at, reference) / reference.temperature, np.zeros((0, n)), np.zeros(n)


def component_relation(primitive: Primitive, path: Path, point: BasePoint) -> LinearRelation:
    """The relation of the component at this path of the whole system."""
    bundle = primitive.bundle
    n = bundle.size
    x, e = point.read(path, primitive), point.efforts.get(path)
    dynamic, constraint, effort = linear_parts(primitive, x, e, point.reference)
    k = constraint.shape[0]
    named = power_ports(primitive.interface)
    order = [i for p, _ in named for i in range(bundle.slice(p).start, bundle.slice(p).stop)]
    eye = np.eye(n)
    if isinstance(primitive, Storage):
        # coordinates (rates, f, e, 1)
        kernel = np.block(
            [[eye, -eye, np.zeros((n, n + 1))], [np.zeros((n, 2 * n)), eye, -effort[:, None] / point.unit]]
        )
        kept = [*order, *(n + i for i in order), *(2 * n + i for i in order), 3 * n]
        return LinearRelation(named, named, Subspace.from_kernel(kernel).project(kept), point.unit)
    # coordinates (f, e, λ, 1)
    kernel = np.block(
        [
            [-eye, dynamic, constraint.T, np.zeros((n, 1))],
            [np.zeros((k, n)), constraint, np.zeros((k, k + 1))],
        ]
    )
    kept = [*order, *(n + i for i in order), 2 * n + k]
    return LinearRelation((), named, Subspace.from_kernel(kernel).project(kept), point.unit)


def compose_linear(pattern: Pattern, parts: Mapping[Path, LinearRelation]) -> LinearRelation:
    """Glue the relations of the boxes along a pattern: shared effort, net flow; then forget the inner ports."""
    unit = max((part.unit for part in parts.values()), default=1.0)  # without inner storage the only one is 1
    inner = Subspace(np.zeros((0, 0)))
    places: dict[tuple[Path, Path], tuple[int, int]] = {}  # (box, port) -> (first flow, first effort)
    rates: list[tuple[Path, int, int]] = []
    ones: list[int] = []
    for box, part in parts.items():
        at = inner.ambient
        for name, dim in part.rates:
            rates.append((box / name, dim, at))
            at += dim
        n = sum(dim for _, dim in part.ports)
        for port, dim in part.ports:
            places[box, port] = (at, at + n)
            at += dim
        inner = inner.direct_sum(part.subspace)
        ones.append(inner.ambient - 1)
    outer = power_ports(pattern.interface)
    n = sum(dim for _, dim in outer)
    start = inner.ambient
    whole = inner.direct_sum(Subspace(np.eye(2 * n + 1)))
    last = whole.ambient - 1
    rows = [(one, last, -1.0) for one in ones]
    equations: list[list[tuple[int, float]]] = [[(a, 1.0), (b, sign)] for a, b, sign in rows]
    outer_at = dict(zip((p for p, _ in outer), np.cumsum([0, *(d for _, d in outer)]).tolist(), strict=False))
    for path, junction in pattern.junctions.items():
        on = [
            places[box, port]
            for box, b in pattern.boxes.items()
            for port, where in b.ports.items()
            if where.power and where.junction == path
        ]
        exposed = junction.exposed and junction.power
        if not on and not exposed:
            continue
        for i in range(junction.quantity.space.dim):
            efforts = [e + i for _, e in on]
            flows = [(f + i, 1.0) for f, _ in on]
            if exposed:
                efforts.append(start + n + outer_at[path] + i)
                flows.append((start + outer_at[path] + i, -1.0))
            equations += [[(efforts[0], 1.0), (other, -1.0)] for other in efforts[1:]]
            equations.append(flows)
    matrix = np.zeros((len(equations), whole.ambient))
    for row, terms in enumerate(equations):
        for column, value in terms:
            matrix[row, column] += value
    rates.sort()
    kept = [i for _, dim, at in rates for i in range(at, at + dim)] + list(range(start, whole.ambient))
    return LinearRelation(
        tuple((name, dim) for name, dim, _ in rates),
        outer,
        whole.restrict(matrix).project(kept),
        unit,
    )
