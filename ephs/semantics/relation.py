"""Relations of systems, and the functor that sends patterns to the gluing of relations.

A system means a relation between the rates ξ̇ of its states, its outer flows and its outer efforts, at each state.
At a base point (the state, with the arguments of the Onsager matrices M(x, e) held fixed) the relation is an affine
subspace; a coordinate that is constantly one makes it linear. Composition is total: nothing is refused here.

Two routes give the relation of a composite: the flattened system's descriptor form, whose unknowns are eliminated at
once, and the level by level composition of the subsystems' relations. They share no code but the primitives.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, TypeVar, final

import numpy as np

from ephs.operad import ROOT, Path, Pattern
from ephs.semantics.bundle import Array, Reference
from ephs.semantics.errors import AssemblyError
from ephs.semantics.primitives import Point, Primitive, Reversible, Storage
from ephs.semantics.spaces import manifold
from ephs.semantics.subspace import Subspace
from ephs.semantics.system import Filling, System

__all__ = [
    "LinearRelation",
    "Relation",
    "Sources",
    "compose_linear",
    "fold",
    "read_point",
    "relation_of",
]

Coordinates = tuple[tuple[Path, int], ...]
T = TypeVar("T")
Sources = Mapping[Path, Path | None]
"""Port of a primitive -> path of the state that lives there, None where nobody stores it."""


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
    """

    rates: Coordinates
    ports: Coordinates
    subspace: Subspace
    unit: float

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
        """Whether no rates, flows and efforts are possible at all: a state that violates a constraint."""
        return float(np.abs(self.subspace.basis[-1]).max(initial=0.0)) < 1e-8

    def distance(self, other: "LinearRelation") -> float:
        """Largest entry of the difference of projectors; 0 for two empty relations. The names must agree."""
        if (self.rates, self.ports, self.unit) != (other.rates, other.ports, other.unit):
            raise ValueError(f"relations on {self.rates}, {self.ports} and {other.rates}, {other.ports} differ in kind")
        if self.empty and other.empty:
            return 0.0
        return self.subspace.distance(other.subspace)


@final
@dataclass(frozen=True, slots=True)
class Relation:
    """The relation of a system, as a value; every composite has one, also what cannot be simulated.

    Call ``at(state)`` for the subspace at a state; ``compose`` glues relations along a pattern.
    """

    system: System | Primitive
    reference: Reference
    route: Literal["flat", "nested"]

    def at(
        self, state: Mapping[str, object] | None = None, efforts: Mapping[Path, Array] | None = None
    ) -> LinearRelation:
        """The relation at a state.

        Parameters
        ----------
        state
            Values by path; missing ones at the identity.
        efforts
            Arguments e of the Onsager matrices by the component's path, (n,) each; zero where not given, which is
            right for matrices that do not depend on efforts, and for entropy ports at the reference temperature.
        """
        system = as_system(self.system)
        point = system.state(state)
        frozen = dict(efforts or {})
        unit = _unit(system, point, self.reference)
        if self.route == "flat":
            try:
                return _flat(system, point, frozen, self.reference, unit)
            except AssemblyError:
                # What cannot be simulated means something all the same: the flat pattern glues the parts' relations.
                system = system.flatten()
        return _nested(system, point, frozen, self.reference, unit)


def relation_of(system: System | Primitive, reference: Reference, route: Literal["flat", "nested"]) -> Relation:
    """The relation of a system or primitive."""
    return Relation(system, reference, route)


def as_system(filling: Filling) -> System:
    """A primitive as the one box of an identity pattern; a system as it is."""
    if isinstance(filling, System):
        return filling
    return System.fill(Pattern.identity(filling.interface), {ROOT: filling})


def linear_parts(primitive: Primitive, x: Point, e: Array | None, reference: Reference) -> tuple[Array, Array, Array]:
    """(A, C, g): f = A e + Cᵀ λ, 0 = C e for a process; e = g for a storage (A, C empty). M is taken at e."""
    n = primitive.bundle.size
    if isinstance(primitive, Storage):
        return np.zeros((n, n)), np.zeros((0, n)), primitive.effort(x, reference)
    if isinstance(primitive, Reversible):
        skew, constraint = primitive.structure(x)
        return skew, constraint, np.zeros(n)
    at = np.zeros(n) if e is None else e
    primitive.require_temperature(at, reference)
    return primitive.matrix(x, at, reference) / reference.temperature, np.zeros((0, n)), np.zeros(n)


