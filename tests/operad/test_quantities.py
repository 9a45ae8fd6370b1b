"""Quantities are values; kinds of relative pose come from one table."""

import dataclasses

import pytest
from hypothesis import given

from ephs.operad import PatternError, Quantity, Space, quantity
from ephs.operad import quantities as table
from ephs.testing import quantities

WORDS = [f.name for f in dataclasses.fields(quantity)]
DIMS = {
    "revolute": (1, 1),
    "prismatic": (1, 1),
    "cylindrical": (2, 2),
    "planar": (3, 3),
    "spherical": (3, 4),
    "fixed": (0, 0),
    "free": (6, 7),
}


@given(quantities(), quantities())
def test_quantities_are_values(first, second):
    assert eval(repr(first)) == first
    assert first.matches(second) == second.matches(first)
    assert first.matches(first)
    if first == second:
        assert hash(first) == hash(second) and first.matches(second)
    alike = (first.kind, first.space, first.parity) == (second.kind, second.space, second.parity)
    apart = None not in (first.frame, second.frame) and first.frame != second.frame
    assert first.matches(second) == (alike and not apart)


@given(quantities())
def test_frames_count_where_both_sides_have_one(q):
    bare, b, c = q.in_frame(None), q.in_frame("B"), q.in_frame("C")
    assert bare.matches(b) and c.matches(bare) and not b.matches(c)
    assert len({bare, b, c}) == 3


def test_no_two_known_quantities_match():
    found = [getattr(quantity, word) for word in WORDS]
    assert [a.kind for a in found for b in found if a is not b and a.matches(b)] == []


@pytest.mark.parametrize("word", WORDS)
def test_momenta_and_fluxes_are_odd(word):
    q = getattr(quantity, word)
    assert q.parity == (-1 if "momentum" in word or "flux" in word else 1)
    assert q.environment == (word in ("entropy", "volume"))
    assert repr(q) == f"quantity.{word}"


@pytest.mark.parametrize("kind", DIMS)
def test_pairs_have_their_dimensions(kind):
    pose, momentum = quantity.relative_pose(kind), quantity.joint_momentum(kind)
    assert (pose.space.dim, pose.space.size) == DIMS[kind]
    assert momentum.space == Space(kind + "*", DIMS[kind][0], DIMS[kind][0])
    assert (pose.parity, momentum.parity) == (1, -1)
    assert (pose.kind, momentum.kind) == ("relative_pose", "momentum")


def test_screws_differ_by_pitch():
    first, second = (quantity.relative_pose("screw", pitch=pitch) for pitch in (0.1, 0.2))
    assert first.space.parameters == (("pitch", 0.1),) and not first.matches(second)
    assert eval(repr(first)) == first and str(first) == "relative_pose on screw(pitch=0.1)"


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: quantity.relative_pose("ball"), ["'ball'", "spherical", "revolute"]),
        (lambda: quantity.joint_momentum("screw"), ["screw", "none", "pitch"]),
        (lambda: quantity.relative_pose("revolute", pitch=1.0), ["revolute", "pitch", "none"]),
        (lambda: Quantity("x", Space("real", 1, 1), 0), ["x", "0", "+1"]),
        (lambda: Space("real", -1, 1), ["real", "-1"]),
        (lambda: Space("real", 2, 1), ["real", "2", "1"]),
    ],
)
def test_a_wrong_quantity_is_refused(make, words):
    with pytest.raises(PatternError) as caught:
        make()
    assert all(word in str(caught.value) for word in words)


def test_a_further_kind_of_pair_has_its_quantities(monkeypatch):
    monkeypatch.setattr(table, "_PAIRS", dict(table._PAIRS))
    with pytest.raises(PatternError, match="expected one of"):
        quantity.relative_pose("table")
    table.name_pair("table", 2, 2)
    table.name_pair("table", 2, 2)  # saying it again changes nothing
    assert quantity.relative_pose("table").space == Space("table", 2, 2)
    assert quantity.joint_momentum("table").space == Space("table*", 2, 2)
    assert table.quantity_word(quantity.relative_pose("table")) == ("relative_pose", ("table",), {})
    with pytest.raises(PatternError, match="known with dim"):
        table.name_pair("revolute", 2, 2)
