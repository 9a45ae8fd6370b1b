"""A mass on a spring, alone or with friction, filled with parts of the library."""

from typing import Any

from ephs import Pattern, System
from ephs import library as lib
from tests.operad.models import DAMPED, OSCILLATOR

__all__ = ["damped_oscillator", "free_oscillator", "oscillator"]

FREE = Pattern.from_text("q: displacement; p: momentum; pe(q); ke(p); pkc(q, p)")


def oscillator(k: float = 1.5, m: float = 1.0, **parts: Any) -> System:
    """A mass on a spring, or what is given in their place; the momentum is an outer port."""
    return OSCILLATOR({"pe": lib.spring(k=k), "ke": lib.point_mass(m=m), "pkc": lib.pkc()} | parts)


def free_oscillator(k: float = 1.0, m: float = 1.0, **parts: Any) -> System:
    """The same without an outer port."""
    return FREE({"pe": lib.spring(k=k), "ke": lib.point_mass(m=m), "pkc": lib.pkc()} | parts)


def damped_oscillator(k: float = 1.5, m: float = 2.0, d: float = 0.1) -> System:
    """A mass on a spring, whose friction heats the environment."""
    return DAMPED(osc=oscillator(k, m), mf=lib.friction(d=d), env=lib.environment())
