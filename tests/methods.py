"""Names of the methods by what they can do."""

import math

from ephs.mechanics.methods.registry import METHODS
from ephs.solve.running.control import Control, Tolerance

__all__ = ["FIXED_OF_SCENES", "OF_SCENES", "choosing"]

OF_SCENES = [name for name, method in METHODS.items() if method.scenes]
"""Methods that move scenes."""

FIXED_OF_SCENES = [name for name in OF_SCENES if METHODS[name].fixed]
"""Those of them that take constant steps."""


def choosing(rtol: float, atol: float | None = None) -> Control:
    """Control of chosen steps; without an absolute tolerance it is as large as the relative one."""
    return Control(Tolerance(rtol, {}), Tolerance(rtol if atol is None else atol, {}), None, 0.0, math.inf, None)
