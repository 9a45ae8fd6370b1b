"""The damped oscillator, filled with parts of the library."""

from ephs import System
from ephs import library as lib
from tests.operad.models import DAMPED, OSCILLATOR

__all__ = ["damped_oscillator"]


def damped_oscillator(k: float = 1.5, m: float = 2.0, d: float = 0.1) -> System:
    """A mass on a spring, whose friction heats the environment."""
    inner = OSCILLATOR(pe=lib.spring(k=k), ke=lib.point_mass(m=m), pkc=lib.pkc())
    return DAMPED(osc=inner, mf=lib.friction(d=d), env=lib.environment())
