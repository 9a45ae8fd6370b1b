"""Initial states of systems against the constraints between their rates."""

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Storage
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
SMALL = 1e-6
"""Least scale of the states of a kind, in its unit."""


def _jump(method: Natural, problem: Problem, x: Array, instant: float) -> tuple[Array, Array] | None:
    """Largest change of each state (states,) in a step without motion, and the state halfway; None where it fails."""
    d = problem.descriptor
    after, chunk = method.advance(method.init(x), instant, 1)
    if chunk.failure is not None:
        return None
    moved = instant * after.z[0, : d.rate_size]
    sizes = np.array([np.abs(moved[slot.rates]).max(initial=0.0) for slot in d.states])
    return sizes, d.advance(x, 0.5 * moved)


def _left(method: Natural, problem: Problem, x: Array, h: float) -> Array:
    """Jumps (states,) that a step h of the method itself leaves, from a state on the constraints: its momenta keep off
    them by its error.
    """
    there, chunk = method.advance(method.init(x), h, 1)
    found = None if chunk.failure is not None else _jump(method, problem, there.x, 0.5 * INSTANT * h)
    return np.zeros(len(problem.descriptor.states)) if found is None else SEVERAL * found[0]


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
    x = problem.descriptor.pack(problem.initial)
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
    stored = {i for slot in d.components if isinstance(slot.primitive, Storage) for i in slot.efforts}
    return len(stored) < d.effort_size


def _jumping(problem: Problem, model: Model, x: Array, h: float) -> str:
    """Path of the state that jumps farthest in an instant of a step h, whatever its length; empty where none does."""
    d = problem.descriptor
    method = Natural(model)
    jumps = [_jump(method, problem, x, instant) for instant in (INSTANT * h, 0.5 * INSTANT * h)]
    if jumps[0] is None or jumps[1] is None:
        return ""
    sizes: dict[str, float] = {}
    for slot in d.states:
        flat = manifold(slot.quantity.space).code == VECTOR
        size = float(np.abs(x[slot.point]).max(initial=0.0)) if flat else 1.0
        sizes[slot.quantity.kind] = max(sizes.get(slot.quantity.kind, 0.0), size)
    limits = np.array([JUMP * max(sizes[slot.quantity.kind], SMALL) for slot in d.states])
    share = np.where(jumps[1][0] > 0.75 * jumps[0][0], jumps[1][0] / limits, 0.0)
    if share.max(initial=0.0) > 1.0 and np.any(share > _left(method, problem, jumps[1][1], h) / limits):
        return str(d.states[int(np.argmax(share))].path)
    return ""
