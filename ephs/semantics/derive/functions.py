"""Elementary functions beyond those of every evaluator, and the slope of each between two arguments.

A rule gives f(x), and (f(b) − f(a))/(b − a), which is f'(a) where b = a, without a difference in which digits cancel:
by addition theorems, and by series where quotients of small numbers would appear. Series end where the next term is
below rounding. What has no rule of its own is composed of what has.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, final

from ephs.semantics.stage.elementary import polynomial
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.numbers import Real

NEAR: Final = 0.5
"""Up to this size of the argument series serve."""
STEEP: Final = 1e75
"""Slope of roots at zero in place of ∞: a finite one times the zero beside it, as in x·√|x|, is zero."""
Value = Callable[[Evaluator, Real], Real]


@final
@dataclass(frozen=True, slots=True)
class SlopeRule:
    """A function of one number and its slope between two."""

    value: Value
    slope: Callable[[Evaluator, Real, Real], Real]


def _even(terms: int, divisor: Callable[[int], float], sign: float) -> tuple[float, ...]:
    return tuple(sign**k / divisor(k) for k in range(terms))


_SINC = _even(9, lambda k: float(math.factorial(2 * k + 1)), -1.0)
_SINHC = _even(9, lambda k: float(math.factorial(2 * k + 1)), 1.0)
_ATANC = _even(28, lambda k: 2.0 * k + 1.0, -1.0)
_ATANHC = _even(28, lambda k: 2.0 * k + 1.0, 1.0)


def _joined(on: Evaluator, x: Real, series: Value, closed: Value, other: float) -> Real:
    """The series where |x| < 1/2, else the closed form; `other` keeps the closed form away from zero."""
    near = on.absolute(x) < NEAR
    return on.select(near, series(on, x), closed(on, on.select(near, other, x)))


def sinc(on: Evaluator, x: Real) -> Real:
    """sin(x)/x."""
    return _joined(on, x, lambda _, x: polynomial(_SINC, x * x), lambda on, x: on.sin(x) / x, 1.0)


def sinhc(on: Evaluator, x: Real) -> Real:
    """sinh(x)/x."""

    def closed(on: Evaluator, x: Real) -> Real:
        large = on.exp(x)
        return 0.5 * (large - 1.0 / large) / x

    return _joined(on, x, lambda _, x: polynomial(_SINHC, x * x), closed, 1.0)


def angle_ratio(on: Evaluator, x: Real) -> Real:
    """atan(x)/x."""
    return _joined(on, x, lambda _, x: polynomial(_ATANC, x * x), lambda on, x: on.atan2(x, 1.0) / x, 1.0)


def sinh(on: Evaluator, x: Real) -> Real:
    """Hyperbolic sine."""
    return x * sinhc(on, x)


def cosh(on: Evaluator, x: Real) -> Real:
    """Hyperbolic cosine; by a square, so that its derivative has all digits near zero, too."""
    half = sinh(on, 0.5 * x)
    return 1.0 + 2.0 * half * half


def tanh(on: Evaluator, x: Real) -> Real:
    """Hyperbolic tangent."""
    fall = -expm1(on, -2.0 * on.absolute(x))
    return on.copysign(1.0, x) * fall / (2.0 - fall)


def expm1(on: Evaluator, x: Real) -> Real:
    """exp(x) − 1."""
    near = on.absolute(x) < NEAR
    half = 0.5 * on.select(near, x, 0.0)
    return on.select(near, x * on.exp(half) * sinhc(on, half), on.exp(x) - 1.0)


def log1p(on: Evaluator, x: Real) -> Real:
    """ln(1 + x) = 2 artanh(x/(2 + x))."""
    near = on.absolute(x) < NEAR
    part = on.select(near, x, 0.0)
    part = part / (2.0 + part)
    return on.select(near, 2.0 * part * polynomial(_ATANHC, part * part), on.log(1.0 + x))


def atan(on: Evaluator, x: Real) -> Real:
    """Angle whose tangent is x."""
    return on.atan2(x, 1.0)


def asinh(on: Evaluator, x: Real) -> Real:
    """Area whose hyperbolic sine is x."""
    size = on.absolute(x)
    square = size * size
    return on.copysign(1.0, x) * log1p(on, size + square / (1.0 + on.sqrt(1.0 + square)))


def _of_logarithm(on: Evaluator, a: Real, b: Real) -> Real:
    """(ln b − ln a)/(b − a) = artanh(z)/z · 2/(a + b) with z = (b − a)/(a + b), where that is small."""
    whole = a + b
    part = (b - a) / whole
    near = on.absolute(part) < NEAR
    far = (on.log(b) - on.log(a)) / on.select(near, 1.0, b - a)
    return on.select(near, 2.0 * polynomial(_ATANHC, on.select(near, part * part, 0.0)) / whole, far)


def _of_angle(on: Evaluator, a: Real, b: Real) -> Real:
    """(atan b − atan a)/(b − a), by the tangent of the difference."""
    below = 1.0 + a * b
    wide = below <= 0.5 * on.absolute(b - a)
    far = (on.atan2(b, 1.0) - on.atan2(a, 1.0)) / on.select(wide, b - a, 1.0)
    below = on.select(wide, 1.0, below)
    return on.select(wide, far, angle_ratio(on, on.select(wide, 0.0, (b - a) / below)) / below)


def _of_tanh(on: Evaluator, a: Real, b: Real) -> Real:
    """sinh(b − a)/((b − a) cosh a cosh b)."""
    return sinhc(on, b - a) / (cosh(on, a) * cosh(on, b))


def _of_asinh(on: Evaluator, a: Real, b: Real) -> Real:
    """By the logarithm of x + √(1 + x²), of −a and −b where they are negative on the whole."""
    sign = on.copysign(1.0, a + b)
    a, b = sign * a, sign * b
    one, other = on.sqrt(1.0 + a * a), on.sqrt(1.0 + b * b)
    return _of_logarithm(on, a + one, b + other) * (1.0 + (a + b) / (one + other))


def atanh(on: Evaluator, x: Real) -> Real:
    """Area whose hyperbolic tangent is x."""
    return 0.5 * (log1p(on, x) - log1p(on, -x))


def _of_atanh(on: Evaluator, a: Real, b: Real) -> Real:
    return 0.5 * (_of_logarithm(on, 1.0 + a, 1.0 + b) + _of_logarithm(on, 1.0 - a, 1.0 - b))


def _of_absolute(on: Evaluator, a: Real, b: Real) -> Real:
    """(a + b)/(|a| + |b|); 0 at the kink."""
    below = on.absolute(a) + on.absolute(b)
    kink = below <= 0.0
    return on.select(kink, 0.0, (a + b) / on.select(kink, 1.0, below))


def _from_zero(on: Evaluator, x: Real, root: Callable[[Real], Real]) -> Real:
    """A root of x, which is vertical at 0."""
    zero = on.absolute(x) <= 0.0
    return on.select(zero, STEEP * x, root(on.select(zero, 1.0, x)))


def _fourth(on: Evaluator, x: Real) -> Real:
    return on.sqrt(on.sqrt(x))


def _of_roots(on: Evaluator, below: Real, above: Real = 1.0) -> Real:
    zero = below <= 0.0
    return on.select(zero, STEEP, above / on.select(zero, 1.0, below))


def _of_three_fourths(on: Evaluator, a: Real, b: Real) -> Real:
    """(v³ − u³)/(v⁴ − u⁴) of the fourth roots u, v."""
    u, v = _fourth(on, a), _fourth(on, b)
    squares = u * u + v * v
    return _of_roots(on, squares * (u + v), squares + u * v)


ROOTS: Final[Mapping[int, SlopeRule]] = MappingProxyType(
    {
        1: SlopeRule(
            lambda on, x: _from_zero(on, x, lambda x: _fourth(on, x)),
            lambda on, a, b: _of_roots(on, (on.sqrt(a) + on.sqrt(b)) * (_fourth(on, a) + _fourth(on, b))),
        ),
        2: SlopeRule(lambda on, x: _from_zero(on, x, on.sqrt), lambda on, a, b: _of_roots(on, on.sqrt(a) + on.sqrt(b))),
        3: SlopeRule(lambda on, x: _from_zero(on, x, lambda x: on.sqrt(x) * _fourth(on, x)), _of_three_fourths),
    }
)
"""Powers of 1/4, 1/2 and 3/4, by quarters: factors of powers above 1/2. The others have no derivative at 0, where the
root of a square, a length, has no direction."""


def real_power(p: Real) -> SlopeRule:
    """xᵖ; at 0 as `ROOTS` for p > 1/2."""

    def value(on: Evaluator, x: Real) -> Real:
        zero = on.both(on.absolute(x) <= 0.0, p > 0.5)
        return on.select(zero, on.select(p > 1.0, 0.0, STEEP) * x, on.exp(p * on.log(on.select(zero, 1.0, x))))

    def slope(on: Evaluator, a: Real, b: Real) -> Real:
        """√(aᵖ bᵖ) 2 sinh(p l/2)/(b − a) with l = ln b − ln a, where a and b are of one size."""
        zero, near = on.absolute(a + b) <= 0.0, on.absolute(b - a) < NEAR * (a + b)
        one, two = on.select(near, a, 1.0), on.select(near, b, 1.0)
        log = _of_logarithm(on, one, two)
        close = p * log * on.exp(0.5 * p * (on.log(one) + on.log(two))) * sinhc(on, 0.5 * p * log * (two - one))
        far = (value(on, b) - value(on, a)) / on.select(zero, 1.0, on.select(near, 1.0, b - a))
        steep = on.select(p > 0.5, STEEP, math.inf)
        return on.select(zero, on.select(p > 1.0, 0.0, steep), on.select(near, close, far))

    return SlopeRule(value, slope)


def _half_turn_series() -> tuple[float, ...]:
    """Coefficients z₁, z₂, … of 1 − φ cot φ = Σ z_k φ²ᵏ, by its differential equation φ w′ = w² − w + φ²."""
    found = [1.0 / 3.0]
    for k in range(2, TURN_TERMS + 2):
        found.append(sum(found[i] * found[k - 2 - i] for i in range(k - 1)) / (2.0 * k + 1.0))
    return tuple(found)


TURN_TERMS: Final = 28
"""Terms of series in θ² that serve up to half a turn, where each is a quarter of the one before."""
_COTANGENT = _half_turn_series()
_TURN_RATIO = (1.0, *((1.0 - 0.5 ** (2 * k + 1)) * z / 4.0 ** (k + 1) for k, z in enumerate(_COTANGENT[:TURN_TERMS])))
_TURN_CURVE = tuple(z / 4.0 ** (k + 1) for k, z in enumerate(_COTANGENT))
_TURN_CURVE_SLOPE = tuple(k * c for k, c in enumerate(_TURN_CURVE) if k)


def series(coefficients: Sequence[float]) -> SlopeRule:
    """Polynomial c₀ + c₁ x + …, and its slope Σ c_k (b^k − a^k)/(b − a) by the same scheme."""

    def slope(_: Evaluator, a: Real, b: Real) -> Real:
        value: Real = coefficients[-1]
        found: Real = 0.0
        for coefficient in coefficients[-2::-1]:
            found = found * b + value
            value = value * a + coefficient
        return found

    return SlopeRule(lambda _, x: polynomial(coefficients, x), slope)


FUNCTIONS: Final[Mapping[str, SlopeRule]] = MappingProxyType(
    {
        "sqrt": SlopeRule(lambda on, x: on.sqrt(x), lambda on, a, b: 1.0 / (on.sqrt(a) + on.sqrt(b))),
        "absolute": SlopeRule(lambda on, x: on.absolute(x), _of_absolute),
        "sin": SlopeRule(lambda on, x: on.sin(x), lambda on, a, b: on.cos(0.5 * (a + b)) * sinc(on, 0.5 * (b - a))),
        "cos": SlopeRule(lambda on, x: on.cos(x), lambda on, a, b: -(on.sin(0.5 * (a + b)) * sinc(on, 0.5 * (b - a)))),
        "exp": SlopeRule(lambda on, x: on.exp(x), lambda on, a, b: on.exp(0.5 * (a + b)) * sinhc(on, 0.5 * (b - a))),
        "log": SlopeRule(lambda on, x: on.log(x), _of_logarithm),
        "sinh": SlopeRule(sinh, lambda on, a, b: cosh(on, 0.5 * (a + b)) * sinhc(on, 0.5 * (b - a))),
        "cosh": SlopeRule(cosh, lambda on, a, b: sinh(on, 0.5 * (a + b)) * sinhc(on, 0.5 * (b - a))),
        "tanh": SlopeRule(tanh, _of_tanh),
        "expm1": SlopeRule(expm1, lambda on, a, b: on.exp(0.5 * (a + b)) * sinhc(on, 0.5 * (b - a))),
        "log1p": SlopeRule(log1p, lambda on, a, b: _of_logarithm(on, 1.0 + a, 1.0 + b)),
        "atan": SlopeRule(atan, _of_angle),
        "asinh": SlopeRule(asinh, _of_asinh),
        "atanh": SlopeRule(atanh, _of_atanh),
        "turn_ratio": series(_TURN_RATIO),
        "turn_curve": series(_TURN_CURVE),
        "turn_curve_slope": series(_TURN_CURVE_SLOPE),
    }
)
"""Functions with a rule. Those named after turns are of θ², θ the angle of a rotation up to half a turn:
(θ/2)/sin(θ/2), c = (1 − (θ/2) cot(θ/2))/θ², and the derivative of c by θ²: what logarithms of poses are made of."""


TINY: Final = 1e-300
"""Summand that keeps the derivative of a length finite at zero; negligible elsewhere."""


def turn(on: Evaluator, q: Sequence[Real]) -> Real:
    """The angle 0 ≤ θ ≤ π of the rotation of a unit quaternion."""
    w, x, y, z = q
    return 2.0 * on.atan2(on.sqrt(x * x + y * y + z * z + TINY), on.absolute(w))


def squared_turn_slope(on: Evaluator, a: Real, b: Real) -> Real:
    """(b² − a²)/(cos(b/2) − cos(a/2)) of two angles up to π: −8 (M/sin M)(D/sin D), M = (a + b)/4, D = (b − a)/4."""
    return -8.0 / (sinc(on, 0.25 * (a + b)) * sinc(on, 0.25 * (b - a)))


def tan(on: Evaluator, x: Real) -> Real:
    """Tangent."""
    return on.sin(x) / on.cos(x)


def asin(on: Evaluator, x: Real) -> Real:
    """Angle whose sine is x."""
    return on.atan2(x, on.sqrt((1.0 - x) * (1.0 + x)))


def acos(on: Evaluator, x: Real) -> Real:
    """Angle whose cosine is x."""
    return on.atan2(on.sqrt((1.0 - x) * (1.0 + x)), x)


def acosh(on: Evaluator, x: Real) -> Real:
    """Area whose hyperbolic cosine is x."""
    return on.log(x + on.sqrt((x - 1.0) * (x + 1.0)))


COMPOSED: Final[Mapping[str, Value]] = MappingProxyType(
    {"tan": tan, "asin": asin, "acos": acos, "acosh": acosh, "sinhc": sinhc}
)
"""Functions without one."""
