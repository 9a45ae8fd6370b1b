"""Static paths: equilibria under a growing part of the loads, followed by their length through limit points.

Unknown are the configuration and the part s of the loads. Newton steps solve the forces' balance together with the
equation that the point lies on the plane at a given distance along the tangent, so paths go through limit points, where
loads fall again, and past bifurcations. Stiffness matrices are exact; loops are closed after every step.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from ephs.mechanics.dynamics import Dynamics, State
from ephs.mechanics.linear.scene import freedoms_of
from ephs.semantics.bundle import Array

REAL = 1e-9
"""Largest imaginary part of a real eigenvalue, relative to its size."""
SAME = 1e-12
"""Fraction of a load below which its remainder is rounding."""
BRACKET, SOFT = 1e-10, 1e-13
"""Width of the bracket of a critical share, and the least stiffness beside others, at which it is found."""
LONGEST, SHORTEST = 1.0, 1e-6
"""Bounds of the distance from one equilibrium to the next, in rad, parts of the scene's length, and of the loads."""
ITERATIONS = 12
POINTS = 2000
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
class _Balance:
    """Forces at a configuration on its independent degrees of freedom, (k,), what they change by, and what the loads
    add.
    """

    state: State
    force: Array
    stiffness: Array
    load: Array
    Z: Array

    @property
    def unstable(self) -> int:
        values = self._values
        return int(((values.real < 0.0) & (np.abs(values.imag) <= REAL * np.abs(values.real))).sum())

    @property
    def softest(self) -> float:
        """Eigenvalue nearest zero, relative to the largest."""
        values = self._values
        return float(values.real[np.abs(values).argmin()] / np.abs(values).max())

    @property
    def _values(self) -> NDArray[np.complex128]:
        return np.linalg.eigvals(self.stiffness).astype(complex)


def follow(model: Dynamics, start: State, length: float, until: float = 1.0) -> StaticPath | None:
    """The path from no loads to a part of them, from an equilibrium without; None where it is lost.

    Parameters
    ----------
    length
        Of the mechanism, m: what a displacement is measured by.
    """
    metric = _metric(model, length)
    here = _balance(model, start, 0.0)
    shares, points, unstable, critical = [0.0], [start], [here.unstable], list[float]()
    share, step = 0.0, 0.25
    before = np.append(np.zeros(model.layout.n), 1.0)
    while len(shares) < POINTS:
        ahead = _tangent(here, metric)
        if ahead @ (metric * before) < 0.0:
            ahead = -ahead
        trial = min(step, (until - share) / ahead[-1]) if ahead[-1] * (until - share) > 0.0 else step
        found = _along(model, here, share, ahead, trial, metric)
        if found is None:
            step = 0.5 * trial
            if step < SHORTEST:
                return None
            continue
        there, reached, count = found
        if reached > until:
            last = _held(model, there.state, until)
            if last is None:
                step = 0.5 * trial
                if step < SHORTEST:
                    return None
                continue
            there, reached = last, until
        if there.unstable != here.unstable:
            critical.append(_crossing(model, here, share, there, reached))
        before, here, share = ahead, there, reached
        shares.append(share)
        points.append(here.state)
        unstable.append(here.unstable)
        if abs(share - until) <= SAME * until:
            last = _held(model, here.state, until)
            points[-1] = here.state if last is None else last.state
            shares[-1] = until
            return StaticPath(np.array(shares), tuple(points), np.array(unstable), tuple(critical))
        step = float(np.clip(trial * np.sqrt(8.0 / count), SHORTEST, LONGEST))
    return None


def _metric(model: Dynamics, length: float) -> Array:
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


def _balance(model: Dynamics, state: State, share: float) -> _Balance:
    """Forces at rest: of accelerations, so that loops and prescribed joints are reckoned with."""
    zero = np.zeros(model.layout.n)
    model.loading.share = 0.0
    bare = model.acceleration(state, zero)
    model.loading.share = 1.0
    full = model.acceleration(state, zero)
    model.loading.share = share
    free, by = freedoms_of(model, state), model.derivatives(state)
    model.loading.share = 1.0
    Z = free.Z
    mass = Z.T @ by.force_a @ Z
    load = mass @ (full - bare)[free.which]
    force = mass @ bare[free.which] + share * load
    return _Balance(state, force, -mass @ (by.acceleration_q @ Z)[free.which], load, Z)


