"""Warning of long runs whose error estimates are rounding of the rates, which shorter steps do not reduce.

The acceleration of a light body between heavy ones is the difference of two large forces, divided by a small mass.
Rounding of the state can change it by more than the tolerance of a step. As the tolerance of a step falls with its
length, the number of steps grows without a gain in accuracy.
"""

from typing import TYPE_CHECKING, Final

import numpy as np

from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.mechanics.tree.finding.naming import counted
from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import worst_entry

if TYPE_CHECKING:
    from ephs.mechanics.methods.method import ReducedMethod

LOOKED: Final = 1024
"""Steps before a run is looked at, and between further looks at least."""
MANY: Final = 20_000
"""Steps from which on a run counts as long."""
EPSILON: Final = float(np.finfo(float).eps)
FELT: Final = 1.0
"""Part of a step's tolerance from which on rounding holds steps short."""


def rate_rounding(equations: ReducedEquations, state: ReducedState) -> Array:
    """(counted,) by how much rates a second change where every number of the state is rounded the other way."""
    y = equations.vector(state)
    turned = y + EPSILON * (np.abs(y) + (np.arange(y.size) < equations.nv)) * (-1.0) ** np.arange(y.size)
    before = equations.rates(state.t, state.q, y).copy()
    return np.abs(equations.rates(state.t, state.q, turned) - before)[equations.counted]


def held_by_rounding(method: "ReducedMethod", state: ReducedState, h: float, span: float, steps: float) -> str | None:
    """Warning text for a long run whose steps rounding holds short; None for other runs.

    It names the rate that is rounded most beside its tolerance.

    Parameters
    ----------
    h, span
        The next step, and the whole run, in s.
    steps
        Expected number of steps of the run.
    """
    if steps < MANY:
        return None
    eq = method.equations
    y = eq.vector(state)
    shared = (span / h) ** method.share * h / (method.atol + method.rtol * eq.sizes(y, y))
    felt = rate_rounding(eq, state) * shared
    worst = worst_entry(felt)
    if not felt[worst] >= FELT:
        return None
    path, what = counted(eq.reduced, worst)
    return (
        f"{method.name} will take about {steps:.1g} steps: rounding of {what.replace('its', 'the')} of {path} is "
        f"{felt[worst]:.1g} times what these tolerances leave to a step"
    )
