"""Bounds and signs of a term from those of its symbols: interval arithmetic, rounded outwards; rules of signs."""

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from itertools import product

from ephs.semantics.stage.intervals import extrema
from ephs.semantics.symbols.terms import Term

OUTWARDS = 8e-16
"""Part by which bounds are moved outwards: two of the last digits, and more than functions err by."""
ROUNDING = 1e-15
"""Error of a cosine."""

Interval = tuple[float, float]
Bounds = Mapping[Term, Interval]
WHOLE: Interval = (-math.inf, math.inf)
PIECES = 600
"""Boxes into which a domain is cut, at most."""
OPERATIONS = 20_000
"""Operations on intervals, at most: less than a tenth of a second. Large expressions are bounded over fewer boxes."""
FAR = 1e6
"""Bound beyond which an unbounded side is no longer cut by doubling."""


def at_least(term: Term, bounds: Bounds, *, strict: bool) -> bool:
    """Whether a term is proved ≥ 0, or > 0, on a box; undecided boxes are bisected."""
    symbols = sorted(_symbols(term), key=str)
    boxes: list[tuple[Interval, ...]] = [tuple(bounds[symbol] for symbol in symbols)]
    for _ in range(min(PIECES, 1 + OPERATIONS // (1 + _size_of(term)))):
        if not boxes:
            return True
        box = boxes.pop()
        low, high = _bounds(term, dict(zip(symbols, box, strict=True)))
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


def _symbols(term: Term) -> set[Term]:
    if isinstance(term, str) or (isinstance(term, tuple) and term[0] == "entry"):
        return {term}
    return {symbol for part in term[1:] for symbol in _symbols(part)} if isinstance(term, tuple) else set()


def _size_of(term: Term) -> int:
    return 1 + sum(map(_size_of, term[1:])) if isinstance(term, tuple) else 0


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


def _bounds(term: Term, box: Bounds) -> Interval:
    if isinstance(term, str) or (isinstance(term, tuple) and term[0] == "entry"):
        return box[term]
    if not isinstance(term, tuple):
        try:
            value = float(term)
        except OverflowError:  # a whole number beyond all floats
            return (sys.float_info.max, math.inf) if term > 0 else (-math.inf, -sys.float_info.max)
        return (value, value) if value == term else _out(value, value)
    word, *arguments = term
    parts = [_bounds(part, box) for part in arguments]
    match word, parts:
        case "+", _:
            return reduce(lambda one, two: _out(one[0] + two[0], one[1] + two[1]), parts)
        case "-", [one]:
            return -one[1], -one[0]
        case "-", [one, two]:
            return _out(one[0] - two[1], one[1] - two[0])
        case "*", _ if len(parts) == 2 and arguments[0] == arguments[1]:
            return _power(parts[0], (2.0, 2.0))
        case "*", _:
            return reduce(_times, parts)
        case "/", [one, two]:
            return _times(one, _reciprocal(two))
        case "^", [base, exponent]:
            return _power(base, exponent)
        case _:
            rule = _RULES.get(word)
            return rule(*parts[0]) if rule is not None else WHOLE


def _times(one: Interval, two: Interval) -> Interval:
    products = [0.0 if a == 0.0 or b == 0.0 else a * b for a in one for b in two]
    return _out(min(products), max(products))


def _power(base: Interval, exponents: Interval) -> Interval:
    low, high = base
    n = exponents[0]
    if exponents[0] == exponents[1] and n.is_integer():
        if n < 0.0:
            return _reciprocal(_power(base, (-n, -n)))
        ends = [_pow(low, n), _pow(high, n)]
        if n % 2.0 == 0.0:
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
        values = [math.cos(low - peak), math.cos(high - peak)]
        bottom, top = extrema(low - peak, high - peak)
        least, most = -1.0 if bottom else min(values) - ROUNDING, 1.0 if top else max(values) + ROUNDING
        return max(least, -1.0), min(most, 1.0)

    return rule


def _hyperbolic(low: float, high: float) -> Interval:
    a, b = _size(low, high)
    return _out(max(_value(math.cosh, a, math.inf), 1.0), _value(math.cosh, b, math.inf))


def _sign(low: float, high: float) -> Interval:
    return (-1.0 if low < 0.0 else 0.0 if low == 0.0 else 1.0), (1.0 if high > 0.0 else 0.0 if high == 0.0 else -1.0)


def _root(low: float, high: float) -> Interval:
    return _power((max(low, 0.0), max(high, 0.0)), (0.5, 0.5))


_RULES: Mapping[str, Callable[..., Interval]] = {
    "exp": _rising(math.exp, least=0.0),
    "log": _rising(lambda x: math.log(x) if x > 0.0 else -math.inf),
    "tanh": _rising(math.tanh, -1.0, 1.0),
    "sinh": _rising(math.sinh),
    "atan": _rising(math.atan, -1.6, 1.6),
    "asinh": _rising(math.asinh),
    "sqrt": _root,
    "sign": _sign,
    "abs": _size,
    "cosh": _hyperbolic,
    "cos": _wave(0.0),
    "sin": _wave(0.5 * math.pi),
}
ANY = frozenset({-1, 0, 1})
EVEN, RISING = ("cosh", "exp", "sinhc"), ("sinh", "tanh", "atan", "asinh", "asin", "atanh", "sign")
"""Functions that are positive, and those with the sign of their argument."""


def signs(term: Term, bounds: Bounds) -> frozenset[int]:
    """Signs that a term can have where it is defined, by those of its parts; ``("shown", …)`` by its bounds.

    A number that is known to be ≥ 0 counts as positive: a condition that holds there holds at 0, too, by continuity.
    """
    if not isinstance(term, tuple) or term[0] == "entry":
        low, high = bounds[term] if isinstance(term, str | tuple) else (term, term)
        if low == high == 0.0:
            return frozenset({0})
        return frozenset({1 if low >= 0.0 else -1}) if low >= 0.0 or high <= 0.0 else ANY
    word, *arguments = term
    if word == "shown":
        if at_least(arguments[0], bounds, strict=True):
            return frozenset({1})
        return frozenset({0, 1}) if at_least(arguments[0], bounds, strict=False) else ANY
    parts = [signs(each, bounds) for each in arguments]
    match word, parts:
        case "+", _:
            return _of_sum(parts)
        case "-", [one]:
            return _opposite(one)
        case "-", [one, two]:
            return _of_sum([one, _opposite(two)])
        case (("*" | "/"), _):
            return _of_product(arguments, parts)
        case "^", [base, _] if isinstance(arguments[1], int | float):
            exponent = float(arguments[1])
            if exponent.is_integer():
                return base if exponent % 2.0 else _square(base)
            return _square(base)  # defined where the base is not negative
        case (("abs" | "sqrt"), [one]):
            return _square(one)
        case _:
            return frozenset({1}) if word in EVEN else parts[0] if word in RISING else ANY


def _opposite(part: frozenset[int]) -> frozenset[int]:
    return frozenset(-sign for sign in part)


def _square(part: frozenset[int]) -> frozenset[int]:
    return frozenset(sign * sign for sign in part)


def _of_sum(parts: Sequence[frozenset[int]]) -> frozenset[int]:
    sides = frozenset[int]().union(*parts)
    if {-1, 1} <= sides:
        return ANY
    return sides - {0} if any(0 not in part for part in parts) else sides


def _of_product(factors: Sequence[Term], parts: Sequence[frozenset[int]]) -> frozenset[int]:
    """Factors that occur twice are squares."""
    single: dict[Term, frozenset[int]] = {}
    squares: list[frozenset[int]] = []
    for factor, part in zip(factors, parts, strict=True):
        if factor in single:
            squares.append(_square(single.pop(factor)))
        else:
            single[factor] = part
    out = frozenset({1})
    for part in (*single.values(), *squares):
        out = frozenset(a * b for a, b in product(out, part))
    return out
