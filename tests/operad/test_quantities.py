"""Quantities are values; kinds of relative pose come from one table."""

import dataclasses

import pytest
from hypothesis import given

from ephs.operad import PatternError, Quantity, Space, quantity
from ephs.operad import quantities as table
from ephs.testing import quantities

ONE = Space("real", 1, 1)
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
    assert first.matches(second) == (first.in_frame(None) == second.in_frame(None))


@given(quantities())
def test_frames_count_for_equality_and_not_for_matching(q):
    bare, b, c = q.in_frame(None), q.in_frame("B"), q.in_frame("C")
    assert bare.matches(b) and c.matches(bare) and b.matches(c)
    assert len({bare, b, c}) == 3


def test_no_two_known_quantities_match():
    found = [getattr(quantity, word) for word in WORDS]
    assert [a.kind for a in found for b in found if a is not b and a.matches(b)] == []


@pytest.mark.parametrize("word", WORDS)
def test_momenta_and_fluxes_are_odd(word):
    q = getattr(quantity, word)
    assert q.parity == (-1 if any(odd in word for odd in ("momentum", "flux", "impulse")) else 1)
    assert q.environment == (word in ("entropy", "volume", "liquid"))
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
        (lambda: Quantity("x", ONE, 1, domain=(2.0, 1.0)), ["x", "2.0", "less"]),
        (lambda: Quantity("x", ONE, 1, domain=(float("nan"), 1.0)), ["x", "nan"]),
        (lambda: Quantity("x", ONE, 1, domain=None), ["x", "None", "two numbers"]),
        (lambda: Quantity("x", Space("SO(3)", 3, 4), 1, domain=(0.0, 1.0)), ["x", "SO(3)", "vector spaces"]),
        (lambda: Quantity("x", Space("SO(3)", 3, 4), 1, charges={"a": (1, 1, 1)}), ["x", "SO(3)", "vector spaces"]),
        (lambda: Quantity("x", ONE, 1, charges={"a": (1, 2)}), ["x", "a: (1, 2)", "1 finite number each"]),
        (lambda: Quantity("x", Space("real", 2, 2), 1, charges={"a": 1}), ["x", "a: 1", "2 finite numbers each"]),
        (lambda: Quantity("x", ONE, 1, charges={"a": float("inf")}), ["x", "inf", "finite"]),
        (lambda: Quantity("x", ONE, 1, charges={"a": "two"}), ["x", "two"]),
        (lambda: Quantity("x", ONE, 1, charges=3), ["x", "3"]),
        (lambda: Quantity("x", ONE, 1, charges={"entropy": 1}), ["x", "entropy"]),
        (lambda: Quantity("entropy", ONE, 1, charges={"entropy": 2}), ["entropy", "2"]),
        (lambda: Quantity("x", ONE, 1, unit="kg/"), ["kg/", "product"]),
        (lambda: quantity.species("salt", Na=1, Cl=0), ["salt", "Cl: 0"]),
        (lambda: Space("real", -1, 1), ["real", "-1"]),
        (lambda: Space("real", 2, 1), ["real", "2", "1"]),
    ],
)
def test_a_wrong_quantity_is_refused(make, words):
    with pytest.raises(PatternError) as caught:
        make()
    assert all(word in str(caught.value) for word in words)


def test_other_quantities_are_made_beside_those_of_the_package():
    assert quantity.Quantity is Quantity
    assert "Quantity" not in table.quantity_names()
    with pytest.raises(AttributeError, match="there is no quantity 'Quantities'"):
        _ = quantity.Quantities


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


def test_a_known_kind_brings_its_domain_charges_and_unit():
    for word in WORDS:
        q = getattr(quantity, word)
        assert Quantity(q.kind, q.space, q.parity) == q
    cold = Quantity("volume", ONE, 1, domain=(1.0, 2.0))
    assert cold.charges == quantity.volume.charges and cold != quantity.volume and not cold.matches(quantity.volume)
    assert Quantity("volume", Space("real", 3, 3), 1).charges == ()


def test_charges_are_rows_of_an_element_matrix():
    water, two = quantity.species("H2O", O=1, H=2), Quantity("gases", Space("real", 2, 2), 1, charges={"N": (2, 0)})
    assert water.charges == (("H", (2.0,)), ("O", (1.0,))) and water.positive and water.unit == "mol"
    assert water == quantity.species("H2O", H=2.0, O=1.0) != quantity.species("ice", H=2, O=1)
    assert two.charges == (("N", (2.0, 0.0)),) and two.environment
    assert quantity.species("He").charges == (("He", (1.0,)),)
    assert Quantity("x", ONE, 1, charges={"a": 0.0}) == Quantity("x", ONE, 1)


def test_what_tells_quantities_apart_is_said():
    one, other = (Quantity("x", ONE, 1, charges={"a": k}, unit="bit", domain=(0.0, 1.0)) for k in (1, 2))
    assert str(one) == "x on real in bit between 0 and 1 with a 1" != str(other)
    assert str(quantity.volume) == "volume on real"


@pytest.mark.parametrize(("unit", "alike"), [("N s", True), ("kg m s^-1", True), ("N", False), ("1", False)])
def test_units_are_compared_by_what_they_are_made_of(unit, alike):
    one, other = Quantity("push", ONE, -1, unit="kg m/s"), Quantity("push", ONE, -1, unit=unit)
    assert one.matches(other) == other.matches(one) == alike
