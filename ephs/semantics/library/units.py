"""`fmu`: a co-simulation unit of FMI as a part."""

from collections.abc import Mapping
from os import PathLike
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ephs.solve.exchange.unit import Unit

__all__ = ["fmu"]


def fmu(
    path: str | PathLike[str],
    *,
    ports: Mapping[str, Mapping[str, str]] | None = None,
    start: Mapping[str, float] | None = None,
) -> "Unit":
    """A unit of FMI 2.0 or 3.0 for co-simulation: a box with signal ports, and power ports where they are declared.

    It is the environment of a system, not a part of its equations: `Exchange` steps it between samples. It runs native
    code from the file in this process.

    Parameters
    ----------
    path
        A file that ends in ``.fmu``; FMPy loads it.
    ports
        Power ports by name: ``{"shaft": {"effort": "torque", "flow": "speed"}}``, one of the two an input and the
        other an output, whose product is the power into the unit. ``"integral"`` may name a third variable, the
        integral of the output over time; with it the energy is accounted without error.
    start
        Values of parameters and inputs.

    Raises
    ------
    ExchangeError
        No such unit, or one that does not fit the machine; unknown variables; a product that is no power.
    """
    from ephs.solve.exchange.unit import unit_of

    return unit_of(path, ports, start)
