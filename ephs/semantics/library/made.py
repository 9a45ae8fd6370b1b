"""Library parts from one formula each: traced once, with the parameters as numbers of the program."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ephs.operad import Interface
from ephs.semantics.bundle import Array, Bundle, Reference
from ephs.semantics.errors import StructureError
from ephs.semantics.primitives import Formula, Irreversible, Point, Storage

__all__ = ["dissipated", "finite", "non_negative", "positive", "stored"]


def positive(path: str, **parameters: float) -> None:
    """Refuse parameters that are not positive."""
    for key, value in parameters.items():
        if not (math.isfinite(value) and value > 0.0):
            raise StructureError("parameter", path, key=key, found=value, expected="a number > 0")


def finite(path: str, **parameters: float) -> None:
    """Refuse parameters that are not finite."""
    for key, value in parameters.items():
        if not math.isfinite(value):
            raise StructureError("parameter", path, key=key, found=value, expected="a finite number")


def non_negative(path: str, **parameters: float) -> None:
    """Refuse parameters that are negative."""
    for key, value in parameters.items():
        if not (math.isfinite(value) and value >= 0.0):
            raise StructureError("parameter", path, key=key, found=value, expected="a number ≥ 0")


def stored(
    name: str, interface: Interface, energy: Callable[..., Any], numbers: Mapping[str, float], **said: object
) -> Storage:
    """A storage of an energy of the ports' states and the numbers, by name; ``said`` are further parameters."""
    from ephs.semantics.forms import storage_form

    def whole(**states: Any) -> Any:
        return energy(**states, **numbers)

    def value(x: Point) -> float:
        with np.errstate(all="ignore"):  # what is not a number is found by its value
            return float(whole(**{str(port): np.float64(x[port][0]) for port in interface}))

    form = storage_form(interface, whole)
    return Storage(
        name,
        interface,
        energy=value,
        gradient=form.gradient,
        discrete_gradient=form.discrete_gradient,
        parameters=(*numbers.items(), *said.items()),
        kernel=form.kernel,
        formula=Formula(energy, tuple(numbers)),
    )


def dissipated(
    name: str, interface: Interface, matrix: Callable[..., Any], numbers: Mapping[str, float], **said: object
) -> Irreversible:
    """A process of M, a function of energy efforts, states that are read, and the numbers, by name."""
    from ephs.semantics.forms import irreversible_kernel

    bundle = Bundle.of(interface)
    reads = tuple(port for port, port_type in interface.items() if not port_type.power)

    def whole(**values: Any) -> Any:
        return matrix(**values, **numbers)

    def evaluate(x: Point, e: Array, reference: Reference) -> Array:
        given = bundle.split(e + bundle.intensive(reference)) | {port: x[port] for port in reads}
        with np.errstate(all="ignore"):
            return np.array(whole(**{str(port): np.float64(value[0]) for port, value in given.items()}), dtype=float)

    kernel = irreversible_kernel(interface, reads, Formula(whole))
    parameters = (*numbers.items(), *said.items())
    return Irreversible(name, interface, evaluate, reads, parameters, kernel, Formula(matrix, tuple(numbers)))
