"""One step of the natural discretisation, or the motion at an instant, by the same gluing: the oracle of all solvers.

Each primitive relates flows, efforts and the rates of the states that it reads, over a step or at an instant. Where it
does so nonlinearly it has an affine tangent at each guess; Newton's method glues tangents, so that the functor does not
know that time is discrete, nor at how many levels the system is written.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array, Bundle, Reference
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.descriptor.descriptor import Input
from ephs.semantics.meaning.base import Values, names_of, place
from ephs.semantics.meaning.components import at_ports, efforts_of
from ephs.semantics.meaning.fields import Field, Rounded, Row
from ephs.semantics.meaning.functor import glued
from ephs.semantics.meaning.linear import LinearRelation
from ephs.semantics.meaning.relation import relation_of
from ephs.semantics.meaning.variables import ONE, Variable, at_port, own
from ephs.semantics.primitives.behaviour import Continuous, Natural, Relating, Storing
from ephs.semantics.primitives.differences import slope
from ephs.semantics.primitives.primitives import Primitive, Reversible, Storage
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.decompositions import least_squares
from ephs.semantics.spaces.rank import CONSTRAINT
from ephs.semantics.systems.system import Filling, System, as_system, fold

ITERATIONS, STUCK = 30, 4
"""Iterations at most, and in how many the least remainder must have halved: else there is no solution near by."""
NEAR = 1e-9
"""Error beside the unknowns below which whole steps are taken: Newton's method converges there."""
SOLVED = 1e-12
"""Residual accepted when iterations stagnate: rounding, with Jacobians by differences."""
Guess = Mapping[Variable, float]
"""Values at which tangents are taken; zero where missing."""


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
    behaviour: Continuous | Natural,
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
    given = _prescribed(system.interface, inputs or {})
    slopes: dict[Path, Array] = {}

    def tangents(guess: Guess, fresh: bool) -> LinearRelation:
        def leaf(path: Path, primitive: Primitive) -> LinearRelation:
            return tangent(primitive, path, states, names, behaviour, guess, slopes)

        field = Rounded()
        if fresh:
            slopes.clear()
        return fold(system, leaf, lambda pattern, parts: glued(field, pattern, parts)).join(given)

    guess, residual = newton(tangents)
    if not np.isfinite(residual):
        return _solution(as_system(system), names, guess, residual)
    last = tangents(guess, False)
    found = _solution(as_system(system), names, guess, last.remainder(guess, unit=False))
    return replace(found, rounding=_rounding(last))


def newton(tangents: Callable[[Guess, bool], LinearRelation]) -> tuple[Guess, float]:
    """Newton's method on the tangents of a relation, from zero, run to stagnation: the best guess and its remainder.

    The Jacobians' error slows the last digits by a factor of about 1e-7 a step and limits nothing.

    Parameters
    ----------
    tangents
        (guess, whether slopes are to be of this guess, too, or may be those of the last one that asked so).
    """
    guess: Guess = {}
    before, best = np.inf, _error(tangents, guess, fresh=True)
    least, halved = best, 0
    for iteration in range(ITERATIONS):
        if best < 0.5 * least:
            least, halved = best, iteration
        if best in (0.0, np.inf) or (best < SOLVED and best > 0.5 * before) or iteration - halved > STUCK:
            break
        for target in _targets(tangents(guess, False), guess):
            new, error = _halved(tangents, guess, target, best)
            if error < best:
                break
        else:
            break
        guess, before, best = new, best, _error(tangents, new, fresh=True)
    return guess, best


def _halved(
    tangents: Callable[[Guess, bool], LinearRelation], guess: Guess, target: Guess, best: float
) -> tuple[Guess, float]:
    """The target, or a point on the way there whose remainder is below the best one, and that."""
    new, share, error = target, 1.0, _error(tangents, target, fresh=False)
    # far from the solution a full step may increase the remainder; near it only rounding remains
    while not error < best and best > NEAR and share > 1e-3:
        share *= 0.5
        new = {v: (1.0 - share) * guess.get(v, 0.0) + share * value for v, value in target.items()}
        error = _error(tangents, new, fresh=False)
    return new, error


def _error(tangents: Callable[[Guess, bool], LinearRelation], guess: Guess, *, fresh: bool) -> float:
    """The remainder at a guess, infinite outside the domain of a component."""
    try:
        return tangents(guess, fresh).remainder(guess)
    except SemanticsError:
        return np.inf