def _unit(system: System, state: Mapping[Path, Array], reference: Reference) -> float:
    """The size of the largest effort that a storage gives, at least 1."""
    largest = 1.0
    for path, primitive in system.leaves():
        if isinstance(primitive, Storage):
            point = {port: state[path / port] for port in primitive.reads}
            largest = max(largest, float(np.abs(primitive.effort(point, reference)).max(initial=0.0)))
    return largest


# ---- route one: flatten, assemble, eliminate -------------------------------------------------------------------


def _flat(
    system: System,
    state: Mapping[Path, Array],
    frozen: Mapping[Path, Array],
    reference: Reference,
    unit: float,
) -> LinearRelation:
    descriptor = system.descriptor()
    x = descriptor.pack(state)
    outer = descriptor.outer
    n_rate, n_effort, n_lam = descriptor.rate_size, descriptor.effort_size, descriptor.multiplier_size
    n_outer = sum(slot.quantity.space.dim for slot in outer)
    size = n_rate + n_effort + n_lam + n_outer + 1
    storage_rows, balance = np.zeros((n_rate, size)), np.zeros((n_effort, size))
    conditions = np.zeros((n_lam, size))
    for slot in descriptor.components:
        index = list(slot.efforts)
        columns = [n_rate + i for i in index]
        dynamic, constraint, effort = linear_parts(
            slot.primitive, descriptor.point(slot, x), frozen.get(slot.path), reference
        )
        if isinstance(slot.primitive, Storage):
            rates = [i for s in slot.reads for i in range(s.rates.start, s.rates.stop)]
            storage_rows[rates, columns] = 1.0
            storage_rows[rates, -1] = -effort / unit
            balance[index, rates] += 1.0
            continue
        # two ports of one component may lie on one junction: add, do not assign
        np.add.at(balance, (np.array(index, dtype=int)[:, None], np.array(columns, dtype=int)[None, :]), dynamic)
        mine = np.arange(slot.multiplier, slot.multiplier + slot.multipliers)
        lam = n_rate + n_effort + mine
        np.add.at(balance, (np.array(index, dtype=int)[:, None], lam[None, :]), constraint.T)
        np.add.at(conditions, (mine[:, None], np.array(columns, dtype=int)[None, :]), constraint)
    at = n_rate + n_effort + n_lam
    places: dict[Path, tuple[range, range]] = {}
    for slot in outer:
        dim = slot.quantity.space.dim
        balance[np.arange(slot.at, slot.at + dim), np.arange(at, at + dim)] -= 1.0
        places[slot.path] = (range(at, at + dim), range(n_rate + slot.at, n_rate + slot.at + dim))
        at += dim
    solution = Subspace.from_kernel(np.vstack([storage_rows, balance, conditions]))
    rates = sorted(descriptor.states, key=lambda s: s.path)
    kept = [i for s in rates for i in range(s.rates.start, s.rates.stop)]
    for side in (0, 1):
        kept += [i for path in sorted(places) for i in places[path][side]]
    return LinearRelation(
        tuple((s.path, s.quantity.space.dim) for s in rates),
        tuple((s.path, s.quantity.space.dim) for s in sorted(outer, key=lambda s: s.path)),
        solution.project([*kept, size - 1]),
        unit,
    )


# ---- route two: compose relations level by level ---------------------------------------------------------------


def _nested(
    system: System,
    state: Mapping[Path, Array],
    frozen: Mapping[Path, Array],
    reference: Reference,
    unit: float,
) -> LinearRelation:
    def leaf(path: Path, primitive: Primitive, sources: Sources) -> LinearRelation:
        return _primitive(primitive, read_point(primitive, sources, state), frozen.get(path), reference, unit)

    return fold(system, leaf, compose_linear)


