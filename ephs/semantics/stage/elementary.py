"""Sine, cosine, exponential, logarithm and arctangent in arithmetic alone: the same bits on every machine.

They use sums, products, quotients, comparisons and choices, each rounded as IEEE 754 says, without branches; so they
serve floats, arrays, machine code and vectors alike. Polynomials interpolate at Chebyshev points, in 60 digits, and are
rounded: `tests/semantics/stage/coefficients.py` makes them anew. Sine and cosine are not functions of their own in
machine code, since those of one angle share all their arithmetic. Measured errors are below 0.8 units in the last place
(sine, cosine, exponential), 0.9 (logarithm) and 1.5 (arctangent).
"""

import math
from collections.abc import Callable, Sequence
from typing import Final

from ephs.semantics.stage.evaluator import Evaluator, Function, staged
from ephs.semantics.stage.numbers import Real

LINEAR = 1e-9
"""Angle in rad below which its sine is the angle: the cube is below rounding."""

LARGEST_ANGLE: Final = 2.0**26
"""Angles in rad up to which errors of sine and cosine are relative; beyond they are absolute, below 1e-15."""
WHOLE_TURNS: Final = 2.0**55
"""Angles in rad beyond which neighbouring floats differ by more than a turn: these count as whole turns."""

QUARTERS: Final = (
    float.fromhex("0x1.921fb5p+0"),
    float.fromhex("0x1.110b46p-26"),
    float.fromhex("0x1.1a6263p-54"),
    float.fromhex("0x1.8a2e03707344ap-81"),
)
"""π/2 in four parts; the first three have at most 25 bits, so that products with whole numbers below 2²⁸ are exact."""
LN2: Final = (float.fromhex("0x1.62e42feep-1"), float.fromhex("0x1.a39ef35793c76p-33"))
"""ln 2 in two parts; the first has 32 bits, so that products with exponents are exact."""
PI: Final = (float.fromhex("0x1.921fb54442d18p+1"), float.fromhex("0x1.1a62633145c07p-53"))
"""π in two parts."""
ARCTANGENTS: Final = (
    (float.fromhex("0x1.dac670561bb4fp-2"), float.fromhex("0x1.a2b7f222f65e2p-56")),
    (float.fromhex("0x1.921fb54442d18p-1"), float.fromhex("0x1.1a62633145c07p-55")),
)
"""atan ½ and atan 1 in two parts each."""
SINE: Final[tuple[float, ...]] = (
    float.fromhex("-0x1.5555555555555p-3"),
    float.fromhex("0x1.1111111111110p-7"),
    float.fromhex("-0x1.a01a01a019938p-13"),
    float.fromhex("0x1.71de3a546095bp-19"),
    float.fromhex("-0x1.ae645412c560cp-26"),
    float.fromhex("0x1.61217f0b800d5p-33"),
    float.fromhex("-0x1.ab17d404de5b3p-41"),
)
COSINE: Final[tuple[float, ...]] = (
    float.fromhex("0x1.5555555555555p-5"),
    float.fromhex("-0x1.6c16c16c16c16p-10"),
    float.fromhex("0x1.a01a01a019d0ap-16"),
    float.fromhex("-0x1.27e4fb7712d65p-22"),
    float.fromhex("0x1.1eed8deb97a97p-29"),
    float.fromhex("-0x1.9394ba0cd6ed5p-37"),
    float.fromhex("0x1.ab785b00b45f0p-45"),
)
EXPONENTIAL: Final[tuple[float, ...]] = (
    float.fromhex("0x1.0000000000000p-1"),
    float.fromhex("0x1.5555555555555p-3"),
    float.fromhex("0x1.5555555555557p-5"),
    float.fromhex("0x1.1111111111111p-7"),
    float.fromhex("0x1.6c16c16c15a6cp-10"),
    float.fromhex("0x1.a01a01a0196aep-13"),
    float.fromhex("0x1.a01a01a9e80fep-16"),
    float.fromhex("0x1.71de3a5aa6edbp-19"),
    float.fromhex("0x1.27e4d41d6f553p-22"),
    float.fromhex("0x1.ae642c8730352p-26"),
    float.fromhex("0x1.1f7f2000f4cf3p-29"),
    float.fromhex("0x1.61bfa22dd3437p-33"),
)
LOGARITHM: Final[tuple[float, ...]] = (
    float.fromhex("0x1.5555555555555p-1"),
    float.fromhex("0x1.9999999999a38p-2"),
    float.fromhex("0x1.2492492476cccp-2"),
    float.fromhex("0x1.c71c720159177p-3"),
    float.fromhex("0x1.745cf9048dd95p-3"),
    float.fromhex("0x1.3b1c355a8f7a2p-3"),
    float.fromhex("0x1.0fbe95d716020p-3"),
    float.fromhex("0x1.0c039c49989c6p-3"),
)
ARCTANGENT: Final[tuple[float, ...]] = (
    float.fromhex("-0x1.5555555555555p-2"),
    float.fromhex("0x1.999999999999ap-3"),
    float.fromhex("-0x1.249249249246fp-3"),
    float.fromhex("0x1.c71c71c717d2ap-4"),
    float.fromhex("-0x1.745d17434d76ap-4"),
    float.fromhex("0x1.3b13b06e4b492p-4"),
    float.fromhex("-0x1.1110e862a168ap-4"),
    float.fromhex("0x1.e1d777cd97e4ap-5"),
    float.fromhex("-0x1.ae4bf2908c09fp-5"),
    float.fromhex("0x1.7aa515d7ceb9cp-5"),
    float.fromhex("-0x1.0bb439e234dbep-5"),
)


