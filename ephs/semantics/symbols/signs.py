"""Signs of expressions, and non-negative matrices as sums of squares."""

from ephs.semantics.symbols.algebra import Expr, sp
from ephs.semantics.symbols.bounds import Bounds, at_least

LARGE = 300
"""Largest number of operations in an expression to rewrite; beyond it rewriting may take minutes."""
FACTORED = (60, 4)
"""Operations and symbols up to which a sum is factored."""


def vanishes(expression: Expr) -> bool:
    """Whether an expression is shown to be 0."""
    expression = sp.sympify(expression)
    if expression == 0 or sp.expand_mul(expression) == 0:
        return True
    if expression.count_ops() > 10 * LARGE:
        return False
    masked, _ = _masked(expression)
    if sp.expand(sp.numer(sp.together(masked))) == 0:
        return True
    return bool(expression.has(sp.sin, sp.cos) and expression.count_ops() <= LARGE and sp.trigsimp(expression) == 0)


def _masked(expression: Expr) -> tuple[Expr, dict[Expr, Expr]]:
    """A rational function with symbols for its non-rational subexpressions, and their definitions."""
    atoms = [e for e in sp.preorder_traversal(expression) if e.is_Function or (e.is_Pow and not e.exp.is_Integer)]
    names: dict[Expr, Expr] = {}
    for atom in dict.fromkeys(atoms):
        names[atom] = sp.Dummy(real=True, **_known(atom))
    masked = expression.xreplace(names)  # from the outside inwards: replacing an atom removes its contents
    return masked, {symbol: atom for atom, symbol in names.items()}


def _known(expression: Expr) -> dict[str, bool]:
    return {"positive": True} if expression.is_positive else {"nonnegative": True} if expression.is_nonnegative else {}


def rational(expression: Expr) -> Expr:
    """The expression over one denominator, in lowest terms."""
    if expression.count_ops() > LARGE:
        return expression
    masked, atoms = _masked(expression)
    return sp.cancel(sp.together(masked)).xreplace(atoms)


def sign_shown(expression: Expr, bounds: Bounds, *, strict: bool) -> str:
    """Proof that an expression is ≥ 0, or > 0; empty where there is none."""
    expression = sp.sympify(expression)
    if _by_signs(expression, strict):
        return "by the signs of its terms"
    if expression.count_ops() <= LARGE:
        factored = _factored(expression)
        if _by_signs(factored, strict):
            return "by the signs of its factors"
        if _by_factors(factored, bounds, strict):
            return "as a product of squares and what is of one sign"
    if at_least(expression, bounds, strict=strict):
        return "by interval arithmetic"
    return ""


def _factored(expression: Expr) -> Expr:
    masked, atoms = _masked(expression)
    masked = sp.cancel(sp.together(masked))
    operations, symbols = FACTORED
    if masked.count_ops() <= operations and len(masked.free_symbols) <= symbols:
        masked = sp.factor(masked)
    return sp.factor_terms(masked).xreplace(atoms)


def _by_signs(expression: Expr, strict: bool) -> bool:
    return bool(expression.is_positive if strict else expression.is_nonnegative)


def _by_factors(expression: Expr, bounds: Bounds, strict: bool) -> bool:
    """A product whose factors are even powers, or of one sign each."""
    negative = False
    for factor in sp.Mul.make_args(expression):
        base, power = factor.as_base_exp()
        if not strict and power.is_integer and power.is_even and power.is_positive:
            continue
        if factor.is_negative:
            negative = not negative
        elif not (_by_signs(factor, strict) or _sum_shown(base if power == 1 else factor, bounds, strict)):
            if not _sum_shown(-base if power == 1 else -factor, bounds, strict):
                return False
            negative = not negative
    return not negative


def _sum_shown(expression: Expr, bounds: Bounds, strict: bool) -> bool:
    if not expression.is_Add:
        return False
    expanded = sp.expand(expression)
    if _by_signs(expanded, strict):
        return True
    return _by_square(expanded, strict) or _by_roots(expanded, strict) or at_least(expression, bounds, strict=strict)


def _by_square(expression: Expr, strict: bool) -> bool:
    """a x² + b x + c with a > 0 and 4ac ≥ b²."""
    for symbol in sorted(expression.free_symbols, key=str):
        if not expression.is_polynomial(symbol) or sp.degree(expression, symbol) != 2:
            continue
        a, b, c = (expression.coeff(symbol, k) for k in (2, 1, 0))
        rest = sp.expand(4 * a * c - b**2)
        if _by_signs(a, True) and (_by_signs(sp.factor(rest), strict) or _by_square(rest, strict)):
            return True
    return False


def _by_roots(expression: Expr, strict: bool) -> bool:
    """A polynomial with numerical coefficients: real roots of even multiplicity only, none for strict positivity."""
    symbols = expression.free_symbols
    if len(symbols) != 1 or not expression.is_polynomial(*symbols):
        return False
    (symbol,) = symbols
    polynomial = sp.Poly(expression, symbol)
    if not all(coefficient.is_Rational for coefficient in polynomial.all_coeffs()):
        return False
    least = 0 if symbol.is_positive else None
    inside = 1 if symbol.is_positive else 0
    odd = [factor for factor, times in polynomial.sqf_list()[1] if strict or times % 2]
    return all(factor.count_roots(least, None) == 0 for factor in odd) and polynomial.eval(inside) > 0


def squares_shown(matrix: Expr, bounds: Bounds) -> str:
    """Proof that a symmetric matrix is a non-negative combination of squares; empty where there is none.

    M = Σ d v vᵀ by elimination along the diagonal, each d ≥ 0. Where a pivot may be 0 the rest holds on a dense set,
    and so everywhere if M is continuous.
    """
    rest, steps = matrix, list[str]()
    left = list(range(matrix.rows))
    continuous = not matrix.has(sp.sign, sp.Heaviside, sp.Piecewise, sp.floor, sp.ceiling)
    while left:
        if all(vanishes(rest[i, j]) for i in left for j in left):
            return _told(steps)
        for pivot in left:
            d = rational(rest[pivot, pivot])
            if d == 0:
                continue
            how = sign_shown(d, bounds, strict=False)
            column = {i: rational(rest[i, pivot] / d) for i in left}
            sound = continuous or all(_never_zero(sp.denom(v)) for v in column.values())
            if how and sound and all(_thin(sp.denom(v)) for v in column.values()):
                break
        else:
            return ""
        steps.append(how)
        reduced = rest.copy()
        left.remove(pivot)
        for i in left:
            for j in left:
                entry = rest[i, j] - column[i] * column[j] * d
                reduced[i, j] = sp.Integer(0) if vanishes(entry) else entry
        rest = reduced
    return _told(steps)


def _told(steps: list[str]) -> str:
    kind = {1: "a square with a factor", 0: "it is 0"}.get(len(steps), f"a sum of {len(steps)} squares with factors")
    ways = dict.fromkeys(step for step in steps if step)
    return f"{kind} ≥ 0, {' and '.join(ways)}" if ways else kind


def _never_zero(expression: Expr) -> bool:
    return bool(sp.sympify(expression).is_nonzero)


def _thin(expression: Expr) -> bool:
    """Whether it vanishes on no open set: it is analytic and not identically 0, or has no zeros."""
    expression = sp.sympify(expression)
    kinks = expression.has(sp.Abs, sp.sign, sp.Heaviside, sp.Piecewise, sp.Min, sp.Max, sp.floor)
    return _never_zero(expression) or (not kinks and expression != 0)
