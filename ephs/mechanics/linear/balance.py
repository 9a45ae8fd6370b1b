"""The balance of a mechanism's forces, by steps along the eigenvectors of its stiffness."""

import numpy as np

from ephs.mechanics.dynamics import Dynamics, State
from ephs.mechanics.linear.continuation import StaticPath, follow, metric_of
from ephs.mechanics.linear.freedoms import freedoms_of, lengths_of, resting, unbalanced
from ephs.mechanics.linear.structure import largest_entry
from ephs.mechanics.tree.finding.spanning import Edge
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import metric_eigen
from ephs.semantics.spaces.rank import ELIMINATION, TINY
from ephs.solve.posing.errors import Outcome, SimulationError
from ephs.solve.posing.problem import NO_STATE

STALLED = 1e-9
"""Allowed unbalanced fraction of the forces, those of a strain by 1 rad or m included."""
UNFELT = 1e-9
"""Fraction of the forces along directions without stiffness that counts as rounding."""
ENOUGH, ROUNDED = 1e-10, 1e-5
"""Change of a Newton step that is its last one, rad or parts of the length: the next one is below rounding; and of one
that no longer gets smaller, as rounding of stiff parts moves soft ones. Forces do not tell: those of stiff parts are
large however little these are strained."""
STRIDE = 0.3
"""Largest change of a mechanism in one step, in rad or m."""
STEPS = 40
"""Largest number of steps downhill: mechanisms, and rods of any softness, need at most 15; sheets lose their way."""
HALVINGS = 8
"""Reduction of a step after which loops do not close."""


def balanced(model: Dynamics) -> tuple[State, float, int, StaticPath | None]:
    """The equilibrium, its unbalanced fraction of the forces, the number of steps, and the path of the loads."""
    if not model.loading:
        return *_settled(model), None
    model.loading.share = 0.0
    try:
        start, _, _ = _settled(model)
    finally:
        model.loading.share = 1.0
    path = follow(model, start, model.problem.length)
    if path is None:  # as of what floats, whose stiffness is singular all the way
        return *_settled(model), None
    state = path.states[-1]
    left = unbalanced(model, state, freedoms_of(model, state), model.derivatives(state).force_q)
    return state, left, len(path.shares) - 1, path


def _settled(model: Dynamics) -> tuple[State, float, int]:
    """The equilibrium, its unbalanced fraction of the forces, and the number of steps.

    Steps along eigenvectors lose their way where soft parts move far, as each step strains the stiff ones. Then what is
    not balanced at the start is held there, and let go little by little.
    """
    lengths = lengths_of(model)
    start = resting(model, model.state0, lengths)
    try:
        return _descended(model, start, lengths)
    except SimulationError:
        path = follow(model, start, model.problem.length, held=model.applied(start) - model.gravity(start))
        if path is None or path.unstable[-1]:  # what it leads to is no minimum
            raise
    state, left, steps = _descended(model, path.states[-1], lengths)
    return state, left, STEPS + len(path.shares) - 1 + steps


def _descended(model: Dynamics, state: State, lengths: list[int]) -> tuple[State, float, int]:
    """The equilibrium near a state, as of `_settled`."""
    weights, best, stalled = metric_of(model, model.problem.length)[:-1], np.inf, 0
    metric = np.sqrt(weights)
    for step in range(STEPS):
        free, stiffness = freedoms_of(model, state), model.stiffness(state, lengths)
        Z, left = free.Z, unbalanced(model, state, free, stiffness)
        K = Z.T @ stiffness @ Z
        force = Z.T @ (model.mass_matrix(state) @ _still(model, state))
        values, ways = metric_eigen(0.5 * (K + K.T), Z.T @ (weights[:, None] * Z))
        size = np.abs(values)
        flat = size <= ELIMINATION * size.max(initial=0.0)
        push = ways.T @ force
        push[flat & (np.abs(push) <= UNFELT * np.abs(push).max(initial=0.0))] = 0.0
        most = max(float(size.max(initial=0.0)), TINY)
        farthest = Z @ (ways @ (push / np.maximum(size, max(ELIMINATION * most, TINY))))
        reach = largest_entry(metric * farthest)
        best, stalled = (reach, 0) if reach < 0.5 * best else (best, stalled + 1)
        if left <= STALLED and (reach <= ENOUGH or (reach <= ROUNDED and stalled >= 3)):
            return state, left, step
        change = Z @ (ways @ (push / np.where(flat, most, size)))
        change /= max(1.0, largest_entry(change) / STRIDE)
        state = _nearest(model, state, change, lengths)
    raise restless(*_culprit(model, state))


def _nearest(model: Dynamics, state: State, change: Array, lengths: list[int]) -> State:
    """The state without rates after a change, or the largest half, quarter, … of it after which loops close."""
    for halvings in range(HALVINGS):
        try:
            return resting(model, model.closed(model.moved(state, 0.5**halvings * change)), lengths)
        except SimulationError:
            continue
    return resting(model, model.closed(model.moved(state, 0.5**HALVINGS * change)), lengths)


def _still(model: Dynamics, state: State) -> Array:
    """(n,) accelerations from rest."""
    found = model.acceleration(state)
    out = np.zeros(model.layout.n)
    for name, where in model.freedoms.items():
        out[where] = found[name][: where.size]
    return out


def _culprit(model: Dynamics, state: State) -> tuple[str, str]:
    """The joint that accelerates most from rest, and how."""
    found = {name: largest_entry(a) for name, a in model.acceleration(state).items()}
    name = max(found, key=lambda n: found[n])
    what = f"from rest it still accelerates by {found[name]:.3g} rad/s² or m/s²"
    driven = [n for n, parts in model.layout.edges.items() if any(_driven(model, edge) for _, edge in parts)]
    if driven:
        what += f"; the constant drive of {', '.join(driven)} is balanced nowhere"
    return f"joints.{name}", what


def _driven(model: Dynamics, edge: Edge) -> bool:
    """Whether a force is given at a joint without a spring."""
    if edge.port is None or edge.spring < 0:
        return False
    spring = model.problem.descriptor.components[edge.spring].primitive
    given = model.problem.signal(edge.port)
    return not given.effort and bool(np.any(given.at(0.0, NO_STATE))) and spring.name == "no_potential"


def restless(path: str, what: str) -> SimulationError:
    """The error of a model without equilibrium near by: where, and what still moves."""
    return SimulationError(Outcome.RESTLESS, 0.0, path, what, None)
