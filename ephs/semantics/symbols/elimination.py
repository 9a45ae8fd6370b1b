"""Elimination of unknowns from equations that are linear in them."""

from collections.abc import Mapping

from ephs.semantics.symbols.algebra import Expr, sp


def tidy(expression: Expr) -> Expr:
    """A shorter equal expression, if one is found; of operators the expanded one."""
    expanded = sp.expand(expression)
    if not expanded.is_commutative:
        return expanded
    return min((expanded, sp.simplify(expanded)), key=sp.count_ops)


def settled(expression: Expr, known: Mapping[Expr, Expr]) -> Expr:
    """An expression after repeated substitution of all known values.

    Raises
    ------
    ArithmeticError
        A value contains its own symbol, if only by way of others.
    """
    for _ in range(len(known) + 1):  # each substitution ends chains of values that are one longer
        new = expression.subs(known)
        if new == expression:
            return sp.expand(new)
        expression = new
    raise ArithmeticError(f"the values of {', '.join(map(str, known))} contain each other")


def eliminate(equations: list[Expr], unknowns: list[Expr]) -> tuple[dict[Expr, Expr], list[Expr]]:
    """Solve equations (expressions equal to zero) for unknowns that occur once, with a nonzero factor.

    Returns what was solved, and the expressions left.
    """
    left = list(equations)
    solved: dict[Expr, Expr] = {}
    for unknown in unknowns:
        for number, expression in enumerate(left):
            coefficient = coefficient_of(expression, unknown)
            if coefficient is None:
                continue
            value = sp.expand(unknown - expression / coefficient)
            del left[number]
            left = [sp.expand(other.subs(unknown, value)) for other in left]
            solved = {symbol: sp.expand(entry.subs(unknown, value)) for symbol, entry in solved.items()}
            solved[unknown] = value
            break
    return solved, left


def coefficient_of(expression: Expr, unknown: Expr) -> Expr | None:
    """The factor of an unknown that occurs linearly, if it is a nonzero number or parameter."""
    terms = [term for term in sp.Add.make_args(expression) if term.has(unknown)]
    if len(terms) != 1:
        return None
    factor, rest = terms[0].as_independent(unknown)
    if rest != unknown or factor == 0:
        return None
    if factor.is_number or (factor.is_commutative and factor.is_nonzero):
        return factor
    return None
