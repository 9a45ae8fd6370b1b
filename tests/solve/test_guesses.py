"""Guesses of unknowns from those of former steps: rules are exact for their polynomials, the best is taken."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.semantics.stage import PLAIN
from ephs.solve.methods.guesses import BEFORE, RULES, extrapolated

DEGREES = [(1, -1), (3, -1), (5, -1), (2, 0), (4, 0), (3, 1)]
"""Degrees of the polynomial and of the factor of (−1)ᵏ for which rules are exact; −1: none."""
whole = st.integers(-9, 9)


def sequence(smooth, alternating, count):
    """So many values of a polynomial and (−1)ᵏ times another, the latest first, with the one that follows."""
    values = [
        sum(c * k**i for i, c in enumerate(smooth)) + (-1) ** k * sum(c * k**i for i, c in enumerate(alternating))
        for k in range(count + 1)
    ]
    return values[-2::-1], values[-1]


def guess(rule, values):
    return sum(Fraction(weight) * value for weight, value in zip(rule, values, strict=False))


@pytest.mark.parametrize(("rule", "degrees"), list(zip(RULES, DEGREES, strict=True)), ids=str)
@given(st.data())
def test_a_rule_is_exact_for_its_polynomials_and_no_others(rule, degrees, data):
    smooth, alternating = (data.draw(st.lists(whole, min_size=d + 1, max_size=d + 1)) for d in degrees)
    values, following = sequence(smooth, alternating, len(rule))
    assert guess(rule, values) == following
    for more in (([*smooth, 1], alternating), (smooth, [*alternating, 1])):
        values, following = sequence(*more, len(rule))
        assert guess(rule, values) != following


@given(st.lists(whole, min_size=BEFORE + 1, max_size=BEFORE + 1))
def test_a_rule_that_guessed_best_before_is_taken(values):
    errors = [abs(values[0] - guess(rule, values[1:])) for rule in RULES]
    best = [guess(rule, values) for rule, error in zip(RULES, errors, strict=True) if error == min(errors)]
    assert extrapolated(PLAIN, [float(v) for v in values]) in best  # whole numbers: no rounding


def test_another_rule_is_taken_where_it_was_closer():
    values = [float(k) ** 7 for k in range(BEFORE + 1, 0, -1)]
    assert extrapolated(PLAIN, values, [(0.0, 7.0)]) == 7.0
    assert extrapolated(PLAIN, values, [(1e9, 7.0)]) == extrapolated(PLAIN, values)
