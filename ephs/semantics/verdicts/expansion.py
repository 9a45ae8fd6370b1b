"""Formulas expanded over ℚ: sums of products of powers of atoms, in which identities are decided.

An atom is a symbol, or a function of an expanded formula: exp of a product, log, sin, |…|, or a power of a sum. Atoms
are independent of each other but for what is built in: powers, e^(a + b) = eᵃ eᵇ, sin² = 1 − cos², |x|² = x², odd and
even functions. So a formula that expands to 0 is 0 wherever it is defined; one that does not may be 0 nevertheless.
"""

from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import reduce
from math import floor
from typing import Any, TypeAlias, final

from ephs.semantics.symbols.terms import OPERATIONS, Term, rational_term
from ephs.semantics.verdicts.sums import (
    Expanded,
    Number,
    Unexpandable,
    frozen,
    number_of,
    number_power,
    scaled,
    whole,
)

HALF = Fraction(1, 2)
MOST = 20_000
"""Products of an expansion, at most: a quarter of a second."""


@final
class Expander:
    """Atoms that formulas have in common, and the rules of their arithmetic."""

    def __init__(self) -> None:
        self._atoms: list[tuple[Any, ...]] = []
        self._numbers: dict[tuple[Any, ...], int] = {}
        self._ruled: set[int] = set()
        self._left = MOST

    # ---- atoms -----------------------------------------------------------------------------------------------------

    def atom(self, word: str, *of: Any, power: Number = 1) -> Expanded:
        """A power of an atom; a ``"symbol"`` has its name and whether it is positive."""
        number = self._numbers.setdefault((word, *of), len(self._atoms))
        if number == len(self._atoms):
            self._atoms.append((word, *of))
            if word in _RULED:
                self._ruled.add(number)
        return {((number, whole(power)),): Fraction(1)} if power else number_of(1)

    def _positive(self, atom: int, power: Number) -> bool:
        word, *of = self._atoms[atom]
        known = word in ("exp", "number", "absolute", "sinhc") or (word == "symbol" and of[1])
        return known or power.denominator > 1  # such a power is only defined where its base is positive

    # ---- arithmetic ------------------------------------------------------------------------------------------------

    def add(self, *terms: Expanded) -> Expanded:
        """The sum."""
        out: Expanded = {}
        for term in terms:
            for monomial, number in term.items():
                out[monomial] = out.get(monomial, 0) + number
        return {monomial: number for monomial, number in out.items() if number}

    def times(self, one: Expanded, other: Expanded) -> Expanded:
        """The product."""
        self._left -= len(one) * len(other)
        if self._left < 0:
            raise Unexpandable(f"more than {MOST} products")
        out: Expanded = {}
        for monomial, a in one.items():
            for more, b in other.items():
                powers = dict(monomial)
                for atom, power in more:
                    powers[atom] = whole(powers.get(atom, 0) + power)
                if self._ruled.isdisjoint(powers):
                    key = tuple(sorted((atom, power) for atom, power in powers.items() if power))
                    out[key] = out.get(key, 0) + a * b
                    continue
                for key, number in self._reduced(powers).items():
                    out[key] = out.get(key, 0) + a * b * number
        return {monomial: number for monomial, number in out.items() if number}

    def _reduced(self, powers: Mapping[int, Number]) -> Expanded:
        """A product by the rules of its atoms: squares of sines and of sizes, whole powers of numbers."""
        kept: dict[int, Number] = {}
        factors: list[Expanded] = []
        for atom, power in powers.items():
            word, *of = self._atoms[atom]
            left = power
            if word == "number" and (power >= 1 or power < 0):
                factors.append(number_of(number_power(of[0], floor(power))))
                left = power - floor(power)
            elif word == "absolute" and power.denominator == 1 and power not in (0, 1):
                factors.append(self.power(dict(of[0]), Fraction(power - power % 2)))
                left = power % 2
            elif word == "sin" and power.denominator == 1 and power >= 2:
                cosine = self.atom("cos", of[0], power=Fraction(2))
                factors.append(self.power(self.add(number_of(1), scaled(cosine, -1)), Fraction(power // 2)))
                left = power % 2
            if left:
                kept[atom] = whole(left)
        out: Expanded = {tuple(sorted(kept.items())): Fraction(1)}
        for factor in factors:
            out = self.times(out, factor)
        return out

    def power(self, base: Expanded, exponent: Fraction) -> Expanded:
        """A rational power."""
        natural = exponent.denominator == 1
        if natural and exponent >= 0 and len(base) != 1:
            out = number_of(1)
            for _ in range(int(exponent)):
                out = self.times(out, base)
            return out
        if not base:
            raise Unexpandable("a quotient by 0")
        if len(base) > 1:
            lead = base[max(base)]
            lead = lead if natural else abs(lead)
            rest = scaled(base, 1 / lead)
            return self.times(self._root(lead, exponent), self.atom("sum", frozen(rest), power=exponent))
        ((monomial, number),) = base.items()
        if natural:
            return scaled(
                self._reduced({atom: power * exponent for atom, power in monomial}),
                number_power(number, int(exponent)),
            )
        out, odd = self._root(abs(number), exponent), Fraction(1 if number > 0 else -1)
        unknown: list[tuple[int, Number]] = []
        for atom, power in monomial:
            if self._positive(atom, power):
                factor = self._reduced({atom: power * exponent})
            elif power % 2 == 0:
                factor = self.power(self.absolute({((atom, 1),): Fraction(1)}), power * exponent)
            else:
                unknown.append((atom, power))
                continue
            out = self.times(out, factor)
        if unknown or odd < 0:
            out = self.times(out, self.atom("sum", frozen({tuple(unknown): odd}), power=exponent))
        return out

    def _root(self, number: Fraction, exponent: Fraction) -> Expanded:
        if number == 1 or exponent.denominator == 1:
            return number_of(number_power(number, int(exponent)) if number != 1 else 1)
        return self._reduced(dict(next(iter(self.atom("number", number, power=exponent)))))

    def quotient(self, one: Expanded, other: Expanded) -> Expanded:
        """A quotient; a product where the one is a product times the other."""
        lead = next(iter(other), ())
        for monomial, number in one.items() if len(other) > 1 else ():
            guess = self.times({monomial: number}, self.power({lead: other[lead]}, Fraction(-1)))
            if len(one) == len(other) and self.times(guess, other) == one:
                return guess
        return self.times(one, self.power(other, Fraction(-1)))

    def absolute(self, of: Expanded) -> Expanded:
        """|…|, factor by factor."""
        if len(of) != 1:
            lead = of[max(of)] if of else Fraction(1)
            return scaled(self.atom("absolute", frozen(scaled(of, 1 / lead))), abs(lead)) if of else {}
        ((monomial, number),) = of.items()
        out = number_of(abs(number))
        for atom, power in monomial:
            if self._positive(atom, power) or power % 2 == 0:
                factor: Expanded = {((atom, power),): Fraction(1)}
            else:
                size = self.atom("absolute", frozen({((atom, 1),): Fraction(1)}))
                factor = self.power(size, Fraction(power))
            out = self.times(out, factor)
        return out

    # ---- functions -------------------------------------------------------------------------------------------------

    def exponential(self, of: Expanded) -> Expanded:
        """The exponential function, term by term."""
        out = number_of(1)
        for monomial, number in of.items():
            word, *inside = self._atoms[monomial[0][0]] if monomial else ("",)
            if word == "log" and monomial[1:] == () and monomial[0][1] == 1:
                factor = self.power(dict(inside[0]), number)
            else:
                factor = self.atom("exp", monomial, power=number)
            out = self.times(out, factor)
        return out

    def logarithm(self, of: Expanded) -> Expanded:
        """The natural logarithm; of a product of positive atoms a sum."""
        if len(of) != 1:
            return self.atom("log", frozen(of))
        ((monomial, number),) = of.items()
        if number < 0 or not all(self._positive(atom, power) for atom, power in monomial):
            return self.atom("log", frozen(of))
        parts = [scaled(self.atom("log", frozen({((atom, 1),): Fraction(1)})), k) for atom, k in monomial]
        return self.add(*parts, {} if number == 1 else self.atom("log", frozen(number_of(number))))

    def function(self, word: str, *of: Expanded) -> Expanded:
        """A function by the word of `terms.OPERATIONS`, or of a tape."""
        least, most, *_ = OPERATIONS.get(word, _ARGUMENTS.get(word, (1, 1)))
        if not least <= len(of) <= most:
            raise Unexpandable(f"{len(of)} arguments of {word}")
        if word in _COMPOSED:
            return _COMPOSED[word](self, *of)
        if word not in _SLOPES and word not in ("choose", "atan2"):
            raise Unexpandable(f"the operation {word}")
        parity = _PARITY.get(word, 0)
        if parity and not of[0]:
            return number_of(1) if parity > 0 else {}
        if parity and of[0][max(of[0])] < 0:
            return scaled(self.atom(word, frozen(scaled(of[0], -1))), parity)
        return self.atom(word, *map(frozen, of))

    def term(self, of: Expanded) -> Term:
        """A term that expands to the same."""
        products = [
            self._product_term(number, [self._factor_term(atom, power) for atom, power in monomial])
            for monomial, number in of.items()
        ]
        return products[0] if len(products) == 1 else ("+", *products) if products else 0.0

    def _product_term(self, number: Fraction, factors: list[Term]) -> Term:
        factors = factors if number == 1 and factors else [rational_term(number), *factors]
        return factors[0] if len(factors) == 1 else ("*", *factors)

    def _factor_term(self, atom: int, power: Number) -> Term:
        word, *of = self._atoms[atom]
        if word == "exp":
            return ("exp", self.term({of[0]: Fraction(power)}))
        base: Term = (
            of[0]
            if word in ("symbol", "number")
            else ("abs" if word == "absolute" else word, *(self.term(dict(each)) for each in of))
        )
        base = base[1] if word == "sum" and isinstance(base, tuple) else base
        return base if power == 1 else ("^", base, float(power))

    # ---- derivatives and zero --------------------------------------------------------------------------------------

    def slope(self, of: Expanded, by: Term) -> Expanded:
        """The derivative by a symbol."""
        known: dict[int, Expanded] = {}
        terms: list[Expanded] = []
        for monomial, number in of.items():
            for atom, power in monomial:
                if atom not in known:
                    known[atom] = self._slope(atom, by)
                if known[atom]:
                    rest = self._reduced({**dict(monomial), atom: power - 1})
                    terms.append(scaled(self.times(rest, known[atom]), number * power))
        return self.add(*terms)

    def _slope(self, atom: int, by: Term) -> Expanded:
        word, *of = self._atoms[atom]
        if word in ("symbol", "number"):
            return number_of(1) if word == "symbol" and of[0] == by else {}
        if word == "exp":
            return self.times(self.atom(word, *of), self.slope({of[0]: Fraction(1)}, by))
        arguments = [dict(each) for each in of]
        slopes = [self.slope(each, by) for each in arguments]
        if not any(slopes):
            return {}
        if word == "choose":
            return self.function(word, arguments[0], *slopes[1:])
        if word == "atan2":
            (y, x), (dy, dx) = arguments, slopes
            square = self.add(self.times(x, x), self.times(y, y))
            return self.quotient(self.add(self.times(x, dy), scaled(self.times(y, dx), -1)), square)
        return self.times(_SLOPES[word](self, arguments[0]), slopes[0])

    def vanishes(self, of: Expanded) -> bool:
        """Whether it is 0: negative powers are multiplied away, then whole powers of sums are expanded."""
        for atom in reversed(range(len(self._atoms))):  # a sum has only earlier ones inside
            least = min((dict(monomial).get(atom, 0) for monomial in of), default=0)
            of = self.times(of, {((atom, -least),): Fraction(1)}) if least < 0 else of
            word, *inside = self._atoms[atom]
            if word != "sum":
                continue
            terms: list[Expanded] = []
            for monomial, number in of.items():
                powers = dict(monomial)
                times = floor(powers.get(atom, 0))
                powers[atom] = whole(powers.get(atom, 0) - times)
                rest = {tuple(sorted((k, v) for k, v in powers.items() if v)): number}
                terms.append(self.times(rest, self.power(dict(inside[0]), Fraction(times))))
            of = self.add(*terms)
        return not of


_RULED = ("number", "absolute", "sin")
"""Atoms whose powers are reduced."""
_PARITY: Mapping[str, int] = {"cos": 1, "sinhc": 1} | dict.fromkeys(("sin", "atan", "asinh", "asin", "atanh"), -1)
"""Functions that are even, with f(0) = 1, or odd."""
_ARGUMENTS: Mapping[str, tuple[int, int]] = {"choose": (3, 3), "squared turn": (4, 4)}
One: TypeAlias = Callable[[Expander, Expanded], Expanded]
Two: TypeAlias = Callable[[Expander, Expanded, Expanded], Expanded]
Many: TypeAlias = Callable[..., Expanded]


def _exponentials(on: Expander, x: Expanded, sign: int) -> Expanded:
    """e^x ± e^(−x)."""
    return on.add(on.exponential(x), scaled(on.exponential(scaled(x, -1)), sign))


def _half_turn(on: Expander, square: Expanded) -> Expanded:
    return scaled(on.power(square, HALF), HALF)


def _turn_ratio(on: Expander, square: Expanded) -> Expanded:
    half = _half_turn(on, square)
    return on.quotient(half, on.function("sin", half))


def _turn_curve(on: Expander, square: Expanded) -> Expanded:
    half = _half_turn(on, square)
    cotangent = on.quotient(on.function("cos", half), on.function("sin", half))
    return on.quotient(on.add(number_of(1), scaled(on.times(half, cotangent), -1)), square)


def _squared_turn(on: Expander, w: Expanded, *vector: Expanded) -> Expanded:
    length = on.power(on.add(*(on.times(x, x) for x in vector)), HALF)
    angle = on.function("atan2", length, on.absolute(w))
    return scaled(on.times(angle, angle), 4)


def _power(on: Expander, a: Expanded, b: Expanded) -> Expanded:
    exponent = b.get((), Fraction(0)) if not b.keys() - {()} else None
    if exponent is not None and (4 * exponent).denominator == 1:
        return on.power(a, exponent)
    return on.exponential(on.times(b, on.logarithm(a)))


def _minus(on: Expander, a: Expanded, *b: Expanded) -> Expanded:
    return on.add(a, *(scaled(each, -1) for each in b)) if b else scaled(a, -1)


def _product(on: Expander, *factors: Expanded) -> Expanded:
    return reduce(on.times, factors)


_ONE: Mapping[str, One] = {
    "abs": Expander.absolute,
    "exp": Expander.exponential,
    "log": Expander.logarithm,
    "sqrt": lambda on, x: on.power(x, HALF),
    "sign": lambda on, x: on.quotient(on.absolute(x), x),
    "sinh": lambda on, x: scaled(_exponentials(on, x, -1), HALF),
    "cosh": lambda on, x: scaled(_exponentials(on, x, 1), HALF),
    "tanh": lambda on, x: on.quotient(_exponentials(on, x, -1), _exponentials(on, x, 1)),
    "tan": lambda on, x: on.quotient(on.function("sin", x), on.function("cos", x)),
    "turn_ratio": _turn_ratio,
    "turn_curve": _turn_curve,
    "shown": lambda _, x: x,
}
_MANY: Mapping[str, Many] = {
    "+": Expander.add,
    "*": _product,
    "-": _minus,
    "/": Expander.quotient,
    "^": _power,
    "squared turn": _squared_turn,
}
_COMPOSED: Mapping[str, Many] = {**_ONE, **_MANY}
"""Operations in terms of others."""


def _circle(sign: int, at: int, exponent: Fraction) -> One:
    """(at ± x²) to a power."""
    return lambda on, x: on.power(on.add(number_of(at), scaled(on.times(x, x), sign)), exponent)


def _of_sinhc(on: Expander, x: Expanded) -> Expanded:
    return on.quotient(on.add(on.function("cosh", x), scaled(on.function("sinhc", x), -1)), x)


_SLOPES: Mapping[str, One] = {
    "log": lambda on, x: on.power(x, Fraction(-1)),
    "sum": lambda _, x: number_of(1),
    "absolute": lambda on, x: on.function("sign", x),
    "sin": lambda on, x: on.function("cos", x),
    "cos": lambda on, x: scaled(on.function("sin", x), -1),
    "atan": _circle(1, 1, Fraction(-1)),
    "asinh": _circle(1, 1, -HALF),
    "asin": _circle(-1, 1, -HALF),
    "acos": lambda on, x: scaled(_circle(-1, 1, -HALF)(on, x), -1),
    "acosh": _circle(1, -1, -HALF),
    "atanh": _circle(-1, 1, Fraction(-1)),
    "sinhc": _of_sinhc,
}
"""Derivatives of atoms by their argument."""