def polynomial(coefficients: Sequence[float], x: Real) -> Real:
    """Return Σ cₖ xᵏ by Horner's rule."""
    value: Real = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        value = value * x + coefficient
    return value


def _sum(a: Real, b: Real) -> tuple[Real, Real]:
    """Return a + b as a rounded sum and its exact error."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _reduced(on: Evaluator, x: Real) -> tuple[Real, Real, Real]:
    """Return x less the nearest multiple n·π/2 in two parts, and n modulo 4; infinities are not numbers."""
    x = on.select(on.absolute(x) <= WHOLE_TURNS, x, x - x)
    # A multiple of 2²⁷·π/2 first, none below 2²⁶; its last parts may be as large as 2 and are kept exactly.
    many = 2.0**27 * on.floor(x * (2.0**-26 / math.pi) + 0.5)
    near, beside = _sum((x - many * QUARTERS[0]) - many * QUARTERS[1], -(many * QUARTERS[2] + many * QUARTERS[3]))
    n = on.floor(near * (2.0 / math.pi) + 0.5)
    rest = (near - n * QUARTERS[0]) - n * QUARTERS[1]
    first, error = _sum(rest, -(n * QUARTERS[2]))
    second, last = _sum(first, (error - n * QUARTERS[3]) + beside)
    return second, last, n - 4.0 * on.floor(n * 0.25)


def _sine(x: Real, tail: Real) -> Real:
    """Sine of x + tail, |x| ≤ π/4."""
    z = x * x
    return x + (x * (z * polynomial(SINE, z)) + tail * (1.0 - 0.5 * z))


def _cosine(x: Real, tail: Real) -> Real:
    """Cosine of x + tail, |x| ≤ π/4."""
    z = x * x
    half = 0.5 * z
    near = 1.0 - half
    return near + (((1.0 - near) - half) + (z * (z * polynomial(COSINE, z)) - x * tail))


def sin(on: Evaluator, x: Real) -> Real:
    """Sine, x in rad; see `LARGEST_ANGLE`."""
    r, tail, n = _reduced(on, x)
    odd = on.either(on.both(n > 0.5, n < 1.5), n > 2.5)
    value = on.select(odd, _cosine(r, tail), _sine(r, tail))
    value = on.select(n > 1.5, -value, value)
    return on.select(on.absolute(x) < LINEAR, x, value)


def cos(on: Evaluator, x: Real) -> Real:
    """Cosine, x in rad; see `LARGEST_ANGLE`."""
    r, tail, n = _reduced(on, x)
    odd = on.either(on.both(n > 0.5, n < 1.5), n > 2.5)
    value = on.select(odd, _sine(r, tail), _cosine(r, tail))
    return on.select(on.both(n > 0.5, n < 2.5), -value, value)


@staged
def exp(on: Evaluator, x: Real) -> Real:
    """Exponential function; subnormal results are rounded once."""
    x = on.select(x > 720.0, 720.0, on.select(x < -760.0, -760.0, x))
    n = on.floor(x * (1.0 / math.log(2.0)) + 0.5)
    high, low = x - n * LN2[0], n * LN2[1]
    r = high - low
    value = 1.0 + (r + (r * (r * polynomial(EXPONENTIAL, r)) + ((high - r) - low)))
    power = on.integer(n)
    half = power // 2
    return on.scale(on.scale(value, half), power - half)


@staged
def log(on: Evaluator, x: Real) -> Real:
    """Natural logarithm; −∞ at zero, not a number below."""
    m, exponent = x, 0.0
    for bits in (512, 256, 128, 64, 32, 16, 8, 4, 2, 1):
        large = m >= 2.0**bits
        m, exponent = on.select(large, m * 2.0**-bits, m), on.select(large, exponent + float(bits), exponent)
    for bits in (512, 512, 256, 128, 64, 32, 16, 8, 4, 2, 1):
        small = m < 2.0 ** (1 - bits)
        m, exponent = on.select(small, m * 2.0**bits, m), on.select(small, exponent - float(bits), exponent)
    upper = m > math.sqrt(2.0)
    m, exponent = on.select(upper, 0.5 * m, m), on.select(upper, exponent + 1.0, exponent)
    f = m - 1.0
    s = f / (2.0 + f)
    z, half = s * s, 0.5 * f * f
    series = z * polynomial(LOGARITHM, z)
    value = exponent * LN2[0] - ((half - (s * (half + series) + exponent * LN2[1])) - f)
    value = on.select(x < math.inf, value, x)
    return on.select(x > 0.0, value, on.select(x < 0.0, math.nan, x - math.inf))


@staged
def atan2(on: Evaluator, y: Real, x: Real) -> Real:
    """Angle of (x, y) in rad, −π … π; zeros and infinities as in IEEE 754."""
    across, along = on.absolute(x), on.absolute(y)
    steep = along > across
    high, low = on.select(steep, along, across), on.select(steep, across, along)
    far, near = high > _LARGE, high < _SMALL
    high = on.select(far, high * _SMALL, on.select(near, high * _LARGE, high))
    low = on.select(far, low * _SMALL, on.select(near, low * _LARGE, low))
    equal = on.negate(low < high)  # also infinities and zeros
    one, half = low > 0.7 * high, low > 0.236 * high
    above = on.select(one, low - high, on.select(half, low - 0.5 * high, low))
    below = on.select(one, high + low, on.select(half, high + 0.5 * low, high))
    u = on.select(equal, 0.0, above / on.select(below > 0.0, below, 1.0))
    z = u * u
    base = on.select(
        equal, ARCTANGENTS[1][0], on.select(one, ARCTANGENTS[1][0], on.select(half, ARCTANGENTS[0][0], 0.0))
    )
    rest = on.select(
        equal, ARCTANGENTS[1][1], on.select(one, ARCTANGENTS[1][1], on.select(half, ARCTANGENTS[0][1], 0.0))
    )
    tail = u * (z * polynomial(ARCTANGENT, z)) + rest
    zero = on.negate(high > 0.0)
    base, tail, u = on.select(zero, 0.0, base), on.select(zero, 0.0, tail), on.select(zero, 0.0, u)
    angle, error = _sum(base, u)
    tail = tail + error
    angle, tail = _sum(angle, tail)
    quarter, remains = _sum(0.5 * PI[0], -angle)
    angle, tail = on.select(steep, quarter, angle), on.select(steep, remains + (0.5 * PI[1] - tail), tail)
    back = on.copysign(1.0, x) < 0.0
    straight, remains = _sum(PI[0], -angle)
    value = on.select(back, straight + (remains + (PI[1] - tail)), angle + tail)
    numbers = on.both(across <= math.inf, along <= math.inf)
    return on.select(numbers, on.copysign(value, y), x + y)


_LARGE: Final = 2.0**500
_SMALL: Final = 2.0**-500

COMPOSED: Final[dict[Function, Callable[..., Real]]] = {"sin": sin, "cos": cos, "exp": exp, "log": log, "atan2": atan2}
"""Functions composed of arithmetic; the others of the evaluator are exact or correctly rounded by themselves."""
