"""Efforts that are prescribed as functions of time, with their integrals and derivatives: motion laws."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import OptionError

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

    from ephs.solve.posing.problem import State


class MotionLaw(ABC):
    """A motion law, one coordinate as a function of time: smooth, with a continuous acceleration.

    A joint with a prescribed motion has the rate of the law at its port; its coordinate departs from where it is
    placed at the start as the law says: q(t) − q(t₀) = s(t) − s(t₀).
    """

    __slots__ = ()

    @abstractmethod
    def displacement(self, t: float) -> float:
        """Return s(t) in rad or m, t in s."""

    @abstractmethod
    def rate(self, t: float) -> float:
        """Return ds/dt in rad/s or m/s."""

    @abstractmethod
    def acceleration(self, t: float) -> float:
        """Return d²s/dt² in rad/s² or m/s²."""

    @property
    @abstractmethod
    def numbers(self) -> tuple[tuple[str, float], ...]:
        """Single numbers by name, in the order of its parameters."""

    @abstractmethod
    def rescaled(self, length: float, time: float) -> "MotionLaw":
        """Return the same law in other units, in which displacements and times are so many times larger."""

    @property
    def constant(self) -> bool:
        """Whether the rate never changes."""
        return False

    def __call__(self, t: float, state: "State | None" = None) -> Array:
        """Return the rate (1,) at t s: the value of a signal."""
        return np.array([self.rate(t)])


@final
@dataclass(frozen=True, slots=True)
class PolynomialMotion(MotionLaw):
    """s(t) = c₁ t + c₂ t² + ….

    Parameters
    ----------
    coefficients
        c₁, c₂, … in rad/s, rad/s², … or m/s, m/s², ….

    Raises
    ------
    OptionError
        There is none, or one is not finite.
    """

    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        _finite("polynomial", self.coefficients, least=1)

    def displacement(self, t: float) -> float:
        return t * _horner(self.coefficients, t)

    def rate(self, t: float) -> float:
        return _horner([k * c for k, c in enumerate(self.coefficients, 1)], t)

    def acceleration(self, t: float) -> float:
        return _horner([k * (k + 1) * c for k, c in enumerate(self.coefficients[1:], 1)], t)

    @property
    def constant(self) -> bool:
        return not any(self.coefficients[1:])

    @property
    def numbers(self) -> tuple[tuple[str, float], ...]:
        return (("rate", self.coefficients[0]),) if len(self.coefficients) == 1 else ()

    def rescaled(self, length: float, time: float) -> "PolynomialMotion":
        return PolynomialMotion(tuple(float(c * length / time**k) for k, c in enumerate(self.coefficients, 1)))


@final
@dataclass(frozen=True, slots=True)
class HarmonicMotion(MotionLaw):
    """s(t) = A sin(2π f t + φ).

    Parameters
    ----------
    amplitude
        A in rad or m.
    frequency
        f in Hz.
    phase
        φ in rad.

    Raises
    ------
    OptionError
        One is not finite.
    """

    amplitude: float
    frequency: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        _finite("harmonic", (self.amplitude, self.frequency, self.phase))

    @property
    def _speed(self) -> float:
        return 2.0 * np.pi * self.frequency

    def displacement(self, t: float) -> float:
        return self.amplitude * float(np.sin(self._speed * t + self.phase))

    def rate(self, t: float) -> float:
        return self.amplitude * self._speed * float(np.cos(self._speed * t + self.phase))

    def acceleration(self, t: float) -> float:
        return -self.amplitude * self._speed**2 * float(np.sin(self._speed * t + self.phase))

    @property
    def constant(self) -> bool:
        return self.amplitude == 0.0 or self.frequency == 0.0

    @property
    def numbers(self) -> tuple[tuple[str, float], ...]:
        return ("amplitude", self.amplitude), ("frequency", self.frequency), ("phase", self.phase)

    def rescaled(self, length: float, time: float) -> "HarmonicMotion":
        return HarmonicMotion(self.amplitude * length, self.frequency / time, self.phase)


@final
@dataclass(frozen=True, slots=True)
class TabulatedMotion(MotionLaw):
    """A spline of fifth order through points, at rest before the first and after the last one.

    Rate and acceleration are zero at both ends, and continuous everywhere.

    Parameters
    ----------
    times
        (n,) ascending, in s, n ≥ 2.
    displacements
        (n,) in rad or m; only their differences matter.

    Raises
    ------
    OptionError
        Times are not ascending, there are fewer than two points, or one is not finite.
    """

    times: tuple[float, ...]
    displacements: tuple[float, ...]

    def __post_init__(self) -> None:
        _finite("times", self.times, least=2)
        _finite("displacements", self.displacements)
        if np.any(np.diff(self.times) <= 0.0):
            raise OptionError("times", list(self.times), "ascending times in s")
        if len(self.displacements) != len(self.times):
            raise OptionError("displacements", list(self.displacements), f"{len(self.times)} numbers, one a time")

    def displacement(self, t: float) -> float:
        return float(_splines(self.times, self.displacements)[0](min(max(t, self.times[0]), self.times[-1])))

    def rate(self, t: float) -> float:
        return self._derivative(1, t)

    def acceleration(self, t: float) -> float:
        return self._derivative(2, t)

    def _derivative(self, order: int, t: float) -> float:
        within = self.times[0] < t < self.times[-1]
        return float(_splines(self.times, self.displacements)[order](t)) if within else 0.0

    @property
    def numbers(self) -> tuple[tuple[str, float], ...]:
        return ()

    def rescaled(self, length: float, time: float) -> "TabulatedMotion":
        return TabulatedMotion(tuple(t * time for t in self.times), tuple(s * length for s in self.displacements))


@lru_cache(maxsize=64)
def _splines(times: tuple[float, ...], values: tuple[float, ...]) -> "tuple[BSpline, BSpline, BSpline]":
    """The spline of a table, and its first two derivatives."""
    from scipy.interpolate import make_interp_spline

    rest: Any = ([(1, 0.0), (2, 0.0)],) * 2
    spline = make_interp_spline(times, values, k=5, bc_type=rest)
    return spline, spline.derivative(), spline.derivative(2)


def _horner(coefficients: Any, t: float) -> float:
    total = 0.0
    for c in reversed(coefficients):
        total = total * t + c
    return float(total)


def _finite(key: str, found: tuple[float, ...], least: int = 0) -> None:
    if len(found) < least or not np.isfinite(found).all():
        raise OptionError(key, list(found), f"{f'{least} or more ' if least else ''}finite numbers")
