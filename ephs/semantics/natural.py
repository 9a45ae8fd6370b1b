"""One step of the natural discretisation in plain NumPy, by two routes: flat, and level by level.

Each primitive is discretised on its own; the pattern glues the discrete relations exactly as it glues the continuous
ones. So discretise-then-compose equals flatten-then-discretise. These functions are the oracle of the compiled
solver, and small enough to be read as its definition.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.operad import ROOT, Path, Pattern
from ephs.semantics.behaviour import Continuous, Natural, Relating, Storing
from ephs.semantics.bundle import Array, Bundle, Reference
from ephs.semantics.descriptor import Input, assemble
from ephs.semantics.errors import SemanticsError
from ephs.semantics.primitives import Primitive, Reversible
from ephs.semantics.relations import relation_of
from ephs.semantics.relations.base import BasePoint, StateClass, Values, place
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.decompositions import least_squares
from ephs.semantics.spaces.rank import CONSTRAINT, DIFFERENCE
from ephs.semantics.system import System, fold

NEAR = 1e-9
"""Error beside the unknowns below which whole steps are taken: Newton's method converges there."""
SOLVED = 1e-12
"""Residual accepted when iterations stagnate: rounding, with Jacobians by differences."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """Solution of a relation.

    Parameters
    ----------
    rates, multipliers
        By state and by component.
    outer
        Outer port -> (flow, effort).
    efforts
        Efforts (n,) at the ports of each irreversible component, by its path.
    residual
        Largest entry of the residual that Newton's method left.
    """

    rates: Mapping[Path, Array]
    multipliers: Mapping[Path, Array]
    outer: Mapping[Path, tuple[Array, Array]]
    efforts: Mapping[Path, Array]
    residual: float


def solve_flat(
    system: System, state: Mapping[Path, Array], behaviour: Continuous | Natural, inputs: Mapping[Path, Input]
) -> Solved:
    """Solve the descriptor form of the flattened system for its unknowns, of least norm where they are not unique."""
    d = assemble(system.flatten())
    x = d.pack(state)
    given = d.complete_inputs(inputs)
    z, residual = newton(lambda z: d.residual(behaviour, x, given, z), np.zeros(d.unknowns(given)))
    rates, rest = z[: d.rate_size], z[d.rate_size :]
    efforts, lam = rest[: d.effort_size], rest[d.effort_size : d.effort_size + d.multiplier_size]
    flows = rest[d.effort_size + d.multiplier_size :]
    outer: dict[Path, tuple[Array, Array]] = {}
    at = 0
    for slot in d.outer:
        flow = given[slot.path].value
        if given[slot.path].effort:
            flow, at = flows[at : at + slot.quantity.space.dim], at + slot.quantity.space.dim
        outer[slot.path] = (flow, efforts[slot.efforts])
    return Solved(
        {slot.path: rates[slot.rates] for slot in d.states},
        {s.path: lam[s.multiplier : s.multiplier + s.multipliers] for s in d.components if s.multipliers},
        outer,
        {s.path: efforts[list(s.efforts)] for s in d.components if s.primitive.kind == "irreversible"},
        residual,
    )


@dataclass(slots=True)
class _Unknowns:
    """Hands out places in one long vector of unknowns."""

    size: int = 0

    def take(self, n: int) -> slice:
        self.size += n
        return slice(self.size - n, self.size)


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """A subsystem's residual as a closure over the vector of unknowns, and the indices of its port variables."""

    ports: Mapping[Path, tuple[slice, slice]]
    equations: Callable[[Array], list[Array]]
    rates: Mapping[Path, slice]
    multipliers: Mapping[Path, slice]
    efforts: Mapping[Path, slice]


def solve_nested(
    system: System,
    state: Values,
    behaviour: Continuous | Natural,
    inputs: Mapping[Path, Input],
    ports: Values | None = None,
) -> Solved:
    """Solve the hierarchical system without flattening: every box port of every level has its own flow and effort.

    States that nobody stores are as given in ``state`` or at outer ``ports``, and stay. Storages of one state have
    one rate; where their values differ there is no solution, and the residual is infinite.
    """
    classes = relation_of(system, behaviour.reference, "nested").classes
    states, contradiction = place(classes, state, ports or {})
    if contradiction:
        return Solved({}, {}, {}, {}, np.inf)
    unknowns = _Unknowns()
    point = BasePoint(states)
    shared = {path: each for each in classes for path in (*each.stores, *each.readers)}
    all_rates: dict[Path, slice] = {}  # read by closures, filled leaf by leaf

    def leaf(path: Path, primitive: Primitive) -> _Part:
        local = behaviour.behaviour(primitive, point.read(path, primitive))
        return _leaf(path, primitive, local, shared, unknowns, all_rates)

    part = fold(system, leaf, lambda pattern, parts: _glue(pattern, parts, unknowns))

    def residual(z: Array) -> Array:
        rows = part.equations(z)
        for port, (flow, effort) in part.ports.items():
            given = inputs[port]
            rows.append((z[effort] if given.effort else z[flow]) - given.value)
        for each in classes:
            rows.extend(z[all_rates[each.stores[0]]] - z[all_rates[other]] for other in each.stores[1:])
        return np.concatenate(rows) if rows else np.zeros(0)

    z, error = newton(residual, np.zeros(unknowns.size))
    return Solved(
        {path: z[where] for path, where in part.rates.items()},
        {path: z[where] for path, where in part.multipliers.items()},
        {port: (z[flow], z[effort]) for port, (flow, effort) in part.ports.items()},
        {path: z[where] for path, where in part.efforts.items()},
        error,
    )


