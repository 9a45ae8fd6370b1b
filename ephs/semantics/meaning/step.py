"""One step of the natural discretisation, or the motion at an instant, by the same gluing: the oracle of all solvers.

Each primitive relates flows, efforts and the rates of the states that it reads, over a step or at an instant. Where it
does so nonlinearly it has an affine tangent at each guess. The pattern glues open boxes once, level by level; Newton's
method puts tangents into it, and the solution is held against all tangents glued level by level. So the functor does
not know that time is discrete.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from ephs.operad import Interface, Path
from ephs.semantics.bundles.bundle import Array, Bundle, Reference
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.descriptor.descriptor import Input
from ephs.semantics.meaning.base import Values, names_of, place
from ephs.semantics.meaning.components import at_ports, efforts_of
from ephs.semantics.meaning.fields import ROUNDED, Rounded, Row
from ephs.semantics.meaning.functor import glued
from ephs.semantics.meaning.linear import LinearRelation
from ephs.semantics.meaning.relation import relation_of
from ephs.semantics.meaning.variables import ONE, RelationVariable, at_port, into, own
from ephs.semantics.primitives.behaviour import ContinuousBehaviour, NaturalBehaviour, Storing
from ephs.semantics.primitives.differences import slope
from ephs.semantics.primitives.primitives import Primitive, Reversible, Storage
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.decompositions import least_squares, svd
from ephs.semantics.spaces.rank import CONSTRAINT
from ephs.semantics.systems.system import Filling, System, as_system, fold

ITERATIONS, STUCK = 30, 4
"""Iterations at most, and in how many the least remainder must have halved: else there is no solution near by."""
NEAR = 1e-9
"""Error beside the unknowns below which whole steps are taken: Newton's method converges there."""
SOLVED = 1e-12
"""Residual accepted when iterations stagnate: rounding, with Jacobians by differences."""
FAST = 0.1
"""Part of the remainder that an iteration leaves, below which slopes are kept."""
Guess = Mapping[RelationVariable, float]
"""Values at which relations are touched; zero where missing."""


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
        Largest remainder of an equation; infinite where no guess has one.
    rounding
        Bound of the rates' errors from rounding, by running error analysis; zero where they are not determined.
    """

    rates: Mapping[Path, Array]
    multipliers: Mapping[Path, Array]
    outer: Mapping[Path, tuple[Array, Array]]
    efforts: Mapping[Path, Array]
    residual: float
    rounding: float = 0.0


def solved(
    system: Filling,
    state: Values,
    behaviour: ContinuousBehaviour | NaturalBehaviour,
    inputs: Mapping[Path, Input] | None = None,
    ports: Values | None = None,
) -> Solved:
    """Solve the relation of a system by the system's own nesting; of least change where it is not unique.

    States that nobody stores are as given in ``state`` or at outer ``ports``, and stay. Storages of one state have one
    rate; where their values differ there is no solution, and the residual is infinite.

    Parameters
    ----------
    inputs
        What is prescribed at each outer power port; no flow where nothing is.
    """
    classes = relation_of(system, behaviour.reference, "nested").classes
    states, contradiction = place(classes, state, ports or {})
    if contradiction:
        return Solved({}, {}, {}, {}, np.inf)
    stored = {each.name for each in classes if each.stores}
    names = {path: name for path, name in names_of(classes).items() if name in stored}
    components = list(as_system(system).leaves())
    parts = {path: part_of(each, path, states, names, behaviour) for path, each in components}

    def whole(leaf: Callable[[Path, Primitive], LinearRelation]) -> LinearRelation:
        found = fold(system, leaf, lambda pattern, below: glued(Rounded(), pattern, below))
        return found.join(_prescribed(system.interface, inputs or {}))

    junctions = whole(lambda _, primitive: _open(primitive))
    guess, residual = newton(Tangents(junctions, parts))
    if np.isfinite(residual):
        last = whole(lambda path, primitive: touching(primitive, path, parts[path], guess))
        found = _solution(components, system.interface, names, guess, last.remainder(guess, unit=False))
        return replace(found, rounding=_rounding(last))
    return _solution(components, system.interface, names, guess, residual)


def _open(primitive: Primitive) -> LinearRelation:
    """The relation of a box that nothing fills: what is at its ports is what is inside of them."""
    field, bundle = Rounded(), primitive.bundle
    ports = [*at_ports("flow", bundle), *at_ports("effort", bundle)]
    inside = [variable._replace(role="inner") for variable in ports]
    rows = [field.exact({outer: 1.0, inner: -1.0}) for outer, inner in zip(ports, inside, strict=True)]
    return LinearRelation.of(field, [*ports, *inside], rows)


@final
@dataclass(frozen=True, slots=True, eq=False)
class LocalRelation:
    """Local relation of a component over a step or at an instant, at fixed states.

    Parameters
    ----------
    same
        Variables at ports that are arguments.
    arguments
        Rates of what is read, and efforts and multipliers where the component is no storage; named for good, so that
        the next guess can be read off the whole.
    results
        Variables at ports that the function gives; it is 0 where there is None.
    linear
        In how many of the first arguments the function is linear; then it takes many of them as columns, too.
    """

    same: list[tuple[RelationVariable, RelationVariable]]
    arguments: list[RelationVariable]
    results: list[RelationVariable | None]
    function: Callable[[Array, Array], Array]
    linear: int = 0

    def value(self, at: Array) -> Array:
        """The results (m,) at arguments (n,)."""
        return np.asarray(self.function(at[: self.linear], at[self.linear :]), dtype=float)

    def slope(self, at: Array) -> Array:
        """The derivative (m, n) of the results."""
        first, rest = np.split(at, [self.linear])
        others = slope(lambda z: np.asarray(self.function(first, z), dtype=float), rest)
        return np.hstack([self.function(np.eye(self.linear), rest), others]) if self.linear else others


def part_of(
    primitive: Primitive,
    path: Path,
    states: Mapping[Path, Array],
    names: Mapping[Path, Path],
    behaviour: ContinuousBehaviour | NaturalBehaviour,
) -> LocalRelation:
    """Local relation of the component at a path."""
    bundle = primitive.bundle
    local = behaviour.behaviour(primitive, {port: states[path / port] for port in primitive.reads})
    flows, efforts = at_ports("flow", bundle), at_ports("effort", bundle)
    moving = [port for port in primitive.reads if path / port in names]
    sizes = {port: primitive.interface[port].quantity.space.dim for port in primitive.reads}
    rates = [variable for port in moving for variable in own("rate", names[path / port], sizes[port])]
    if isinstance(local, Storing):
        return LocalRelation(
            list(zip(flows, rates, strict=True)), rates, [*efforts], lambda _, rate: local.effort(rate)
        )
    here = efforts_of(primitive, path)
    count = primitive.multipliers if isinstance(primitive, Reversible) else 0
    linear = isinstance(primitive, Reversible) and (
        primitive.discrete is None or isinstance(behaviour, ContinuousBehaviour)
    )
    still = {port: np.zeros(sizes[port]) for port in primitive.reads}

    def evaluate(first: Array, rest: Array) -> Array:
        e, lam, read = np.split(np.concatenate([first, rest]), cuts) if not linear else (*np.split(first, cuts), rest)
        known = still | dict(zip(moving, np.split(read, inside) if moving else [], strict=True))
        flow, conditions = local.relate(e, lam, known)
        return np.concatenate([flow, conditions])

    inside = np.cumsum([sizes[port] for port in moving])[:-1]
    cuts = [len(here)] if linear else [len(here), len(here) + count]
    arguments = [*here, *own("multiplier", path, count), *rates]
    same = list(zip(efforts, here, strict=True))
    return LocalRelation(same, arguments, [*flows, *[None] * count], evaluate, len(here) + count if linear else 0)


def touching(primitive: Primitive, path: Path, part: LocalRelation, guess: Guess) -> LinearRelation:
    """The affine relation that touches a component's own one at a guess: y = f(z⁰) + f′(z − z⁰)."""
    field, at = Rounded(), np.array([guess.get(v, 0.0) for v in part.arguments])
    rows = [field.exact({port: 1.0, argument: -1.0}) for port, argument in part.same]
    jacobian = part.slope(at)
    constant = part.value(at) - jacobian @ at
    for name, entries, number in zip(part.results, jacobian.tolist(), constant.tolist(), strict=True):
        terms = {ONE: number}
        for argument, entry in zip(part.arguments, entries, strict=True):  # two ports may read one state
            terms[argument] = terms.get(argument, 0.0) + entry
        row = field.rounded(terms)
        rows.append(row if name is None else row | field.exact({name: -1.0}))
    ports = [*at_ports("flow", primitive.bundle), *at_ports("effort", primitive.bundle)]
    return LinearRelation.of(field, [*ports, *part.arguments, ONE], rows)


