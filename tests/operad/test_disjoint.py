"""Disjoint sets are the connected components of what was joined."""

from hypothesis import given
from hypothesis import strategies as st

from ephs.operad import Path
from ephs.operad.disjoint import DisjointSets
from ephs.operad.links import closure

PAIRS = st.lists(st.tuples(st.integers(0, 12), st.integers(0, 12)))


def components(pairs):
    """The components of a graph, by repeated search; elements that no pair names are left out."""
    found = {frozenset(pair) for pair in pairs}
    while overlapping := next(((a, b) for a in found for b in found if a != b and a & b), None):
        found = found - set(overlapping) | {overlapping[0] | overlapping[1]}
    return found


@given(PAIRS)
def test_sets_are_components(pairs):
    sets = DisjointSets[int]()
    joined = [sets.join(*pair) for pair in pairs]
    leaders = {element: sets.leader(element) for element in sets}
    found = {frozenset(e for e, leader in leaders.items() if leader == root) for root in leaders.values()}
    assert found == components(pairs)
    assert sum(joined) == len(leaders) - len(found)


@given(PAIRS, st.integers(0, 12), st.integers(0, 12))
def test_the_leader_of_the_first_leads(pairs, first, second):
    sets = DisjointSets[int]()
    for pair in pairs:
        sets.join(*pair)
    expected = sets.leader(first)
    sets.join(first, second)
    assert sets.leaders((first, second)) == [expected, expected]


def test_classes_of_a_closure_have_two_members_or_more():
    a, b, c, d = map(Path.parse, "abcd")
    assert closure([[a, b], [c], [c, c], [b, d]]) == dict.fromkeys([a, b, d], frozenset([a, b, d]))
