"""Static paths: equilibria under a growing part of the loads, followed by their length through limit points.

Unknown are the configuration and the part s of the loads. Newton steps solve the forces' balance together with the
equation that the point lies on the plane at a given distance along the tangent, so paths go through limit points, where
loads fall again, and past bifurcations. Stiffness matrices are exact; loops are closed after every step.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import final

import numpy as np

from ephs.mechanics.dynamics import Dynamics, State
from ephs.mechanics.linear.freedoms import freedoms_of, lengths_of, resting
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import eigenvalues, svd
from ephs.solve.posing.errors import SimulationError

SAME = 1e-12
"""Fraction of a load below which its remainder is rounding."""
FLAT = 1e-12
"""Size of an eigenvalue of the scaled stiffness, whose diagonal is 1, that is rounding."""
LOCATED, ALIKE = 1e-12, 1e-7
"""Part of a step to which a critical point is located; part of the loads within which two of them are one."""
TRIALS = 80
"""Trial points on a step, at most, to locate a critical point: bisection alone needs half of them."""
LONGEST, SHORTEST = 1.0, 1e-6
"""Bounds of the distance from one equilibrium to the next, in rad, parts of the scene's length, and of the loads."""
ITERATIONS, WANTED = 12, 8.0
"""Newton steps to an equilibrium on the path, at most, and those that a step along it should take."""
BEND = 0.8
"""Cosine of the angle between the path's tangents, from one equilibrium to the next, at least."""
POINTS = 2000
LET_GO = 100
"""Points on the way from a start that is held; the softest rods and sheets need some 20."""
ROUNDED = 1e-7
"""Change, in the same measure, at which an iteration that no longer improves has met rounding."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class StaticPath:
    """Equilibria under growing loads.

    Parameters
    ----------
    shares
        (n,) parts of the loads; they fall beyond limit points.
    states
        The equilibrium at each.
    unstable
        (n,) how many independent ways lower the energy there: 0 where it is stable.
    critical
        Parts of the loads at which that number changes: limit points and bifurcations.
    """

    shares: Array
    states: tuple[State, ...]
    unstable: Array
    critical: tuple[float, ...]


@final
@dataclass(frozen=True, slots=True, eq=False)
class _ForceBalance:
    """Forces at a configuration on its independent degrees of freedom, (k,), what they change by, and what the loads
    add; ``values`` are the eigenvalues of the scaled stiffness, of an equilibrium.
    """

    state: State
    force: Array
    stiffness: Array
    load: Array
    Z: Array
    values: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def unstable(self) -> int:
        return int((self.values < 0.0).sum())


@final
@dataclass(frozen=True, slots=True, eq=False)
class Loaded:
    """A mechanism under a part of what acts on it.

    Parameters
    ----------
    lengths
        Places of tendons' lengths among the entropies.
    held
        (n,) forces on the tree's freedoms that grow; the loads of the scene where None.
    """

    model: Dynamics
    lengths: list[int]
    held: Array | None

    def balance(self, state: State, share: float) -> _ForceBalance:
        """Forces at rest: of accelerations, so that loops and prescribed joints are reckoned with."""
        model, zero = self.model, np.zeros(self.model.layout.n)
        Z = freedoms_of(model, state).Z
        mass = Z.T @ model.mass_matrix(state)
        if self.held is not None:
            load = Z.T @ self.held
            force = mass @ model.acceleration(state, zero) - (1.0 - share) * load
            return _ForceBalance(state, force, Z.T @ model.stiffness(state, self.lengths) @ Z, load, Z)
        model.loading.share = 0.0
        bare = mass @ model.acceleration(state, zero)
        model.loading.share = 1.0
        load = mass @ model.acceleration(state, zero) - bare
        model.loading.share = share
        stiffness = Z.T @ model.stiffness(state, self.lengths) @ Z
        model.loading.share = 1.0
        return _ForceBalance(state, bare + share * load, stiffness, load, Z)

    def moved(self, state: State, change: Array) -> State:
        """The configuration elsewhere, loops closed, at rest."""
        return resting(self.model, self.model.closed(self.model.moved(state, change)), self.lengths)


def follow(
    model: Dynamics, start: State, length: float, until: float = 1.0, *, held: Array | None = None
) -> StaticPath | None:
    """The path from no loads to a part of them, from an equilibrium without; None where it is lost.

    Parameters
    ----------
    length
        Of the mechanism, m: what a displacement is measured by.
    held
        (n,) forces on the tree's freedoms at the start, in place of loads: there they are balanced, and then let go.
    """
    metric, loaded = metric_of(model, length), Loaded(model, lengths_of(model), held)
    here = _classed(loaded.balance(start, 0.0))
    shares, points, unstable, critical = [0.0], [start], [here.unstable], list[float]()
    share, step = 0.0, 0.25
    before = np.append(np.zeros(metric.size - 1), 1.0)
    while len(shares) < (POINTS if held is None else LET_GO):
        ahead = _tangent(here, metric)
        if ahead @ (metric * before) < 0.0:
            ahead = -ahead
        trial = min(step, (until - share) / ahead[-1]) if ahead[-1] * (until - share) > 0.0 else step
        found = _along(loaded, here, share, ahead, trial, metric)
        if found is None:
            step = 0.5 * trial
            if step < SHORTEST:
                return None
            continue
        there, reached, count = found
        onwards = _tangent(there, metric)
        along = float(onwards @ (metric * ahead))
        turned = along * onwards[-1] * ahead[-1] < 0.0
        hidden = turned and there.unstable == here.unstable  # two critical points, or another path
        if (hidden or abs(along) < BEND) and trial > SHORTEST:
            step = 0.5 * trial
            continue
        between = _between(here, there) if held is None else ()
        met = [_critical(loaded, here, share, ahead, trial, metric, there, k) for k in between]
        critical += _distinct(critical, [x for x in met if x <= until * (1.0 + SAME)])
        if reached > until:
            last = _equilibrium_at(loaded, there.state, until)
            if last is None:
                step = 0.5 * trial
                if step < SHORTEST:
                    return None
                continue
            there, reached = last, until
        before, here, share = ahead, there, reached
        shares.append(share)
        points.append(here.state)
        unstable.append(here.unstable)
        if abs(share - until) <= SAME * until:
            last = _equilibrium_at(loaded, here.state, until)
            points[-1] = here.state if last is None else last.state
            shares[-1] = until
            return StaticPath(np.array(shares), tuple(points), np.array(unstable), tuple(critical))
        step = float(np.clip(trial * np.sqrt(WANTED / count), SHORTEST, LONGEST))
    return None


def metric_of(model: Dynamics, length: float) -> Array:
    """(n + 1,) weights: angles, displacements by the length, the part of the loads."""
    weights = np.ones(model.layout.n + 1)
    for name, parts in model.layout.edges.items():
        where, at = model.layout.freedoms[name], 0
        for _, edge in parts:
            own = where[at : at + edge.pair.dim]
            at += edge.pair.dim
            if own.size and own[0] < model.layout.n:
                weights[own] = np.where(np.any(edge.pair.basis[:3] != 0.0, axis=0), 1.0, length**-2)
    return weights


def _classed(at: _ForceBalance) -> _ForceBalance:
    return replace(at, values=_eigenvalues(at.stiffness))


def _eigenvalues(stiffness: Array) -> Array:
    """(k,) real parts, the least first, of the eigenvalues of a stiffness (k, k) scaled to a diagonal of 1.

    By Sylvester's law the scale changes no sign of those of a symmetric one; a free direction has a rounded 0.
    """
    size = np.abs(np.diag(stiffness))
    scale = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
    values: Array = np.real(eigenvalues(scale[:, None] * stiffness * scale)).astype(float)
    return np.sort(values) + FLAT


def _tangent(here: _ForceBalance, metric: Array) -> Array:
    """(n + 1,) unit tangent of the path, configuration and part of the loads."""
    rows = np.column_stack([here.stiffness, -here.load])
    scale = np.abs(rows).max(axis=1, keepdims=True)
    _, _, ways = svd(rows / np.where(scale > 0.0, scale, 1.0))
    way = ways[-1]
    whole = np.append(here.Z @ way[:-1], way[-1])
    return whole / np.sqrt(whole @ (metric * whole))


def _along(
    loaded: Loaded, here: _ForceBalance, share: float, ahead: Array, distance: float, metric: Array
) -> tuple[_ForceBalance, float, int] | None:
    """The equilibrium at a distance along the tangent, its part of the loads, and the iterations."""
    made, normal = distance * ahead, metric * ahead

    def bordered(at: _ForceBalance) -> tuple[Array, Array]:
        matrix = np.block(
            [[at.stiffness, -at.load[:, None]], [(normal[:-1] @ at.Z)[None, :], np.array([[normal[-1]]])]]
        )
        return matrix, np.append(at.force, 0.0)  # changes are normal to the tangent: the distance stays

    return _solved(loaded, here.state, made[:-1], share + float(made[-1]), metric, distance, bordered)


def _equilibrium_at(loaded: Loaded, state: State, share: float) -> _ForceBalance | None:
    """The equilibrium near by at a part of the loads."""
    metric = np.ones(loaded.model.layout.n + 1)
    found = _solved(
        loaded, state, np.zeros(metric.size - 1), share, metric, LONGEST, lambda at: (at.stiffness, at.force)
    )
    return None if found is None else found[0]


def _solved(
    loaded: Loaded,
    state: State,
    first: Array,
    share: float,
    metric: Array,
    reach: float,
    system: Callable[[_ForceBalance], tuple[Array, Array]],
) -> tuple[_ForceBalance, float, int] | None:
    """Newton's iteration to rounding, after a first change (n,); None where it does not converge within steps of a
    reach, in the metric: longer ones may end on another path.
    """
    try:
        return _iterated(loaded, loaded.moved(state, first), share, metric, reach, system)
    except (np.linalg.LinAlgError, SimulationError):  # singular, or too far for a loop or a component
        return None


def _iterated(
    loaded: Loaded,
    state: State,
    share: float,
    metric: Array,
    reach: float,
    system: Callable[[_ForceBalance], tuple[Array, Array]],
) -> tuple[_ForceBalance, float, int] | None:
    last, at = np.inf, loaded.balance(state, share)
    for count in range(1, ITERATIONS + 1):
        matrix, residual = system(at)
        change = np.asarray(np.linalg.solve(matrix, residual), dtype=float)
        if not np.isfinite(change).all():
            return None
        k = at.stiffness.shape[0]
        step = at.Z @ change[:k]
        more = float(change[k]) if change.size > k else 0.0
        size = float(np.sqrt(step @ (metric[:-1] * step)))
        if max(size, abs(more)) > reach or (size <= ROUNDED and size >= 0.5 * last):
            return (_classed(at), share, count) if size <= ROUNDED else None
        last = size
        share += more
        at = loaded.balance(loaded.moved(at.state, step), share)
    return (_classed(at), share, ITERATIONS) if last <= ROUNDED else None


def _between(one: _ForceBalance, two: _ForceBalance) -> range:
    """Places in the order of the eigenvalues whose sign differs between two equilibria."""
    return range(*sorted((one.unstable, two.unstable)))


def _critical(
    loaded: Loaded,
    here: _ForceBalance,
    share: float,
    ahead: Array,
    distance: float,
    metric: Array,
    there: _ForceBalance,
    k: int,
) -> float:
    """The part of the loads, between here and an equilibrium at a distance along the path, at which the k-th eigenvalue
    is zero: by regula falsi (Anderson and Björck), and bisection where that does not halve the bracket.
    """
    low, high, first, last = 0.0, distance, float(here.values[k]), float(there.values[k])
    part, before = share, distance
    for trial in range(TRIALS):
        middle = low + (high - low) * first / (first - last)
        if trial % 3 == 2 and high - low > 0.5 * before:
            middle = 0.5 * (low + high)
        before = high - low if trial % 3 == 2 else before
        found = _along(loaded, here, share, ahead, middle, metric)
        if found is None:  # the path forks there: the equations are singular
            middle = (
                0.5 * (low + high) if abs(middle - 0.5 * (low + high)) > 0.1 * (high - low) else 0.7 * low + 0.3 * high
            )
            found = _along(loaded, here, share, ahead, middle, metric)
            if found is None:
                return part
        at, part, _ = found
        value = float(at.values[k])
        if value == 0.0:
            break
        if value * last < 0.0:
            low, first = high, last
        else:
            less = 1.0 - value / last
            first *= less if less > 0.0 else 0.5
        step = abs(middle - high)
        high, last = middle, value
        if step <= LOCATED * distance or abs(high - low) <= LOCATED * distance:
            break
    return part


def _distinct(known: list[float], found: list[float]) -> list[float]:
    """Critical shares besides the known ones, each once: several directions may lose their stiffness at one load."""
    out: list[float] = []
    for share in found:
        if not any(abs(share - other) <= ALIKE * max(abs(share), abs(other)) for other in [*known[-1:], *out]):
            out.append(share)
    return sorted(out)
