"""Initial states of systems against the constraints between their rates."""

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.codes import VECTOR
from ephs.solve.equations.model import Model
from ephs.solve.equations.oscillations import fastest_of
from ephs.solve.methods.natural import Natural
from ephs.solve.posing.errors import Outcome, SolveError
from ephs.solve.posing.problem import Problem

INSTANT = 1e-7
"""Step without motion, as a fraction of a step."""
TURNED = 0.01
"""Angle in rad by which an oscillation goes on in an instant at most."""
JUMP = 1e-6
"""Jumps below this fraction of the states of their kind count as rounding of the given values."""
SEVERAL = 4.0
"""Times the jump that a step leaves: as much as steps one after the other leave of it."""


def _jump(method: Natural, problem: Problem, x: Array, instant: float) -> tuple[Array, Array] | None:
    """Largest change of each state (states,) in a step without motion, and the state halfway; None where it fails."""
    d = problem.descriptor
    after, chunk = method.advance(method.init(x), instant, 1)
    if chunk.failure is not None:
        return None
    moved = instant * after.z[0, : d.rate_size]
    sizes = np.array([np.abs(moved[slot.rates]).max(initial=0.0) for slot in d.states])
    return sizes, d.advance(x, 0.5 * moved)


def _left(method: Natural, problem: Problem, x: Array, h: float) -> tuple[Array, Array]:
    """Jumps (states,) that a step h of the method itself leaves, from a state on the constraints: its momenta keep off
    them by its error; and the states after the step.
    """
    there, chunk = method.advance(method.init(x), h, 1)
    found = None if chunk.failure is not None else _jump(method, problem, there.x, 0.5 * INSTANT * h)
    return (np.zeros(len(problem.descriptor.states)), x) if found is None else (SEVERAL * found[0], there.x)


def check_start(problem: Problem, model: Model, h: float) -> None:
    """Refuse initial states that contradict the constraints: their change does not shrink with the step.

    Scenes are assembled before, and are not looked at. What a step cannot be solved for here says so later.

    Raises
    ------
    SolveError
        It names the state that jumps farthest.
    """
    if problem.scene is not None or not (model.constraint_rows.size or _bare(problem)):
        return
    x = problem.point
    jumping = _jumping(problem, model, x, h)
    if not jumping:
        return
    fastest = fastest_of(problem, x)
    if fastest is not None and fastest[0] * INSTANT * abs(h) > TURNED:  # such an instant is none to an oscillation
        jumping = _jumping(problem, model, x, np.copysign(TURNED / (INSTANT * fastest[0]), h))
    if jumping:
        raise SolveError(Outcome.INCONSISTENT, jumping, "the constraints do not hold at the start")


def _bare(problem: Problem) -> bool:
    """Whether there is a junction without storage: it constrains as a constraint does."""
    d = problem.descriptor
    stored = {i for slot, _ in d.storages for i in slot.efforts}
    return len(stored) < d.effort_size


def _jumping(problem: Problem, model: Model, x: Array, h: float) -> str:
    """Path of the state that jumps farthest in an instant of a step h, whatever its length; empty where none does."""
    d = problem.descriptor
    method = Natural(model)
    jumps = [_jump(method, problem, x, instant) for instant in (INSTANT * h, 0.5 * INSTANT * h)]
    if jumps[0] is None or jumps[1] is None:
        return ""
    off = np.where(jumps[1][0] > 0.75 * jumps[0][0], jumps[1][0], 0.0)
    if not np.any(off > JUMP * _sizes(d, x)):
        return ""
    left, there = _left(method, problem, jumps[1][1], h)
    limits = np.maximum(JUMP * _sizes(d, x, there), np.finfo(float).tiny)
    share = np.where(off > left, off / limits, 0.0)
    return str(d.states[int(np.argmax(share))].path) if share.max(initial=0.0) > 1.0 else ""


def _sizes(d: Descriptor, *states: Array) -> Array:
    """(states,) largest number of a state of the same kind; 1 of a pose."""
    sizes: dict[str, float] = {}
    for slot in d.states:
        flat = manifold(slot.quantity.space).code == VECTOR
        size = max(float(np.abs(x[slot.point]).max(initial=0.0)) for x in states) if flat else 1.0
        sizes[slot.quantity.kind] = max(sizes.get(slot.quantity.kind, 0.0), size)
    return np.array([sizes[slot.quantity.kind] for slot in d.states])
