"""A mode to look at: superposed on the state about which a model was linearised."""

from typing import TYPE_CHECKING

import numpy as np

from ephs.mechanics.linear.modes import Mode
from ephs.solve.posing.errors import OptionError, count_of, number_of

if TYPE_CHECKING:
    from ephs.mechanics.linear.statespace import StateSpace
    from ephs.solve.result.solution import Solution


def film(
    system: "StateSpace", mode: Mode | int, amplitude: float, periods: float, frames: int, decay: bool
) -> "Solution":
    """See `StateSpace.film`."""
    modes = system.modes
    if not isinstance(mode, Mode):
        if not isinstance(mode, int) or not -len(modes) <= mode < len(modes):
            raise OptionError("mode", mode, f"a mode, or a number below {len(modes)}")
        mode = modes[mode]
    if (frames := count_of("frames", frames)) < 2:
        raise OptionError("frames", frames, "two or more")
    for name, given in (("amplitude", amplitude), ("periods", periods)):
        if not 0.0 < number_of(name, given, "a number > 0") < np.inf:
            raise OptionError(name, given, "a number > 0")
    value = mode.eigenvalue
    unit = 2.0 * np.pi / abs(value.imag) if value.imag else 1.0 / abs(value.real) if value.real else 1.0
    t = np.linspace(0.0, periods * unit, frames)
    if value.imag:
        turning = np.exp((value if decay else 1j * value.imag) * t)
    elif decay:
        turning = np.exp(value.real * t).astype(complex)
    else:  # modes without oscillation are shown back and forth
        turning = np.exp(1j * np.pi * t / t[-1]) * -1j
    places = [name for name in mode.shape if not name.startswith("bodies.")]
    largest = max((float(np.abs(mode.shape[name]).max(initial=0.0)) for name in places), default=0.0) or 1.0
    moved = np.real(np.outer(turning, mode.vector)) * (amplitude / largest)
    return system.play(t, moved)
