"""Initial states of systems against the constraints between their rates."""

import numpy as np

from ephs.semantics.bundle import Array
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.codes import VECTOR
from ephs.solve.errors import Outcome, SolveError
from ephs.solve.methods.natural import Natural
from ephs.solve.model import Model
from ephs.solve.problem import Problem

INSTANT = 1e-7
"""Step without motion, as a fraction of a step."""
JUMP = 1e-6
"""Jumps below this fraction of the states of their kind count as rounding of the given values."""
SMALL = 1e-6
"""Least scale of the states of a kind, in its unit."""


def check_start(problem: Problem, model: Model, h: float) -> None:
    """Refuse initial states that contradict the constraints: their change does not shrink with the step.

    Scenes are assembled before, and are not looked at. What a step cannot be solved for here says so later.

    Raises
    ------
    SolveError
        It names the state that jumps farthest.
    """
    if problem.scene is not None or not model.constraint_rows.size:
        return
    d = problem.descriptor
    x = d.pack(problem.initial)
    jumps: list[Array] = []
    method = Natural(model)
    for instant in (INSTANT * h, 0.5 * INSTANT * h):
        after, chunk = method.advance(method.init(x), instant, 1)
        if chunk.failure is not None:
            return
        moved = np.abs(instant * after.z[: d.rate_size])
        jumps.append(np.array([moved[slot.rates].max(initial=0.0) for slot in d.states]))
    sizes: dict[str, float] = {}
    for slot in d.states:
        flat = manifold(slot.quantity.space).code == VECTOR
        size = float(np.abs(x[slot.point]).max(initial=0.0)) if flat else 1.0
        sizes[slot.quantity.kind] = max(sizes.get(slot.quantity.kind, 0.0), size)
    limits = np.array([JUMP * max(sizes[slot.quantity.kind], SMALL) for slot in d.states])
    share = np.where(jumps[1] > 0.75 * jumps[0], jumps[1] / limits, 0.0)
    if share.max(initial=0.0) > 1.0:
        path = str(d.states[int(np.argmax(share))].path)
        raise SolveError(Outcome.INCONSISTENT, path, "the constraints do not hold at the start")
