"""Stages of a Runge-Kutta step one by one, where the equations have to be evaluated carefully or ask Python."""

from collections.abc import Callable

from ephs.semantics.bundles.bundle import Array


def evaluated(
    rates: Callable[[float, Array], Array], a: Array, c: Array, h: float, y0: Array, k: Array
) -> tuple[Array, Array]:
    """Evaluate the rates k (stages + 1, size) at the stages and the end of a step of h seconds from y0, k[0] known.

    Parameters
    ----------
    rates
        ẏ at a part of the step and y.
    a, c
        (stages + 1, stages) coefficients, the last row of which leads to the end, and (stages,) nodes.

    Returns
    -------
    tuple[Array, Array]
        y at the last stage and at the end.
    """
    last = end = y0
    for i, part in enumerate([*c[1:].tolist(), 1.0], 1):
        last, end = end, y0 + h * (a[i, :i] @ k[:i])
        k[i] = rates(part, end)
    return last, end
