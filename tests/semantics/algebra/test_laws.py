"""Every algebra that is shipped obeys every law, and its spoiled copy breaks it."""

from dataclasses import replace

import pytest
from hypothesis import strategies as st

from ephs.operad import ALGEBRA_LAWS
from ephs.semantics.algebra import Cost, cost
from ephs.testing import check_algebra
from ephs.testing.controls import law_cell
from ephs.testing.elements import ELEMENTS


@pytest.mark.parametrize("law", ALGEBRA_LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("algebra", ELEMENTS, ids=lambda algebra: algebra.name)
def test_the_law_holds_and_fails_on_its_control(algebra, law):
    cell = law_cell(law, algebra, ELEMENTS[algebra], max_examples=8)
    assert cell.holds
    assert cell.refuted


def test_a_check_says_which_law_fails_and_shows_both_sides():
    """Counting levels is no algebra: an identity is a level, too."""

    def levels(pattern, parts):
        found = cost.compose(pattern, parts)
        return replace(found, components=1 + max((part.components for part in parts.values()), default=0))

    def leaf(interface):
        return st.just(Cost(interface, frozenset(), 0, 0, 0))

    with pytest.raises(AssertionError, match=r"identity: id_A\(s\) = s(.|\n)*left(.|\n)*≠ right"):
        check_algebra(replace(cost, compose=levels), leaf, max_examples=20)
