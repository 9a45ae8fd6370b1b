"""A mass on a spring, alone or with friction, filled with parts of the library."""

from typing import Any

from ephs import Pattern, System
from ephs import library as lib
from tests.operad.models import DAMPED, OSCILLATOR

__all__ = ["damped_oscillator", "free_oscillator", "oscillator", "rubbed_oscillator"]

FREE = Pattern.from_text("q: displacement; p: momentum; pe(q); ke(p); pkc(q, p)")
RUBBED = Pattern.from_text("q: displacement; p: momentum; s: entropy; pe(q); ke(p); pkc(q, p); mf(p, s); env(s)")


def moving(k: float, m: float) -> dict[str, Any]:
    """A spring, a mass, and what joins them."""
    return {"pe": lib.spring(k=k), "ke": lib.point_mass(m=m), "pkc": lib.pkc()}


def oscillator(k: float = 1.5, m: float = 1.0, **parts: Any) -> System:
    """A mass on a spring, or what is given in their place; the momentum is an outer port."""
    return OSCILLATOR(moving(k, m) | parts)


def free_oscillator(k: float = 1.0, m: float = 1.0, **parts: Any) -> System:
    """The same without an outer port."""
    return FREE(moving(k, m) | parts)


def rubbed_oscillator(k: float = 1.0, m: float = 1.0, d: float = 0.1, **parts: Any) -> System:
    """The same with friction that heats the environment, on one level."""
    return RUBBED(moving(k, m) | {"mf": lib.friction(d=d), "env": lib.environment()} | parts)


def damped_oscillator(k: float = 1.5, m: float = 2.0, d: float = 0.1) -> System:
    """A mass on a spring, whose friction heats the environment."""
    return DAMPED(osc=oscillator(k, m), mf=lib.friction(d=d), env=lib.environment())
