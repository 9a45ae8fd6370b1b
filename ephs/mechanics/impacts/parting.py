"""Parts of a step after which it is divided: a gap closes, or a slip stops."""

import numpy as np

from ephs.semantics.bundles.bundle import Array

FLAT = 1e-9
"""Imaginary part beside 1 of a root that is real, and what is missing of all friction that counts as none."""


def closing_part(start: float, slope: float, end: float, slope1: float, closed: float) -> float:
    """First fraction of a step at which a gap with these values and slopes at both ends closes; 1 if it stays open."""
    closed += max(-start, 0.0)  # a gap within rounding at the start may remain
    cubic = np.array([2.0 * (start - end) + slope + slope1, 3.0 * (end - start) - 2.0 * slope - slope1, slope, start])
    turns = np.roots(np.polyder(cubic))
    inside = [float(x) for x in turns.real[np.abs(turns.imag) < FLAT] if 0.0 < x < 1.0]
    if min([end, *(float(np.polyval(cubic, x)) for x in inside)]) >= -closed:
        return 1.0
    found = np.roots(cubic)
    for x in np.sort(found.real[np.abs(found.imag) < FLAT]).tolist():
        if 0.0 < x < 1.0 and np.polyval(np.polyder(cubic), x) <= 0.0:
            return x
    back = [x for x in inside if np.polyval(np.polyder(cubic, 2), x) < 0.0] if start < 0.0 else []
    return min(back, default=0.5)  # it reverses before it was open


def stopping_parts(before: Array, stop: Array, impulse: Array, friction: list[float], still: float) -> Array:
    """(contacts,) fractions of a step at which slipping contacts stop; 1 of those that do not."""
    first, last, force = (v.reshape(-1, 3)[:, 1:] for v in (before, stop, impulse))
    shares = np.ones(len(friction))
    for i, coefficient in enumerate(friction):
        speed, back = float(first[i] @ first[i]), float(first[i] @ last[i])
        if back >= -still * np.sqrt(speed) or not speed:
            continue
        most = coefficient * float(impulse[3 * i])
        held = float(np.hypot(*force[i])) / most if most > 0.0 else 1.0
        shares[i] = 0.5 * held if held < 1.0 - FLAT else speed / (speed - back)
    return shares
