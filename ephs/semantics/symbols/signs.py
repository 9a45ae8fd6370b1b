"""Search for terms that show signs, and for sums of squares, where a formula does not show them as it is written.

What is found is evidence for `verdicts.replay`, which decides: here nothing needs to be right.
"""

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from ephs.semantics.symbols.algebra import Expr, sp
from ephs.semantics.symbols.bounds import Bounds, signs
from ephs.semantics.symbols.terms import OPERATIONS, Term, rational_term

LARGE = 300
"""Largest number of operations in an expression to rewrite; beyond it rewriting may take minutes."""
MANY = 300
"""The same of all matrices that one is eliminated through."""
FACTORED = (60, 4)
"""Operations and symbols up to which a sum is factored."""
Squares = tuple[tuple[Term, tuple[Term, ...]], ...]
"""Factors ≥ 0 and vectors of a sum of squares."""


class Signs:
    """Expressions of SymPy for terms over the same symbols, and back."""

    def __init__(self, bounds: Bounds) -> None:
        self.bounds = bounds
        self._symbols = {
            term: sp.Symbol(f"x_{i}", real=True, **_sign(low, high))
            for i, (term, (low, high)) in enumerate(bounds.items())
        }
        self._terms: dict[Expr, Term] = {symbol: term for term, symbol in self._symbols.items()}

    def expression(self, term: Term) -> Expr:
        """A term as an expression; functions that are not elementary stay symbols."""
        if isinstance(term, str) or (isinstance(term, tuple) and term[0] == "entry"):
            return self._symbols[term]
        if not isinstance(term, tuple):
            return sp.Rational(term)
        word, *arguments = term
        parts = [self.expression(each) for each in arguments]
        if word in "+*-/^":
            return OPERATIONS[word][2](*parts)
        if word in _FUNCTIONS:
            return _FUNCTIONS[word](*parts)
        opaque = sp.Symbol(f"{word}({', '.join(map(str, parts))})", real=True, **_known(signs(term, self.bounds)))
        self._terms[opaque] = term
        return opaque

    def term(self, expression: Expr) -> Term:
        """An expression as a term."""
        if expression in self._terms:
            return self._terms[expression]
        if expression.is_Rational:
            return rational_term(Fraction(int(expression.p), int(expression.q)))
        if expression.is_Number or expression.is_NumberSymbol:
            return float(expression)
        word = _WORDS[expression.func]
        return (word, *(self.term(argument) for argument in expression.args))

    def shown(self, term: Term, *, strict: bool = False) -> "Term | None":
        """A term that says by the signs of its parts that it is ≥ 0, or > 0, and equals the given one."""
        allowed = {1} if strict else {0, 1}
        if signs(term, self.bounds) <= allowed:
            return term
        expression = self.expression(term)
        for candidate in (rational(expression), _factored(expression)):
            found = self._product(candidate, strict)
            if signs(found, self.bounds) <= allowed:
                return found
        return None

    def _product(self, expression: Expr, strict: bool) -> Term:
        """The term of a product whose factors each show their sign, where they have one."""
        return ("*", *(self._factor(factor, strict) for factor in sp.Mul.make_args(expression)))

    def _factor(self, factor: Expr, strict: bool) -> Term:
        base, power = factor.as_base_exp()
        if not base.is_Add:
            return self.term(factor)
        allowed = {1} if strict else {0, 1}
        for side in (base, -base):
            for term in self._sums(side, strict):
                if signs(term, self.bounds) <= allowed:
                    signed: Term = term if side is base else ("-", term)
                    return signed if power == 1 else ("^", signed, self.term(power))
        return self.term(factor)

    def _sums(self, expression: Expr, strict: bool) -> Iterator[Term]:
        """Ways to write a sum that may show its sign."""
        expanded = sp.expand(expression)
        yield self.term(expanded)
        yield from self._completed(expanded)
        yield ("shown", self.term(expression))
        if expanded.is_polynomial():
            yield ("shown", self.term(sp.horner(expanded)))

    def _completed(self, expression: Expr) -> Iterator[Term]:
        """a (x + b/2a)² + (4ac − b²)/4a of a x² + b x + c."""
        for symbol in sorted(expression.free_symbols, key=str):
            if not expression.is_polynomial(symbol) or sp.degree(expression, symbol) != 2:
                continue
            a, b, c = (expression.coeff(symbol, k) for k in (2, 1, 0))
            square: Term = ("*", self.term(a), ("^", self.term(symbol + b / (2 * a)), 2.0))
            rest = sp.expand(4 * a * c - b**2)
            for term in (self.term(sp.factor(rest)), *(self._completed(rest) if rest.free_symbols else ())):
                yield ("+", square, ("/", term, ("*", 4.0, self.term(a))))

    def squares(self, matrix: Sequence[Term]) -> "Squares | None":
        """A symmetric matrix (n, n) as Σ d v vᵀ, by elimination along the diagonal, each d ≥ 0."""
        n = int(len(matrix) ** 0.5)
        rest = sp.Matrix(n, n, [rational(self.expression(entry)) for entry in matrix])
        left, found, operations = list(range(n)), list[tuple[Term, tuple[Term, ...]]](), 0
        while any(rest[i, j] != 0 for i in left for j in left):
            operations += sum(entry.count_ops() for entry in rest)
            if operations > MANY:
                return None
            for pivot in left:
                d = rest[pivot, pivot]
                shown = None if d == 0 else self.shown(self.term(d))
                if shown is not None:
                    break
            else:
                return None
            column = [rational(rest[i, pivot] / d) if i in left else sp.Integer(0) for i in range(n)]
            found.append((shown, tuple(map(self.term, column))))
            rest = (rest - d * sp.Matrix(column) * sp.Matrix([column])).applyfunc(rational)
            left.remove(pivot)
        return tuple(found)