def _targets(relation: LinearRelation, guess: Guess) -> Iterator[Guess]:
    """The solution of a tangent, if it has one; then what contradicts least and is nearest to the guess."""
    if not relation.empty:
        found = relation.values()
        if len(found) == len(relation.variables):
            yield found
    order = sorted(relation.variables - {ONE})
    matrix = relation.matrix([*order, ONE])
    at = np.array([guess.get(v, 0.0) for v in order])
    change = least_squares(matrix[:, :-1], -(matrix[:, :-1] @ at + matrix[:, -1]), part=CONSTRAINT)
    yield dict(zip(order, (at + change).tolist(), strict=True))


def tangent(
    primitive: Primitive,
    path: Path,
    states: Mapping[Path, Array],
    names: Mapping[Path, Path],
    behaviour: Continuous | Natural,
    guess: Guess,
    slopes: dict[Path, Array],
) -> LinearRelation:
    """The affine relation that touches a component's own one at a guess.

    What it is linearised in keeps a name for good, so that the next guess can be read off the whole.

    Parameters
    ----------
    slopes
        Derivatives by component; those that are missing are found, and added.
    """
    field, bundle = Rounded(), primitive.bundle
    local = behaviour.behaviour(primitive, {port: states[path / port] for port in primitive.reads})
    flows, efforts = at_ports("flow", bundle), at_ports("effort", bundle)
    moving = [port for port in primitive.reads if path / port in names]
    sizes = {port: primitive.interface[port].quantity.space.dim for port in primitive.reads}
    rates = [variable for port in moving for variable in own("rate", names[path / port], sizes[port])]
    if isinstance(local, Storing):
        rows = [field.exact({rate: 1.0, flow: -1.0}) for rate, flow in zip(rates, flows, strict=True)]
        rows += _touching(field, local.effort, rates, efforts, guess, slopes, path)
        return LinearRelation.of(field, [*flows, *efforts, *rates, ONE], rows)
    here = efforts_of(primitive, path)
    count = primitive.multipliers if isinstance(primitive, Reversible) else 0
    multipliers = own("multiplier", path, count)
    conditions: list[Any] = [None] * count
    still = {port: np.zeros(sizes[port]) for port in primitive.reads}

    def evaluate(z: Array) -> Array:
        e, lam, read = np.split(z, [len(here), len(here) + count])
        cuts = np.cumsum([sizes[port] for port in moving])[:-1]
        known = still | dict(zip(moving, np.split(read, cuts) if moving else [], strict=True))
        return _related(local, e, lam, known)

    rows = [field.exact({effort: 1.0, name: -1.0}) for effort, name in zip(efforts, here, strict=True)]
    rows += _touching(field, evaluate, [*here, *multipliers, *rates], [*flows, *conditions], guess, slopes, path)
    return LinearRelation.of(field, [*flows, *efforts, *here, *multipliers, *rates, ONE], rows)


def _related(local: Relating, e: Array, lam: Array, rates: Mapping[Path, Array]) -> Array:
    flow, conditions = local.relate(e, lam, rates)
    return np.concatenate([flow, conditions])


def _touching(
    field: Field[Any],
    function: Callable[[Array], Array],
    arguments: list[Variable],
    results: list[Any],
    guess: Guess,
    slopes: dict[Path, Array],
    path: Path,
) -> list[Row[Any]]:
    """y = f(z⁰) + f′(z − z⁰); a result that is None is zero."""
    at = np.array([guess.get(v, 0.0) for v in arguments])
    value = np.asarray(function(at), dtype=float)
    if path not in slopes:
        slopes[path] = slope(function, at)
    jacobian = slopes[path]
    constant = value - jacobian @ at
    rows: list[Row[Any]] = []
    for name, entries, number in zip(results, jacobian.tolist(), constant.tolist(), strict=True):
        terms = {ONE: number}
        for argument, entry in zip(arguments, entries, strict=True):  # two ports may read one state
            terms[argument] = terms.get(argument, 0.0) + entry
        row = field.rounded(terms)
        rows.append(row if name is None else row | field.exact({name: -1.0}))
    return rows


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


def _solution(system: System, names: Mapping[Path, Path], guess: Guess, residual: float) -> Solved:
    def vector(variables: list[Variable]) -> Array:
        return np.array([guess.get(v, 0.0) for v in variables])

    rates: dict[Path, Array] = {}
    multipliers: dict[Path, Array] = {}
    efforts: dict[Path, Array] = {}
    for path, primitive in system.leaves():
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
        for port, _, q in Bundle.of(system.interface).items()
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
    found = solved(system, state, Natural(reference, h), inputs)
    new = {
        path: manifold(quantity.space).retract(state[path], h * found.rates[path])
        for path, quantity in system.states.items()
    }
    return new, found