def _tangent(here: _Balance, metric: Array) -> Array:
    """(n + 1,) unit tangent of the path, configuration and part of the loads."""
    rows = np.column_stack([here.stiffness, -here.load])
    scale = np.abs(rows).max(axis=1, keepdims=True)
    _, _, ways = np.linalg.svd(rows / np.where(scale > 0.0, scale, 1.0))
    way = ways[-1]
    whole = np.append(here.Z @ way[:-1], way[-1])
    return whole / np.sqrt(whole @ (metric * whole))


def _along(
    model: Dynamics, here: _Balance, share: float, ahead: Array, distance: float, metric: Array
) -> tuple[_Balance, float, int] | None:
    """The equilibrium at a distance along the tangent, its part of the loads, and the iterations."""
    made = distance * ahead

    def bordered(at: _Balance) -> tuple[Array, Array]:
        normal = metric * ahead
        matrix = np.block(
            [[at.stiffness, -at.load[:, None]], [(normal[:-1] @ at.Z)[None, :], np.array([[normal[-1]]])]]
        )
        return matrix, np.append(at.force, normal @ (distance * ahead - made))

    def moved(change: Array, at: _Balance) -> None:
        made[:] += np.append(at.Z @ change[:-1], change[-1])

    start = _moved(model, here.state, made[:-1])
    return _solved(model, start, share + float(made[-1]), metric, bordered, moved)


def _held(model: Dynamics, state: State, share: float) -> _Balance | None:
    """The equilibrium near by at a part of the loads."""
    metric = np.ones(model.layout.n + 1)
    found = _solved(model, state, share, metric, lambda at: (at.stiffness, at.force), lambda _change, _at: None)
    return None if found is None else found[0]


def _solved(
    model: Dynamics,
    state: State,
    share: float,
    metric: Array,
    system: Callable[[_Balance], tuple[Array, Array]],
    moved: Callable[[Array, _Balance], None],
) -> tuple[_Balance, float, int] | None:
    """Newton's iteration to rounding; None where it does not converge."""
    last, at = np.inf, _balance(model, state, share)
    for count in range(1, ITERATIONS + 1):
        matrix, residual = system(at)
        try:
            change = np.asarray(np.linalg.solve(matrix, residual), dtype=float)
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(change).all():
            return None
        k = at.stiffness.shape[0]
        step = at.Z @ change[:k]
        size = float(np.sqrt(step @ (metric[:-1] * step)))
        if size > 4.0 * LONGEST or (size <= ROUNDED and size >= 0.5 * last):
            return (at, share, count) if size <= ROUNDED else None
        last = size
        moved(change, at)
        share += float(change[k]) if change.size > k else 0.0
        at = _balance(model, _moved(model, at.state, step), share)
    return (at, share, ITERATIONS) if last <= ROUNDED else None


def _moved(model: Dynamics, state: State, change: Array) -> State:
    """The configuration elsewhere, loops closed, at rest."""
    q, r, s = model.layout.split(model.closed(model.moved(state, change)).array)
    return model.unpack(np.concatenate([q, np.zeros_like(r), s]))


def _crossing(model: Dynamics, one: _Balance, low: float, two: _Balance, high: float) -> float:
    """The part of the loads between two equilibria at which the stiffness is singular: by the softest eigenvalue."""
    if one.softest * two.softest >= 0.0:
        return 0.5 * (low + high)
    for _ in range(8):
        share = low + (high - low) * one.softest / (one.softest - two.softest)
        middle = _held(model, one.state, share)
        if middle is None:  # near a limit point there may be no equilibrium at a given load
            return share
        if middle.softest * one.softest > 0.0:
            one, low = middle, share
        else:
            two, high = middle, share
        if abs(high - low) <= BRACKET or abs(middle.softest) <= SOFT:
            break
    return low + (high - low) * one.softest / (one.softest - two.softest)
