"""One step of any method, from a state of the reduced form."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ephs.mechanics.methods import Setting, chosen
from ephs.mechanics.reduced.equations import Equations, ReducedState
from ephs.mechanics.reduced.method import ReducedMethod
from ephs.mechanics.solve.control import Control, Tolerance
from ephs.mechanics.solve.errors import OptionError
from ephs.mechanics.solve.problem import Problem
from ephs.operad import Path
from ephs.semantics.bundle import Array

if TYPE_CHECKING:
    from ephs.mechanics.methods import Method

__all__ = ["one_step"]


def one_step(
    problem: Problem, equations: Equations, state: ReducedState, h: float, method: "str | Method"
) -> ReducedState | Mapping[Path, Array]:
    """The state of the reduced form, or all states of the system where the method is not of that form.

    Raises
    ------
    OptionError
        There is no such method, it takes no constant steps, or h is no length of a step.
    SolveError
        The step has no solution.
    """
    if not (np.isfinite(h) and h != 0.0):
        raise OptionError("h", h, "a number of seconds other than 0")
    of, _ = chosen(method, problem, step=abs(h))
    tolerance = Tolerance.of("rtol", 1e-10, 1e-10), Tolerance.of("atol", 1e-12, 1e-12)
    control = Control(*tolerance, abs(h), 0.0, np.inf, None)
    here = replace(problem, initial={**problem.initial, **equations.states(state)})
    stepper, _ = of.make(Setting(here, 0.0, control, {}, equations))
    if isinstance(stepper, ReducedMethod):
        return stepper.step(state, h).end
    start = stepper.start(0.0, h)
    return problem.descriptor.unpack(stepper.row(stepper.step(start, h).end).x)
