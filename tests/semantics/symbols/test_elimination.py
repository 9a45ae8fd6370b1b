"""Substitution of known values: it ends, whatever they are."""

import pytest

from ephs.semantics.symbols.algebra import sp
from ephs.semantics.symbols.equations import settled

SYMBOLS = sp.symbols("x0:6")


@pytest.mark.parametrize("backward", [False, True])
@pytest.mark.parametrize("count", range(6))
def test_a_chain_of_values_is_followed_to_its_end(count, backward):
    """x₀ = x₁ + 1, x₁ = x₂ + 1, … is xₙ + n."""
    links = [(SYMBOLS[k], SYMBOLS[k + 1] + 1) for k in range(count)]
    known = dict(reversed(links) if backward else links)
    assert settled(2 * SYMBOLS[0], known) == sp.expand(2 * (SYMBOLS[count] + count))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_values_that_contain_each_other_are_named(count):
    known = {SYMBOLS[k]: SYMBOLS[(k + 1) % count] + 1 for k in range(count)}
    with pytest.raises(ArithmeticError, match="contain each other"):
        settled(SYMBOLS[0], known)
