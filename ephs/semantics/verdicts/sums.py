"""Sums of products of powers of numbered atoms, with rational coefficients."""

from fractions import Fraction
from typing import TypeAlias

Number: TypeAlias = "int | Fraction"
Monomial: TypeAlias = "tuple[tuple[int, Number], ...]"
Expanded: TypeAlias = "dict[Monomial, Fraction]"
"""Products of powers of atoms -> coefficients, none of them 0."""
DIGITS = 20_000
"""Binary digits of a power of a number, at most."""


class Unexpandable(ArithmeticError):
    """A formula that has no expansion: a quotient by 0, an unknown operation, or too many products."""


def whole(power: Number) -> Number:
    """The power as an int where it is one, which is faster."""
    return power.numerator if power.denominator == 1 else power


def number_of(value: Fraction | int) -> Expanded:
    """A number, expanded."""
    return {(): Fraction(value)} if value else {}


def number_power(number: Fraction, exponent: int) -> Fraction:
    """A power of a number.

    Raises
    ------
    Unexpandable
        It has too many digits.
    """
    if (number.numerator.bit_length() + number.denominator.bit_length()) * abs(exponent) > DIGITS:
        raise Unexpandable(f"a power of more than {DIGITS} digits")
    return number**exponent


def scaled(of: Expanded, factor: Fraction | int) -> Expanded:
    """A multiple."""
    return {monomial: factor * number for monomial, number in of.items()} if factor else {}


def frozen(of: Expanded) -> tuple[tuple[Monomial, Fraction], ...]:
    """The same as a key."""
    return tuple(sorted(of.items()))
