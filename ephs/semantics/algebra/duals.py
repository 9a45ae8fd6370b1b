"""Dual numbers: a value with its slope along one direction, for exact derivatives of rational functions."""

from dataclasses import dataclass
from typing import Any, final


@final
@dataclass(frozen=True, slots=True)
class Dual:
    """value + slope · ε with ε² = 0."""

    value: Any
    slope: Any = 0

    @staticmethod
    def constant(number: Any) -> "Dual":
        """A number, as a constant where it is none already."""
        return number if isinstance(number, Dual) else Dual(number)

    def __add__(self, other: Any) -> "Dual":
        right = Dual.constant(other)
        return Dual(self.value + right.value, self.slope + right.slope)

    def __mul__(self, other: Any) -> "Dual":
        right = Dual.constant(other)
        return Dual(self.value * right.value, self.value * right.slope + self.slope * right.value)

    def __truediv__(self, other: Any) -> "Dual":
        right = Dual.constant(other)
        quotient = self.value / right.value
        return Dual(quotient, (self.slope - quotient * right.slope) / right.value)

    def __neg__(self) -> "Dual":
        return Dual(-self.value, -self.slope)

    def __sub__(self, other: Any) -> "Dual":
        return self + -Dual.constant(other)

    def __rsub__(self, other: Any) -> "Dual":
        return Dual.constant(other) - self

    def __rtruediv__(self, other: Any) -> "Dual":
        return Dual.constant(other) / self

    __radd__ = __add__
    __rmul__ = __mul__

    def __pow__(self, power: int) -> "Dual":
        return Dual(self.value**power, power * self.value ** (power - 1) * self.slope)