def fold(
    system: System,
    leaf: Callable[[Path, Primitive, Sources], T],
    compose: Callable[[Pattern, Mapping[Path, T]], T],
) -> T:
    """Evaluate a hierarchical system bottom-up: primitives by ``leaf``, composites by ``compose``.

    A leaf is told where the states live that its ports read: the levels hand them down, junction by junction.
    """

    def visit(path: Path, filling: Filling, offered: Mapping[Path, Path]) -> T:
        if not isinstance(filling, System):
            return leaf(path, filling, _sources(path, filling, offered))
        pattern = filling.pattern
        sources: dict[Path, Path] = {}  # junction -> state that lives there
        for port, source in offered.items():
            for member in pattern.state_class(port):
                sources[member] = source
        for box, inner in filling.fillings.items():
            for port, source in _provided(inner).items():
                for member in pattern.state_class(pattern.boxes[box].ports[port].junction):
                    sources[member] = path / box / source
        parts: dict[Path, T] = {}
        for box, inner in filling.fillings.items():
            ports = pattern.boxes[box].ports
            down = {p: sources[port.junction] for p, port in ports.items() if port.junction in sources}
            parts[box] = visit(path / box, inner, down)
        return compose(pattern, parts)

    return visit(ROOT, system, {})


def _provided(filling: Filling) -> dict[Path, Path]:
    """Outer port -> relative path of the state that a storage inside keeps there."""
    if isinstance(filling, Storage):
        return {port: ROOT / port for port in filling.bundle.ports}
    if not isinstance(filling, System):
        return {}
    out: dict[Path, Path] = {}
    pattern = filling.pattern
    for box, inner in filling.fillings.items():
        for port, source in _provided(inner).items():
            for member in pattern.state_class(pattern.boxes[box].ports[port].junction):
                if pattern.junctions[member].exposed:
                    out[member] = box / source
    return out


def _sources(path: Path, primitive: Primitive, offered: Mapping[Path, Path]) -> Sources:
    if isinstance(primitive, Storage):
        return {port: path / port for port in primitive.reads}
    return {port: offered.get(port) for port in primitive.reads}


def read_point(primitive: Primitive, sources: Sources, state: Mapping[Path, Array]) -> Point:
    """The states that a primitive reads; one that nobody stores is free, and the identity stands for it."""
    return {
        port: manifold(primitive.interface[port].quantity.space).identity() if source is None else state[source]
        for port, source in sources.items()
    }


def _primitive(primitive: Primitive, x: Point, e: Array | None, reference: Reference, unit: float) -> LinearRelation:
    bundle = primitive.bundle
    n = bundle.size
    dynamic, constraint, effort = linear_parts(primitive, x, e, reference)
    k = constraint.shape[0]
    ports = sorted(bundle.ports)
    order = [i for p in ports for i in range(bundle.slice(p).start, bundle.slice(p).stop)]
    named = tuple((p, bundle.quantity(p).space.dim) for p in ports)
    eye = np.eye(n)
    if isinstance(primitive, Storage):
        # coordinates (rates, f, e, 1)
        kernel = np.block([[eye, -eye, np.zeros((n, n + 1))], [np.zeros((n, 2 * n)), eye, -effort[:, None] / unit]])
        kept = [*order, *(n + i for i in order), *(2 * n + i for i in order), 3 * n]
        return LinearRelation(named, named, Subspace.from_kernel(kernel).project(kept), unit)
    # coordinates (f, e, λ, 1)
    kernel = np.block(
        [
            [-eye, dynamic, constraint.T, np.zeros((n, 1))],
            [np.zeros((k, n)), constraint, np.zeros((k, k + 1))],
        ]
    )
    kept = [*order, *(n + i for i in order), 2 * n + k]
    return LinearRelation((), named, Subspace.from_kernel(kernel).project(kept), unit)


def compose_linear(pattern: Pattern, parts: Mapping[Path, LinearRelation]) -> LinearRelation:
    """Glue the relations of the boxes along a pattern: shared effort, net flow; then forget the inner ports."""
    unit = max((part.unit for part in parts.values()), default=1.0)  # what has no storage inside knows none but 1
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
    outer = [(p, t.quantity.space.dim) for p, t in sorted(pattern.interface.items()) if t.power]
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
        tuple(outer),
        whole.restrict(matrix).project(kept),
        unit,
    )
