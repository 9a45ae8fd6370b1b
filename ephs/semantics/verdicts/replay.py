"""Replay of proofs: a claim about formulas, and what proves it as plain data, checked by expansion and by signs.

Nothing here searches. A condition is an identity, which is expanded; or a sign, of a term that says it by the signs of
its parts and expands to the same; or that of a matrix, a sum of squares with factors of shown signs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import product
from typing import Any, final

import numpy as np

from ephs.semantics.meaning.fields import ROUNDED, as_written
from ephs.semantics.symbols.bounds import signs
from ephs.semantics.symbols.terms import Term
from ephs.semantics.verdicts.checks import ROTATING, STATEMENTS
from ephs.semantics.verdicts.claims import Claim, frame_of
from ephs.semantics.verdicts.expansion import Expander
from ephs.semantics.verdicts.sums import Expanded, Unexpandable, number_of, scaled
from ephs.semantics.verdicts.verdict import Evidence

READINGS: Mapping[str, Callable[[float], Fraction]] = {"as given": Fraction, "as written in decimals": as_written}
"""Rational number of a float, by the name of the reading; the first one is exact."""
EXPANSION: Evidence = ("expansion", "as given")
JUMPS = ("sign", "choose")
LEAPS = ("sign", "atan2")
"""Those of which an energy with them has no derivative somewhere."""
SIGNS = 3
"""Signs in a claim, at most."""
KINKS = (*JUMPS, "abs", "sqrt", "root")
"""Operations that are not analytic, or do not even have to be continuous."""


def replayed(claim: Claim, evidence: Mapping[str, Evidence]) -> frozenset[str]:
    """The statements of a claim that their evidence proves."""
    known: dict[str, Replay] = {}
    found: set[str] = set()
    for statement, each in evidence.items():
        try:
            form, *data = each
            reading = data[0] if form == "expansion" else "as given"
            on = known[reading] if reading in known else known.setdefault(reading, Replay(claim, READINGS[reading]))
            if on.proves(statement, form, data):
                found.add(statement)
        except (Unexpandable, LookupError, AttributeError, OverflowError, RecursionError, TypeError, ValueError):
            continue  # no proof, or nothing that is one
    return frozenset(found)


@final
class Replay:
    """A claim, expanded."""

    def __init__(self, claim: Claim, read: Callable[[float], Fraction] = Fraction) -> None:
        self.claim, self._read, self._on = claim, read, Expander()
        self._n = len(claim.parity) or 1  # there are no rows where there are no ports
        self._given = {symbol: self._symbol(symbol, *ends) for symbol, ends in claim.bounds.items()}
        self.rows = self._formulas({})
        signs = dict.fromkeys(_terms_of(claim.outputs, ("sign",)))
        if len(signs) > SIGNS:
            raise Unexpandable
        # sign x is |x|/x beside x = 0, and there it is 0
        zero = [replace(claim, outputs=tuple(_without(term, each) for term in claim.outputs)) for each in signs]
        self._there = [Replay(each, read) for each in zero]

    def proves(self, statement: str, form: str, data: Sequence[Any]) -> bool:
        """Whether evidence of a form proves a statement, beside the zeros of signs and at them."""
        return self._proves(statement, form, data) and all(on.proves(statement, form, data) for on in self._there)

    def _proves(self, statement: str, form: str, data: Sequence[Any]) -> bool:
        place = STATEMENTS[self.claim.kind].index(statement)
        if form == "rounding":
            return not data and self.claim.kind == "reversible" and place < 2 and self._rounded(place)
        if (self.claim.kind, place) == ("storage", 3):
            return form == "signs" and self._warm(*data)
        if (self.claim.kind, place) == ("irreversible", 1):
            return form == "squares" and self.squares_shown(*data)
        return form == "expansion" and len(data) == 1 and self._identities()[place]()

    def _identities(self) -> tuple[Callable[[], bool], ...]:
        """The conditions that are identities, in the order of `STATEMENTS`."""
        parity = self.claim.parity
        back = self._opposite([symbol for port in self.claim.seen if port.parity < 0 for symbol in port.symbols])
        turns = [self._opposite(port.symbols[:4]) for port in self.claim.seen if port.code in ROTATING]
        turned: Callable[[], bool] = lambda: all(self._steady(change, (1,) * self._n, 1) for change in turns)  # noqa: E731
        if self.claim.kind == "storage":
            return lambda: self._steady(back, parity, 1), turned, self._derived
        charges = [[number_of(self._read(w)) for w in row] for row in self.claim.conserved]
        if self.claim.kind == "reversible":
            leaks, mirrored = lambda: self._annihilates(charges), lambda: self._steady(back, parity, -1)
            return lambda: self.transposed(-1), leaks, mirrored, turned
        symbols = [symbol for port in self.claim.seen for symbol in port.symbols]
        efforts = [self._given[symbol] for symbol in symbols[: self._n]]
        return (
            lambda: self.transposed(1),
            lambda: False,
            lambda: self._annihilates([efforts]),
            lambda: self._annihilates(charges),
            lambda: self._steady(back, parity, 1),
            turned,
        )

    def _symbol(self, symbol: Term, low: float, high: float) -> Expanded:
        if low == high:
            return number_of(self._read(low))
        return scaled(self._on.atom("symbol", symbol, low >= 0.0 or high <= 0.0), -1 if high <= 0.0 else 1)

    def value(self, term: Term) -> Expanded:
        """A term, expanded."""
        return self._value(term, self._given, {})

    def _value(self, term: Term, given: Mapping[Term, Expanded], known: dict[int, Expanded]) -> Expanded:
        if isinstance(term, str) or (isinstance(term, tuple) and term[0] == "entry"):
            return given[term]
        if not isinstance(term, tuple):
            if not isinstance(term, int | float | Fraction):  # pyright: ignore[reportUnnecessaryIsInstance] - a root's tape
                raise Unexpandable
            return number_of(self._read(term))
        if id(term) not in known:  # terms share what was computed once
            known[id(term)] = self._on.function(term[0], *(self._value(each, given, known) for each in term[1:]))
        return known[id(term)]

    def _formulas(self, change: Mapping[Term, Expanded]) -> list[Expanded]:
        known: dict[int, Expanded] = {}
        return [self._value(term, {**self._given, **change}, known) for term in self.claim.outputs]

    def _same(self, one: Sequence[Expanded], other: Sequence[Expanded], sign: int = 1) -> bool:
        pairs = zip(one, other, strict=True)
        return all(self._on.vanishes(self._on.add(a, scaled(b, -sign))) for a, b in pairs)

    def _matrix(self, entries: Sequence[Expanded]) -> list[Sequence[Expanded]]:
        return [entries[i : i + self._n] for i in range(0, len(entries), self._n)]

    def _dot(self, one: Sequence[Expanded], other: Sequence[Expanded]) -> Expanded:
        return self._on.add(*(self._on.times(a, b) for a, b in zip(one, other, strict=True)))

    def _opposite(self, symbols: Sequence[Term]) -> dict[Term, Expanded]:
        return {symbol: scaled(self._given[symbol], -1) for symbol in symbols}

    def _steady(self, change: Mapping[Term, Expanded], parity: Sequence[int], flow: int) -> bool:
        """E(ϵx) = E(x); or M(ϵx) = ±ϵ M(x) ϵ, L likewise, and rows of C(ϵx) are those of C(x) ϵ or their opposites."""
        there = self._formulas(change)
        if self.claim.kind == "storage":
            return self._same(there, self.rows)
        above, below = (self._matrix(part) for part in (there[: self._n**2], there[self._n**2 :]))
        for i, (one, other) in enumerate(zip([*above, *below], self._matrix(self.rows), strict=True)):
            mirrored = [scaled(entry, sign) for entry, sign in zip(other, parity, strict=True)]
            if i < self._n and not self._same(one, mirrored, flow * parity[i]):
                return False
            if not any(self._same(one, mirrored, sign) for sign in (1, -1)):
                return False
        return True

    def transposed(self, sign: int) -> bool:
        """Whether M − Mᵀ = 0, or L + Lᵀ = 0."""
        matrix = self._matrix(self.rows[: self._n**2])
        return all(self._same(row, [other[i] for other in matrix], sign) for i, row in enumerate(matrix))

    def _annihilates(self, vectors: Sequence[Sequence[Expanded]]) -> bool:
        rows = self._matrix(self.rows)
        return all(self._on.vanishes(self._dot(row, vector)) for vector in vectors for row in rows)

    def derivative(self) -> list[Expanded]:
        """The left-trivialised derivative of the energy."""
        (energy,) = self.rows
        out: list[Expanded] = []
        for port in self.claim.seen:
            by = [self._on.slope(energy, symbol) for symbol in port.symbols]
            out += (self._dot([self.value(entry) for entry in row], by) for row in zip(*frame_of(port), strict=True))
        return out

    def _derived(self) -> bool:
        given = self.claim.gradient
        if _terms_of(self.claim.outputs, LEAPS):
            return False
        return given is None or self._same([self.value(term) for term in given], self.derivative())

    def sign_shown(self, of: Expanded, term: Term, *, strict: bool) -> bool:
        """Whether a term shows that what it expands to is ≥ 0, or > 0."""
        return signs(term, self.claim.bounds) <= ({1} if strict else {0, 1}) and self._same([of], [self.value(term)])

    def _warm(self, terms: Sequence[Term]) -> bool:
        slopes = [slope for slope, hot in zip(self.derivative(), self.claim.hot, strict=True) if hot]
        return all(self.sign_shown(slope, term, strict=True) for slope, term in zip(slopes, terms, strict=True))

    def _rounded(self, place: int) -> bool:
        """Whether sums in L + Lᵀ, or of rows with each charge, are 0 up to the rounding of each of their numbers."""
        matrix = np.array(self.claim.outputs, dtype=float).reshape(-1, self._n)
        if place == 0:
            skew = matrix[: self._n]
            apart = np.abs(skew + skew.T)
            own = np.maximum(np.abs(skew), np.abs(skew.T))
            return bool(np.all(apart <= ROUNDED * own))
        return all(np.all(np.abs(matrix @ w) <= ROUNDED * (np.abs(matrix) @ np.abs(w))) for w in self.claim.conserved)

    def eliminated(self, rows: Sequence[Expanded], pivot: int) -> tuple[list[Expanded], list[Expanded]]:
        """The vector v of a pivot d, and M − d v vᵀ; entries that vanish are 0."""
        matrix = self._matrix(rows)
        d = matrix[pivot][pivot]
        vector = [self._on.quotient(row[pivot], d) for row in matrix]
        rest: list[Expanded] = []
        for entry, (a, b) in zip(rows, product(matrix, vector), strict=True):
            less = self._on.add(entry, scaled(self._on.times(a[pivot], b), -1))
            rest.append({} if self._on.vanishes(less) else less)
        return vector, rest

    def conductances(self) -> list[list[Term]] | None:
        """(n, n) K of the powers θ ∘ f = K θ that a process between temperatures θ takes; None where K depends on θ.

        As M θ = 0, f = M (θ − θ₀) / θ₀ is minus the sums of the rows of M.
        """
        on, matrix = self._on, self._matrix(self.rows)
        symbols = [symbol for port in self.claim.seen for symbol in port.symbols]
        if not all(self.claim.hot) or len(symbols) != self._n:
            return None
        theta, found = [self._given[symbol] for symbol in symbols], list[list[Term]]()
        for own, row in zip(theta, matrix, strict=True):
            power = scaled(on.times(own, on.add(*row)), -1)
            slopes = [on.slope(power, symbol) for symbol in symbols]
            rest = on.add(power, scaled(self._dot(slopes, theta), -1))
            bent = [on.slope(slope, symbol) for slope in slopes for symbol in symbols]
            if not all(map(on.vanishes, [rest, self._dot(row, theta), *bent])):
                return None
            found.append([on.term(slope) for slope in slopes])
        return found

    def term(self, of: Expanded) -> Term:
        """A term that expands to the same."""
        return self._on.term(of)

    def squares_shown(self, squares: Sequence[tuple[Term, Sequence[Term]]]) -> bool:
        """Whether M = Σ d v vᵀ, from factors d ≥ 0 with vectors v (n,)."""
        total: list[list[Expanded]] = [[] for _ in self.rows]
        for factor, vector in squares:
            d, v = self.value(factor), [self.value(entry) for entry in vector]
            shown = -1 not in signs(factor, self.claim.bounds) and all(map(self._thin, vector))
            if len(v) != self._n or not shown:
                return False
            for terms, (a, b) in zip(total, product(v, v), strict=True):
                terms.append(self._on.times(d, self._on.times(a, b)))
        return self._same(self.rows, [self._on.add(*terms) for terms in total])

    def _thin(self, term: Term) -> bool:
        """Whether denominators are 0 on no open set, nowhere if formulas jump: the rest follows by continuity."""
        if not isinstance(term, tuple) or term[0] == "entry":
            return True
        word, *arguments = term
        below = arguments[1] if word == "/" else arguments[0] if word == "^" else 1.0
        smooth = not _terms_of([below], KINKS) and not _terms_of(self.claim.outputs, JUMPS)
        return (smooth or 0 not in signs(below, self.claim.bounds)) and all(map(self._thin, arguments))


def _terms_of(terms: Sequence[Term], words: Sequence[str]) -> list[Term]:
    """Terms of some operations within others; terms share parts, each of which is looked at once."""
    left, seen, found = list(terms), set[int](), list[Term]()
    while left:
        term = left.pop()
        if not isinstance(term, tuple) or id(term) in seen:
            continue
        seen.add(id(term))
        found += [term] * (term[0] in words)
        left += term[1:]
    return found


def _without(term: Term, zero: Term) -> Term:
    """A term with another one's value 0."""
    if term == zero:
        return 0.0
    return (term[0], *(_without(each, zero) for each in term[1:])) if isinstance(term, tuple) else term