def _sign(low: float, high: float) -> Mapping[str, bool]:
    return {"positive": True} if low >= 0.0 else {"negative": True} if high <= 0.0 else {}


def _known(possible: frozenset[int]) -> Mapping[str, bool]:
    return _sign(*{frozenset({1}): (0.0, 1.0), frozenset({-1}): (-1.0, 0.0)}.get(possible, (-1.0, 1.0)))


def _masked(expression: Expr) -> tuple[Expr, dict[Expr, Expr]]:
    """A rational function with symbols for its non-rational subexpressions, and their definitions."""
    atoms = [e for e in sp.preorder_traversal(expression) if e.is_Function or (e.is_Pow and not e.exp.is_Integer)]
    names: dict[Expr, Expr] = {}
    for atom in dict.fromkeys(atoms):
        names[atom] = sp.Dummy(real=True, positive=True if atom.is_positive else None)
    masked = expression.xreplace(names)  # from the outside inwards: replacing an atom removes its contents
    return masked, {symbol: atom for atom, symbol in names.items()}


def rational(expression: Expr) -> Expr:
    """The expression over one denominator, in lowest terms."""
    if expression.count_ops() > LARGE:
        return expression
    masked, atoms = _masked(expression)
    return sp.cancel(sp.together(masked)).xreplace(atoms)


def _factored(expression: Expr) -> Expr:
    if expression.count_ops() > LARGE:
        return expression
    masked, atoms = _masked(expression)
    masked = sp.cancel(sp.together(masked))
    operations, symbols = FACTORED
    if masked.count_ops() <= operations and len(masked.free_symbols) <= symbols:
        masked = sp.factor(masked)
    return sp.factor_terms(masked).xreplace(atoms)


_FUNCTIONS: Mapping[str, Expr] = {"abs": sp.Abs} | {
    name: getattr(sp, name)
    for name in (
        *("acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cos", "cosh", "exp", "log"),
        *("sign", "sin", "sinh", "sqrt", "tan", "tanh"),
    )
}
_WORDS: Mapping[Expr, str] = {function: word for word, function in _FUNCTIONS.items() if word != "sqrt"} | {
    sp.Add: "+",
    sp.Mul: "*",
    sp.Pow: "^",
}
