"""Gradients given by hand against the energy: its exact derivative, or differences where it cannot be recorded."""

import itertools
from typing import TYPE_CHECKING

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.derive.recording import Untraceable, record
from ephs.semantics.derive.relations import StorageStep as Recorded
from ephs.semantics.spaces import manifold
from ephs.semantics.verdicts.claims import flat_gradient
from ephs.semantics.verdicts.rounding import ROUNDED, rounding, slopes_of, steps_of

if TYPE_CHECKING:
    from ephs.semantics.primitives.primitives import Point, Storage

SAME = 1e-9
"""Relative difference of two formulas of one number, whose constants may be written with so few digits."""
LENGTHS = tuple(10.0**-k for k in (2, 3, 4, 1, 5, 6, 7, 8, 9, 10, 11, 12))
"""Lengths of steps for differences of energies; the first ones suffice for most."""
SHARP = 1e-6
"""Relative error of a difference that is sharp enough to agree with."""
ROUNDING = 16.0 * float(np.finfo(float).eps)
"""Rounding of an energy, relative to it."""
AGREEING = 3
"""Lengths of steps whose slopes must all contradict a gradient, those with the least errors."""
BEYOND = 10.0
"""How much larger than its own estimate the error of a difference may be."""

Defect = tuple[int, float, float]
"""Entry of the gradient, what it is, and what it should be."""


def gradient_defect(storage: "Storage", x: "Point", gradient: Array) -> Defect | None:
    """An entry of a storage's gradient (n,) at a state that is not the energy's slope, or None."""
    kernel = None if storage.kernel is None else storage.kernel.relation
    if isinstance(kernel, Recorded):
        if storage.formula is None or storage.formula.gradient is None:  # it is derived from the record
            return None
        return _off_record(storage, kernel, x, gradient)
    return _off_differences(storage, x, gradient)


def _off_record(storage: "Storage", relation: Recorded, x: "Point", gradient: Array) -> Defect | None:
    assert storage.kernel is not None
    numbers = [float(entry) for port in storage.reads for entry in x[port]]
    parameters = storage.kernel.parameters[len(relation.potentials) :]
    exact = slopes_of(relation.energy, relation.ports, numbers, parameters)
    with np.errstate(all="ignore"):
        off = np.abs(gradient - exact) - SAME * np.maximum(np.abs(gradient), np.abs(exact))
    if not np.any(off > 0.0):  # NaN where the slope overflows or does not exist
        return None
    off -= rounding(lambda f: slopes_of(relation.energy, relation.ports, numbers, parameters, f), exact)
    off -= _rounding_of_given(storage, numbers, gradient)
    worst = int(np.argmax(np.where(np.isnan(off), -np.inf, off)))
    return (worst, float(gradient[worst]), float(exact[worst])) if off[worst] > 0.0 else None


def _rounding_of_given(storage: "Storage", numbers: list[float], gradient: Array) -> Array:
    """Bound of the rounding of a gradient given by hand."""
    assert storage.formula is not None
    given = storage.formula.gradient
    assert given is not None
    sizes = {str(port): manifold(storage.interface[port].quantity.space).size for port in storage.reads}

    try:
        recording = record(flat_gradient(given), {name: None if size == 1 else size for name, size in sizes.items()})
    except Untraceable:
        return ROUNDED * np.abs(gradient).sum() * np.ones(gradient.shape)
    outputs = list(recording.tape.outputs)
    return rounding(lambda factor: steps_of(recording, numbers, factor)[outputs], steps_of(recording, numbers)[outputs])


def _off_differences(storage: "Storage", x: "Point", gradient: Array) -> Defect | None:
    """Along a random direction, and along one coordinate: other ones at other states."""
    n = storage.bundle.size
    if n == 0:
        return None
    source = np.random.default_rng(int(abs(hash(tuple(float(each) for port in storage.reads for each in x[port])))))
    for direction in (np.eye(n)[source.integers(n)], *source.standard_normal((1 if n > 1 else 0, n))):
        slope = float(gradient @ direction)
        expected = _contradiction(storage, x, direction, slope)
        if expected is not None:
            return int(np.argmax(np.abs(direction * gradient))), slope, expected
    return None


def _contradiction(storage: "Storage", x: "Point", direction: Array, slope: float) -> float | None:
    """The slope of the energy along a direction, if differences over several lengths contradict the given one."""
    try:
        here = float(storage.energy(x))
    except (ArithmeticError, ValueError):
        return None
    size = float(np.abs(np.concatenate([x[port] for port in storage.reads])).max(initial=0.0))
    found: list[tuple[float, float]] = []
    for length in LENGTHS:
        try:
            error, expected = _difference(storage, x, direction, length, here)
        except (ArithmeticError, ValueError):
            continue
        error += ROUNDING * size / length * max(abs(slope), abs(expected))
        if not np.isfinite(error):
            continue
        if abs(slope - expected) <= SAME * abs(expected) + error <= SHARP * abs(expected):
            return None
        found.append((error, expected))
    found = sorted(found)[:AGREEING]
    apart = all(abs(slope - expected) > SAME * abs(expected) + error for error, expected in found)
    return found[0][1] if len(found) == AGREEING and apart else None


def _difference(storage: "Storage", x: "Point", direction: Array, length: float, here: float) -> tuple[float, float]:
    """Error and slope of an energy by central differences over a step, its half and its quarter (Richardson).

    The error is what the extrapolation changes, and the rounding of the energies; infinite where the second differences
    do not shrink with the square of the step, as across a pole or a kink.
    """
    firsts: list[float] = []
    seconds: list[float] = []
    largest = abs(here)
    for part in (1.0, 0.5, 0.25):
        there, back = (
            float(storage.energy(storage.retract(x, side * part * length * direction))) for side in (1.0, -1.0)
        )
        firsts.append((there - back) / (2.0 * part * length))
        seconds.append((there - here) - (here - back))
        largest = max(largest, abs(there), abs(back))
    noise = ROUNDING * largest
    smooth = all(abs(a - 4.0 * b) <= 0.5 * abs(a) + noise for a, b in itertools.pairwise(seconds))
    wide, half, quarter = firsts
    one, two = (4.0 * half - wide) / 3.0, (4.0 * quarter - half) / 3.0
    return (BEYOND * abs(two - one) + 4.0 * noise / length if smooth else np.inf), two
