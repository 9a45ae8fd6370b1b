"""Breaks of the operad in places that draws reach seldom: each is found by a law, on one of the first examples."""

from itertools import pairwise

import pytest
from hypothesis import HealthCheck, Phase, find, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from ephs.operad import Nesting, Pattern, PatternError, links, normal, substitution, wellformed
from ephs.operad import quantity as Q
from ephs.testing import nestings, patterns
from tests.broken import put_in_place

FINDING = settings(
    max_examples=200, database=None, deadline=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)
FEW = st.sampled_from([Q.displacement, Q.displacement.in_frame("B"), Q.momentum])


def orders_differ(nesting):
    """Whether some order of substitution gives another pattern, or what is not a pattern."""
    whole = nesting.flatten()
    again = whole if whole.is_identity else Pattern(whole.junctions, whole.boxes, whole.links)
    return (
        any(whole != other for other in (nesting.bottom_up(), nesting.top_down(), again))
        or len(whole.boxes) != nesting.size
        or {p: t.power for p, t in whole.interface.items()}
        != {p: t.power for p, t in nesting.pattern.interface.items()}
    )


def unread_link_is_unseen(f):
    """Whether a link of junctions that all bear power makes no other pattern."""
    wired = {port.junction for content in f.boxes.values() for port in content.ports.values() if port.power}
    return any(
        Pattern(f.junctions, f.boxes, [g for g in f.links if g != group]) == f for group in f.links if group <= wired
    )


def is_not_one_class(f):
    """Whether the members of a group, given as one, or as a chain of pairs, are not one class."""
    for group in f.links:
        path, *others = sorted(group)
        for given in ([[path, *others]], [[path, other] for other in others], [*pairwise([path, *others])]):
            if f.is_identity or Pattern(f.junctions, f.boxes, [*(f.links - {group}), *given]).links != f.links:
                return True
    return False


NESTED, SINGLE, READ = "nestings", "patterns", "links"
LAWS = {
    NESTED: (nestings(max_depth=3, max_boxes=2, of=FEW), orders_differ),
    SINGLE: (patterns(of=FEW, identities=False, state_ports=False), unread_link_is_unseen),
    READ: (patterns(of=st.just(Q.displacement), identities=False), is_not_one_class),
}
WHILE = "while {0}.pattern.is_identity and {0}.children:"
BROKEN = {
    "identities around the whole are opened once": (
        substitution.flatten,
        WHILE.format("nesting"),
        WHILE.format("nesting").replace("while", "if"),
        NESTED,
    ),
    "identities inside are opened once": (
        substitution.flatten,
        WHILE.format("child"),
        WHILE.format("child").replace("while", "if"),
        NESTED,
    ),
    "an identity's filling is lost": (
        substitution._through_identity,
        "return Nesting(filling, child.children)",
        "return Nesting(filling)",
        NESTED,
    ),
    "links of a filling are lost": (
        substitution._opened,
        "for group in filling.links",
        "for group in list(filling.links)[1:]",
        NESTED,
    ),
    "a filling's links join two": (
        substitution._opened,
        "for path in group) for group",
        "for path in sorted(group)[:2]) for group",
        NESTED,
    ),
    "a state shown outside is not linked": (
        substitution._opened,
        "whole.links.append(",
        "(",
        NESTED,
    ),
    "a state shown outside is absorbed": (
        substitution._opened,
        "if inner.exposed and inner.power:",
        "if inner.exposed:",
        NESTED,
    ),
    "a filling's junction stays exposed": (
        substitution._opened,
        "Junction(inner.quantity) if inner.exposed else inner",
        "inner",
        NESTED,
    ),
    "the handle that is kept is dropped": (
        substitution._tidied,
        "for path in handles if path != first",
        "for path in handles",
        NESTED,
    ),
    "exposed handles are dropped": (
        substitution._tidied,
        "if path not in bearing and not junctions[path].exposed}",
        "if path not in bearing}",
        NESTED,
    ),
    "ports stay on dropped handles": (
        substitution._redirected,
        "moved.get(port.junction, port.junction)",
        "port.junction",
        NESTED,
    ),
    "links of dropped handles are lost": (
        substitution._tidied,
        "classes = closure([path for path in group if path not in moved] for",
        "classes = closure([] for",
        NESTED,
    ),
    "power is moved with a state": (
        normal.powered,
        "if port.power}",
        "if not port.power}",
        NESTED,
    ),
    "links that nobody reads are not compared": (
        normal.normal_form,
        "if found.outer or found.ports or len(found.members) > 1:",
        "if found.outer or found.ports:",
        SINGLE,
    ),
    "links among power junctions are not compared": (
        normal.normal_form,
        "for path in stateful} | pattern.links:",
        "for path in stateful}:",
        SINGLE,
    ),
    "links that are read alone are compared": (
        normal.normal_form,
        "or len(found.members) > 1",
        "or len(found.members) > 2",
        SINGLE,
    ),
    "a link joins two": (
        links.closure,
        "for other in others:",
        "for other in others[:1]:",
        READ,
    ),
    "a link joins three": (
        links.closure,
        "for other in others:",
        "for other in others[:2]:",
        READ,
    ),
    "a link joins the last": (
        links.closure,
        "for other in others:",
        "for other in others[-1:]:",
        READ,
    ),
    "classes of three are none": (
        links.closure,
        "if len(paths) > 1]",
        "if len(paths) == 2]",
        READ,
    ),
    "classes of two are none": (
        links.closure,
        "if len(paths) > 1]",
        "if len(paths) > 2]",
        READ,
    ),
    "repeated names in a link": (
        wellformed.read_links,
        "groups.append(group)",
        "groups.append(group[:2])",
        READ,
    ),
}
"""Name -> function, text, what replaces it, which law finds it."""


@pytest.mark.parametrize("name", BROKEN)
def test_a_law_finds_what_is_broken(name, monkeypatch):
    function, old, new, law = BROKEN[name]
    strategy, fails = LAWS[law]
    put_in_place(monkeypatch, function, old, new)

    def found(drawn):
        try:
            return fails(drawn)
        except (PatternError, KeyError, ValueError, StopIteration):  # what is broken may be seen by a check, too
            return True

    try:
        assert isinstance(find(strategy, found, settings=FINDING), Nesting | Pattern)
    except PatternError as error:  # already what is drawn is none
        assert error.kind == "no-inner-port"


@pytest.mark.parametrize("law", LAWS)
def test_nothing_is_found_where_nothing_is_broken(law):
    strategy, fails = LAWS[law]
    with pytest.raises(NoSuchExample):
        find(strategy, fails, settings=settings(FINDING, max_examples=60))