@final
class Tangents:
    """Equations between rates, efforts, multipliers and outer variables alone, affine ones at each guess.

    Equations of the pattern are eliminated once, by its own nesting; those of components are inserted at each guess.
    """

    def __init__(self, junctions: LinearRelation, parts: Mapping[Path, LocalRelation]) -> None:
        ports = sorted(v for v in junctions.variables if v.role == "inner")
        outer = {v for v in junctions.variables if v.role == "outer"}
        self.unknown = sorted(outer.union(*(part.arguments for part in parts.values())))
        n, whole = len(self.unknown), junctions.matrix([*ports, *self.unknown, ONE], unit=False)
        self._of_ports, self._of_outer = whole[:, : len(ports)], whole[:, len(ports) :]
        column = {v: i for i, v in enumerate(self.unknown)}
        row = {v: i for i, v in enumerate(ports)}
        count = sum(part.results.count(None) for part in parts.values())
        self._same = np.zeros((len(ports) + count, n + 1))
        self._parts: list[tuple[LocalRelation, list[int], list[int]]] = []
        used = len(ports)
        for path, part in parts.items():
            for port, argument in part.same:
                self._same[row[_inner_variable(path, port)], column[argument]] = 1.0
            rows: list[int] = []
            for result in part.results:
                rows.append(used if result is None else row[_inner_variable(path, result)])
                used += result is None
            self._parts.append((part, rows, [column[v] for v in part.arguments]))
        self._slopes: list[Array] = []

    def equations(self, guess: Array, *, fresh: bool) -> Array:
        """Their coefficients (m, n), and constants in the last column, at a guess (n,); rows are of length one.

        Parameters
        ----------
        fresh
            Whether slopes are of this guess, too, or those of the last one that asked so.
        """
        if fresh:
            self._slopes = [part.slope(guess[columns]) for part, _, columns in self._parts]
        inside = self._same.copy()
        for (part, rows, columns), jacobian in zip(self._parts, self._slopes, strict=True):
            at = guess[columns]
            np.add.at(inside, np.ix_(rows, columns), jacobian)  # two ports may read one state
            inside[rows, -1] = part.value(at) - jacobian @ at
        ports = self._of_ports.shape[1]
        found = np.vstack([self._of_ports @ inside[:ports] + self._of_outer, inside[ports:]])
        sizes = np.linalg.norm(found, axis=1, keepdims=True)
        return found / np.where(sizes > 0.0, sizes, 1.0)


