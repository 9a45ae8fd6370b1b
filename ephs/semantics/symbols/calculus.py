"""Derivatives by states on groups, left-trivialised, and the symbols of the reference environment."""

from ephs.operad import Quantity
from ephs.operad.charges import ENTROPY, VOLUME
from ephs.semantics.spaces import codes
from ephs.semantics.symbols.algebra import Expr, sp

Symbols = tuple[Expr, ...]
Base = tuple[tuple[int, Symbols], ...]
"""The states that a formula reads: the code of each group, and symbols for the numbers of its point."""
TEMPERATURE, PRESSURE = sp.Symbol("theta_0", positive=True), sp.Symbol("pi_0", nonnegative=True)
"""θ₀ and π₀ of the reference environment."""


def intensive(quantity: Quantity) -> Symbols:
    """Energy efforts of a quantity in the reference environment, (dim,): of θ₀, π₀ and a potential of each charge."""
    out: list[Expr] = [sp.Integer(0)] * quantity.space.dim
    for charge, row in quantity.charges:
        known = {ENTROPY: TEMPERATURE, VOLUME: -PRESSURE}
        value = known[charge] if charge in known else potential(charge)
        out = [entry + _whole(number) * value for entry, number in zip(out, row, strict=True)]
    return tuple(out)


def potential(charge: str) -> Expr:
    """μ₀ of a charge in the reference environment."""
    return sp.Symbol(f"mu_0[{charge}]", real=True)


def _whole(number: float) -> Expr:
    return sp.Integer(int(number)) if number.is_integer() else sp.Float(number)


def tangent(base: Base) -> list[list[Expr]]:
    """(numbers, dimension) of the points: the derivatives of x·exp(v) by v at v = 0, group by group."""
    blocks = [_frame(code, x) for code, x in base]
    return sp.diag(*blocks).tolist() if blocks else []


def _frame(code: int, x: Symbols) -> Expr:
    if code == codes.VECTOR:
        return sp.eye(len(x))
    if code == codes.SE2:
        c, s = sp.cos(x[0]), sp.sin(x[0])
        return sp.Matrix([[1, 0, 0], [0, c, -s], [0, s, c]])
    w, a, b, c = x[:4]
    half = sp.Matrix([[-a, -b, -c], [w, -c, b], [c, w, -a], [-b, a, w]]) / 2
    if code == codes.SO3:
        return half
    if code == codes.SO3xR3:
        return sp.diag(half, sp.eye(3))
    rotation = sp.Matrix(
        [
            [1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b)],
            [2 * (a * b + w * c), 1 - 2 * (a * a + c * c), 2 * (b * c - w * a)],
            [2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)],
        ]
    )
    return sp.diag(half, rotation)


def trivialised(expression: Expr, base: Base) -> list[Expr]:
    """The left-trivialised derivative of an expression by the states, an entry for each direction."""
    symbols = [symbol for _, x in base for symbol in x]
    by = [_smooth(sp.diff(expression, symbol)) for symbol in symbols]
    frame = tangent(base)
    width = len(frame[0]) if frame else 0
    return [sum((by[i] * frame[i][j] for i in range(len(symbols))), sp.Integer(0)) for j in range(width)]


def _smooth(expression: Expr) -> Expr:
    """Without the impulses that derivatives of |x| have at a point."""
    return expression.subs({impulse: 0 for impulse in expression.atoms(sp.DiracDelta)})
