"""Stages of a Runge-Kutta step one by one, where the equations have to be evaluated carefully or ask Python."""

from collections.abc import Callable, Mapping

import numpy as np

from ephs.semantics.bundle import Array
from ephs.solve.errors import Outcome, SolveError
from ephs.solve.march.collocation import ENOUGH, ROUGH, ROUGH_ON_GRID, STALLED, SWEEPS


def evaluated(
    rates: Callable[[float, Array], Array],
    scheme: Mapping[str, Array],
    c: Array,
    h: float,
    y0: Array,
    k: Array,
    measured: Callable[[Array], Array] | None,
    *,
    chosen: bool,
) -> tuple[Array, Array]:
    """Evaluate the rates k (stages + 1, size) at the stages and the end of a step of h seconds from y0, k[0] known.

    Parameters
    ----------
    rates
        ẏ at a part of the step and y.
    scheme, c
        The coefficients by the names of `ephs.solve.march.Tableau`, and the nodes.
    measured
        A change of rates in h seconds relative to what errors may be, for stages that are iterated.
    chosen
        Whether steps are chosen; else stages are iterated to rounding.

    Returns
    -------
    tuple[Array, Array]
        y at the last stage and at the end.

    Raises
    ------
    SolveError
        The stages do not come to agree.
    """
    a, guess, count = scheme["a"], scheme["guess"], scheme["a"].shape[1]
    first, last = (guess, y0) if len(guess) else (a, y0)
    for i in range(1, count):
        last = y0 + h * (first[i, :i] @ k[:i])
        k[i] = rates(float(c[i]), last)
    before, rough = np.inf, ROUGH if chosen else ROUGH_ON_GRID
    for sweep in range(SWEEPS + 1 if measured is not None and len(guess) else 0):
        total = 0.0
        for i in range(1, count):
            last = y0 + h * (a[i] @ k[:count])
            found = rates(float(c[i]), last)
            total += float(np.sum(measured(found - k[i]) ** 2)) if measured is not None else 0.0
            k[i] = found
        now = total**0.5
        if now <= ENOUGH or (now > STALLED * before and now <= rough):
            break
        if sweep == SWEEPS or (sweep > 2 and not now < before):
            raise SolveError(Outcome.DIVERGED, "", "the stages of a step")
        before = now
    end = y0 + h * (a[count] @ k[:count])
    k[count] = rates(1.0, end)
    return last, end