def _inner_variable(path: Path, port: RelationVariable) -> RelationVariable:
    return into(path, port)._replace(role="inner")


def newton(tangents: Tangents) -> tuple[Guess, float]:
    """Newton's method from zero, run to stagnation: the best guess and its largest remainder.

    The slopes' error slows the last digits by a factor of about 1e-7 a step and limits nothing.
    """
    guess, before = np.zeros(len(tangents.unknown)), np.inf
    here, best = _error(tangents, guess, fresh=True)
    least, halved, stale, kept = best, 0, False, False
    for iteration in range(ITERATIONS):
        if best < 0.5 * least:
            least, halved = best, iteration
        still = best < SOLVED and best > 0.5 * before and not stale
        if best in (0.0, np.inf) or still or iteration - halved > STUCK:
            break
        for target in _targets(here, guess):
            new, there, error = _halved(tangents, guess, target, best)
            if error < best:
                break
        else:
            break
        guess, before, stale, kept = new, best, kept, error < FAST * best
        here, best = (there, error) if kept else _error(tangents, new, fresh=True)
    return dict(zip(tangents.unknown, guess.tolist(), strict=True)), best


def _halved(tangents: Tangents, guess: Array, target: Array, best: float) -> tuple[Array, Array, float]:
    """The target, or a point on the way there whose remainder is below the best one; the equations there, and that."""
    new, share, (there, error) = target, 1.0, _error(tangents, target, fresh=False)
    # far from the solution a full step may increase the remainder; near it only rounding remains
    while not error < best and best > NEAR and share > 1e-3:
        share *= 0.5
        new = (1.0 - share) * guess + share * target
        there, error = _error(tangents, new, fresh=False)
    return new, there, error