def _leaf(
    path: Path,
    primitive: Primitive,
    local: Storing | Relating,
    shared: Mapping[Path, StateClass],
    unknowns: _Unknowns,
    all_rates: dict[Path, slice],
) -> _Part:
    bundle = primitive.bundle
    flow, effort = unknowns.take(bundle.size), unknowns.take(bundle.size)
    ports = {p: (_within(flow, where), _within(effort, where)) for p, where, _ in bundle.items()}
    if isinstance(local, Storing):
        storing = local
        rates = {p: ports[p][0] for p in bundle.ports}
        all_rates.update({path / p: where for p, where in rates.items()})
        return _Part(ports, lambda z: [z[effort] - storing.effort(z[flow])], rates, {}, {})
    relating = local
    lam = unknowns.take(primitive.multipliers if isinstance(primitive, Reversible) else 0)
    sources = {port: shared[path / port] for port in primitive.reads}

    def equations(z: Array) -> list[Array]:
        read = {
            port: z[all_rates[source.stores[0]]] if source.stores else np.zeros(source.quantity.space.dim)
            for port, source in sources.items()
        }
        f, conditions = relating.relate(z[effort], z[lam], read)
        return [z[flow] - f, conditions]

    own = {ROOT: effort} if primitive.kind == "irreversible" else {}
    return _Part(ports, equations, {}, {ROOT: lam} if lam.stop > lam.start else {}, own)


def _glue(pattern: Pattern, parts: Mapping[Path, _Part], unknowns: _Unknowns) -> _Part:
    outer = Bundle.of(pattern.interface)
    flow, effort = unknowns.take(outer.size), unknowns.take(outer.size)
    ports = {p: (_within(flow, where), _within(effort, where)) for p, where, _ in outer.items()}
    on: dict[Path, list[tuple[slice, slice]]] = {}
    for box, b in pattern.boxes.items():
        for port, where in b.ports.items():
            if where.power:
                on.setdefault(where.junction, []).append(parts[box].ports[port])

    def equations(z: Array) -> list[Array]:
        rows = [row for part in parts.values() for row in part.equations(z)]
        for junction, inner in on.items():
            net = sum((z[f] for f, _ in inner[1:]), z[inner[0][0]])
            first, others = inner[0][1], [e for _, e in inner[1:]]
            if junction in ports:
                net = net - z[ports[junction][0]]
                others.append(ports[junction][1])
            rows.append(net)
            rows.extend(z[first] - z[other] for other in others)
        rows.extend(z[f] for junction, (f, _) in ports.items() if junction not in on)
        return rows

    def below(of: Callable[[_Part], Mapping[Path, slice]]) -> dict[Path, slice]:
        return {box / path: where for box, part in parts.items() for path, where in of(part).items()}

    return _Part(ports, equations, below(lambda p: p.rates), below(lambda p: p.multipliers), below(lambda p: p.efforts))


def _within(outer: slice, inner: slice) -> slice:
    return slice(outer.start + inner.start, outer.start + inner.stop)


def step(
    system: System,
    state: Mapping[Path, Array],
    h: float,
    reference: Reference,
    inputs: Mapping[Path, Input] | None = None,
    *,
    nested: bool = False,
) -> tuple[dict[Path, Array], Solved]:
    """One natural step of h seconds: the new state, and what solved it (midpoint values)."""
    solve = solve_nested if nested else solve_flat
    solved = solve(system, state, Natural(reference, h), inputs or {})
    states = system.states
    new = {
        path: manifold(quantity.space).retract(state[path], h * solved.rates[path]) for path, quantity in states.items()
    }
    return new, solved


def newton(residual: Callable[[Array], Array], z: Array, *, iterations: int = 30) -> tuple[Array, float]:
    """Newton's method with differenced Jacobian and least-norm steps, run to stagnation.

    Returns the best point and the largest entry of its residual. The Jacobian's error slows the last digits by a
    factor of about 1e-7 a step and limits nothing.
    """
    r = residual(z)
    best = float(np.abs(r).max(initial=0.0))
    for _ in range(iterations):
        jacobian = np.empty((r.size, z.size))
        for i in range(z.size):
            delta = DIFFERENCE * max(1.0, abs(float(z[i])))
            up, down = z.copy(), z.copy()
            up[i] += delta
            down[i] -= delta
            jacobian[:, i] = (residual(up) - residual(down)) / (2.0 * delta)
        step = least_squares(jacobian, r, part=CONSTRAINT)
        share = 1.0
        new, r_new, error = _tried(residual, z - step)
        # far from the solution a full step may increase the residual; near it only rounding remains
        while not error < best and best > NEAR and share > 1e-3:
            share *= 0.5
            new, r_new, error = _tried(residual, z - share * step)
        if not error < best:
            break
        z, r, progress, best = new, r_new, error / best, error
        if error == 0.0 or (progress > 0.5 and error < SOLVED):
            break
    return z, best


def _tried(residual: Callable[[Array], Array], z: Array) -> tuple[Array, Array, float]:
    """A point, its residual and the largest entry of that, infinite outside the domain of a component."""
    try:
        r = residual(z)
    except SemanticsError:
        return z, z, np.inf
    return z, r, float(np.abs(r).max(initial=0.0))
