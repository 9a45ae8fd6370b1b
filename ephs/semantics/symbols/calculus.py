"""Symbols of the reference environment."""

from ephs.operad import Quantity
from ephs.operad.charges import ENTROPY, VOLUME
from ephs.semantics.symbols.algebra import Expr, sp

Symbols = tuple[Expr, ...]
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
