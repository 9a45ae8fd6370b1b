"""Warning of long runs whose error estimates are rounding of the rates, which shorter steps do not reduce.

The acceleration of a light body between heavy ones is the difference of two large forces, divided by a small mass.
Rounding of the state can change it by more than the tolerance of a step. As the tolerance of a step falls with its
length, the number of steps grows without a gain in accuracy.
"""

import warnings
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.mechanics.tree.finding.naming import counted
from ephs.semantics.bundles.bundle import Array
from ephs.solve.auditing.findings import CostWarning
from ephs.solve.posing.errors import worst_entry

if TYPE_CHECKING:
    from ephs.mechanics.methods.method import ReducedMethod

LOOKED: Final = 1024
"""Steps before a run is looked at; doubled for each further look."""
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


def warn_of_rounding(method: "ReducedMethod", state: ReducedState, march: Any) -> bool:
    """Tell a user that rounding is what holds the steps of a long run short; whether it is.

    Parameters
    ----------
    march
        The record of `MarchControl`: time, span, steps and the next one.

    Warns
    -----
    CostWarning
        It names the rate that is rounded most beside its tolerance.
    """
    steps, h = march.steps * march.span / march.time, float(march.step)
    if steps < MANY:
        return False
    eq = method.equations
    y = eq.vector(state)
    shared = (march.span / h) ** method.share * h / (method.atol + method.rtol * eq.sizes(y, y))
    felt = rate_rounding(eq, state) * shared
    worst = worst_entry(felt)
    found = bool(felt[worst] >= FELT)
    if found:
        path, what = counted(eq.reduced, worst)
        what = what.replace("its", "the")
        warnings.warn(
            f"{method.name} will take about {steps:.1g} steps: rounding of {what} of {path} is {felt[worst]:.1g} times "
            "what these tolerances leave to a step; loosen atol and rtol",
            CostWarning,
            stacklevel=2,
        )
    return found
