"""Bounds of an expression over intervals of its symbols: interval arithmetic, rounded outwards."""

import math
from collections.abc import Callable, Mapping

from ephs.semantics.symbols.algebra import Expr, sp

OUTWARDS = 8e-16
"""Part by which bounds are moved outwards: two of the last digits, and more than functions err by."""
NEAR = 1e-9
"""Angle in rad by which extrema are taken to lie within an interval: more than turns round by."""
ROUNDING = 1e-15
"""Error of a cosine."""

Interval = tuple[float, float]
Bounds = Mapping[Expr, Interval]
WHOLE: Interval = (-math.inf, math.inf)
PIECES = 600
"""Boxes into which a domain is cut, at most."""
OPERATIONS = 20_000
"""Operations on intervals, at most: less than a tenth of a second. Large expressions are bounded over fewer boxes."""
FAR = 1e6
"""Bound beyond which an unbounded side is no longer cut by doubling."""


def at_least(expression: Expr, bounds: Bounds, *, strict: bool) -> bool:
    """Whether an expression is proved ≥ 0, or > 0, on a box; undecided boxes are bisected.

    Symbols without bounds run over all numbers.
    """
    symbols = sorted(expression.free_symbols, key=str)
    boxes: list[tuple[Interval, ...]] = [tuple(bounds.get(symbol, WHOLE) for symbol in symbols)]
    for _ in range(min(PIECES, 1 + OPERATIONS // (1 + int(expression.count_ops())))):
        if not boxes:
            return True
        box = boxes.pop()
        low, high = _bounds(expression, dict(zip(symbols, box, strict=True)))
        if low > 0.0 or (low == 0.0 and not strict):
            continue
        if high < 0.0:
            return False
        widest = max(range(len(box)), key=lambda i: _width(box[i]), default=None)
        if widest is None or _width(box[widest]) == 0.0:
            return False
        low, high = box[widest]
        middle = _middle(low, high)
        boxes += [(*box[:widest], half, *box[widest + 1 :]) for half in ((low, middle), (middle, high))]
    return not boxes


def _width(interval: Interval) -> float:
    low, high = interval
    if abs(low) >= FAR and abs(high) >= FAR and low * high > 0.0:
        return 0.0
    return math.atan(high) - math.atan(low)


def _middle(low: float, high: float) -> float:
    if low < 0.0 < high:
        return 0.0
    if high == math.inf:
        return max(2.0 * low, 1.0)
    if low == -math.inf:
        return min(2.0 * high, -1.0)
    return 0.5 * (low + high)


def _out(low: float, high: float) -> Interval:
    """Outwards, by what the operation rounded; elementary functions are good to a few roundings."""
    if math.isnan(low) or math.isnan(high):
        return WHOLE
    return _moved(low, -1.0), _moved(high, 1.0)


def _moved(value: float, side: float) -> float:
    return value + side * OUTWARDS * abs(value) if math.isfinite(value) else value


def _bounds(expression: Expr, box: Bounds) -> Interval:
    if expression.is_Symbol:
        return box[expression]
    if expression.is_number:
        value = float(expression)
        return (value, value) if expression.is_Integer and abs(value) < 2**53 else _out(value, value)
    parts = [_bounds(part, box) for part in expression.args]
    if expression.is_Add:
        low, high = parts[0]
        for a, b in parts[1:]:
            low, high = _out(low + a, high + b)
        return low, high
    if expression.is_Mul:
        found = parts[0]
        for part in parts[1:]:
            found = _times(found, part)
        return found
    if expression.is_Pow:
        return _power(parts[0], expression.args[1], parts[1])
    rule = _RULES.get(expression.func)
    return rule(*parts[0]) if rule is not None and len(parts) == 1 else WHOLE


def _times(one: Interval, two: Interval) -> Interval:
    products = [0.0 if a == 0.0 or b == 0.0 else a * b for a in one for b in two]
    return _out(min(products), max(products))


def _power(base: Interval, exponent: Expr, exponents: Interval) -> Interval:
    low, high = base
    if exponent.is_Integer:
        n = int(exponent)
        if n < 0:
            return _reciprocal(_power(base, -exponent, exponents))
        ends = [_pow(low, float(n)), _pow(high, float(n))]
        if n % 2 == 0:
            return _out(0.0 if low <= 0.0 <= high else min(ends), max(ends))
        return _out(*ends)
    if low >= 0.0:  # monotone in base and exponent each
        ends = [_pow(a, b) for a in base for b in exponents]
        return (0.0, math.inf) if any(map(math.isnan, ends)) else _out(min(ends), max(ends))
    return WHOLE


def _pow(a: float, b: float) -> float:
    try:
        return float(a**b)
    except OverflowError:
        return math.inf if a > 0.0 or b % 2 == 0.0 else -math.inf
    except ZeroDivisionError:
        return math.inf


def _reciprocal(interval: Interval) -> Interval:
    low, high = interval
    if low < 0.0 < high or low == high == 0.0:
        return WHOLE
    return _out(1.0 / high if high else -math.inf, 1.0 / low if low else math.inf)


def _rising(of: Callable[[float], float], least: float = -math.inf, most: float = math.inf) -> Callable[..., Interval]:
    """The rule of a function that never falls, with values between two numbers."""

    def rule(low: float, high: float) -> Interval:
        a, b = _out(_value(of, low, least), _value(of, high, most))
        return max(a, least), min(b, most)

    return rule


def _value(of: Callable[[float], float], x: float, otherwise: float) -> float:
    """The value, or the unconditional bound where there is none."""
    try:
        return of(x)
    except (OverflowError, ValueError):
        return otherwise


def _size(low: float, high: float) -> Interval:
    return (0.0 if low <= 0.0 <= high else min(abs(low), abs(high))), max(abs(low), abs(high))


def _wave(peak: float) -> Callable[[float, float], Interval]:
    """Bounds of cos, shifted so that its maxima are at ``peak`` + 2πk."""

    def rule(low: float, high: float) -> Interval:
        if not (math.isfinite(low) and math.isfinite(high)) or max(abs(low), abs(high)) > 1e6:
            return -1.0, 1.0
        turn = 2.0 * math.pi
        values = [math.cos(low - peak), math.cos(high - peak)]
        near = NEAR
        top = math.floor((high - peak + near) / turn) >= math.ceil((low - peak - near) / turn)
        bottom = math.floor((high - peak + math.pi + near) / turn) >= math.ceil((low - peak + math.pi - near) / turn)
        least, most = -1.0 if bottom else min(values) - ROUNDING, 1.0 if top else max(values) + ROUNDING
        return max(least, -1.0), min(most, 1.0)

    return rule


def _hyperbolic(low: float, high: float) -> Interval:
    a, b = _size(low, high)
    return _out(max(_value(math.cosh, a, math.inf), 1.0), _value(math.cosh, b, math.inf))


def _sign(low: float, high: float) -> Interval:
    return (-1.0 if low < 0.0 else 0.0 if low == 0.0 else 1.0), (1.0 if high > 0.0 else 0.0 if high == 0.0 else -1.0)


_RULES: dict[Expr, Callable[..., Interval]] = {
    sp.exp: _rising(math.exp, least=0.0),
    sp.log: _rising(lambda x: math.log(x) if x > 0.0 else -math.inf),
    sp.tanh: _rising(math.tanh, -1.0, 1.0),
    sp.sinh: _rising(math.sinh),
    sp.atan: _rising(math.atan, -1.6, 1.6),
    sp.asinh: _rising(math.asinh),
    sp.sign: _sign,
    sp.Abs: _size,
    sp.cosh: _hyperbolic,
    sp.cos: _wave(0.0),
    sp.sin: _wave(0.5 * math.pi),
}
