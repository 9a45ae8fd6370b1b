"""Every algebra that is shipped obeys every law, and its spoiled copy breaks it."""

from dataclasses import replace

import pytest
from hypothesis import HealthCheck, Phase, find, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from ephs.operad import ALGEBRA_LAWS, Directory, PortType
from ephs.semantics.algebra import Corelation, Cost, corelations, cost
from ephs.testing import algebra_inputs, check_algebra
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


FIRST_TWO = {
    "by name": lambda _, group: sorted(group)[:2],
    "the last by name": lambda _, group: sorted(group)[-2:],
    "by order": lambda pattern, group: [path for path in pattern.junctions if path in group][:2],
}


@pytest.mark.parametrize("two", FIRST_TWO)
def test_a_composition_that_joins_only_two_of_a_link_is_found(two):
    """With the draws and the number of examples of `check_algebra` as it is called without more."""

    def compose(pattern, parts):
        joins = [FIRST_TWO[two](pattern, group) for group in pattern.links]
        for box, part in parts.items():
            ports = pattern.boxes[box].ports
            joins += [[ports[port].junction for port in group] for group in part.classes]
        outer = Directory({path: PortType(of.quantity) for path, of in pattern.junctions.items()})
        joined = Corelation.of(outer, joins).classes
        shown = (group & pattern.interface.keys() for group in joined)
        return Corelation(pattern.interface, frozenset(frozenset(group) for group in shown if group))

    wrong = replace(corelations, compose=compose)
    limits = settings(max_examples=50, database=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck))

    def found(law):
        try:
            find(
                algebra_inputs(law, wrong, ELEMENTS[corelations]), lambda drawn: not law(*drawn).holds, settings=limits
            )
        except NoSuchExample:
            return False
        return True

    assert any(found(law) for law in ALGEBRA_LAWS)