def _error(tangents: Tangents, guess: Array, *, fresh: bool) -> tuple[Array, float]:
    """The equations at a guess, and their largest remainder there, infinite outside the domain of a component."""
    try:
        found = tangents.equations(guess, fresh=fresh)
    except SemanticsError:
        return np.zeros((0, guess.size + 1)), np.inf
    return found, float(np.abs(found[:, :-1] @ guess + found[:, -1]).max(initial=0.0))


def _targets(equations: Array, guess: Array) -> Iterator[Array]:
    """The solution of a tangent, if it has one; then what contradicts least and is nearest to the guess."""
    matrix, right = equations[:, :-1], -(equations[:, :-1] @ guess + equations[:, -1])
    scale = np.linalg.norm(matrix, axis=0)
    if scale.all() and matrix.shape[0] >= scale.size:
        u, sigma, vt = svd(matrix / scale, full_matrices=False)
        if sigma.min(initial=1.0) > sigma.size * ROUNDED * sigma.max(initial=1.0):
            yield guess + vt.T @ ((u.T @ right) / sigma) / scale
    yield guess + least_squares(matrix, right, part=CONSTRAINT)


def _rounding(relation: LinearRelation) -> float:
    """The largest error bound of a rate that a tangent determines."""
    if relation.empty:
        return 0.0
    found = relation.determined().items()
    return max((row[ONE][1] for variable, row in found if variable.kind == "rate" and row), default=0.0)


def _prescribed(interface: Any, inputs: Mapping[Path, Input]) -> LinearRelation:
    """The flow or effort that is given at each outer power port."""
    field, rows, variables = Rounded(), list[Row[Any]](), {ONE}
    for port, _, quantity in Bundle.of(interface).items():
        given = inputs.get(port) or Input(np.zeros(quantity.space.dim), effort=False)
        names = at_port("outer", "effort" if given.effort else "flow", port, quantity)
        variables |= set(names)
        for name, value in zip(names, given.value.tolist(), strict=True):
            rows.append(field.exact({name: 1.0}) | field.rounded({ONE: -value}))
    return LinearRelation.of(field, variables, rows)


def _solution(
    components: Iterable[tuple[Path, Primitive]],
    interface: Interface,
    names: Mapping[Path, Path],
    guess: Guess,
    residual: float,
) -> Solved:
    def vector(variables: list[RelationVariable]) -> Array:
        return np.array([guess.get(v, 0.0) for v in variables])

    rates: dict[Path, Array] = {}
    multipliers: dict[Path, Array] = {}
    efforts: dict[Path, Array] = {}
    for path, primitive in components:
        if isinstance(primitive, Storage):
            for port, _, quantity in primitive.bundle.items():
                rates[path / port] = vector(own("rate", names[path / port], quantity.space.dim))
        elif isinstance(primitive, Reversible):
            if primitive.multipliers:
                multipliers[path] = vector(own("multiplier", path, primitive.multipliers))
        else:
            efforts[path] = vector(efforts_of(primitive, path))
    outer = {
        port: (vector(at_port("outer", "flow", port, q)), vector(at_port("outer", "effort", port, q)))
        for port, _, q in Bundle.of(interface).items()
    }
    return Solved(rates, multipliers, outer, efforts, residual)


def step(
    system: System,
    state: Mapping[Path, Array],
    h: float,
    reference: Reference,
    inputs: Mapping[Path, Input] | None = None,
) -> tuple[dict[Path, Array], Solved]:
    """One natural step of h seconds: the new state, and what solved it (midpoint values)."""
    found = solved(system, state, NaturalBehaviour(reference, h), inputs)
    new = {
        path: manifold(quantity.space).retract(state[path], h * found.rates[path])
        for path, quantity in system.states.items()
    }
    return new, found
