"""Elements of the algebras: closed forms, how they are made and printed, and what is refused by name."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest

from ephs.operad import Directory, Path, Pattern, PortType, Quantity, Space, junction, quantity
from ephs.semantics import SemanticsError
from ephs.semantics.algebra import (
    Conductors,
    Corelation,
    ExactRelation,
    Sharer,
    Units,
    conduction,
    corelations,
    exact_relations,
    intervals,
    resource_sharers,
    units,
)

Q = quantity
LEVEL = Quantity("level", Space("real", 1, 1), 1)
ONE = ("one", Path(), 0)


def ports(**of):
    return Directory({name: PortType(each) for name, each in of.items()})


def test_the_mesh_of_a_star_has_exact_bounds():
    """c₁c₂/(c₁ + c₂ + c₃) grows with c₁ and c₂ and falls with c₃; its bounds are those at corners, found one by one."""
    text = "x: entropy, exposed; y: entropy, exposed; z: entropy, exposed; m: entropy; s(x, y, z, m)"
    ends, bounds = "xyz", ((1, 2), (1, 3), (1, 5))
    star = Conductors.of(
        ports(x=Q.entropy, y=Q.entropy, z=Q.entropy, m=Q.entropy),
        [(end, "m", *pair) for end, pair in zip(ends, bounds, strict=True)],
    )
    mesh = {key: pair for key, pair in Pattern.from_text(text).apply(intervals, {"s": star}).bounds}
    assert len(mesh) == 3
    for (i, one), (j, other) in (((0, "x"), (1, "y")), ((0, "x"), (2, "z")), ((1, "y"), (2, "z"))):
        corners = [Fraction(c[i] * c[j], sum(c)) for c in product(*bounds)]
        assert mesh[(Path.parse(one), 0), (Path.parse(other), 0)] == (min(corners), max(corners))


def test_a_conductor_between_two_ports_on_one_junction_conducts_nothing():
    part = Conductors.of(ports(a=Q.entropy, b=Q.entropy), [("a", "b", 1, 2), ("a", ".", 1, 1), ("b", ".", 2, 2)])
    found = Pattern.from_text("j: entropy, exposed; p(a=j, b=j)").apply(intervals, {"p": part})
    assert str(found) == "j - ground: [3, 3]"
    assert str(conduction(found)) == "effort j - 1/3 flow j = 0"
    assert str(Conductors.of(ports(a=Q.entropy))) == "(nothing conducts)"


def test_two_ports_of_a_part_on_one_junction_add_their_coefficients():
    """e₁ + 2 e₂ = 3 with e₁ = e₂ gives e = 1."""
    a, b = Path.parse("a"), Path.parse("b")
    part = ExactRelation.of(ports(a=Q.entropy, b=Q.entropy), [{("effort", a, 0): 1, ("effort", b, 0): 2, ONE: -3}])
    found = Pattern.from_text("j: entropy, exposed; p(a=j, b=j)").apply(exact_relations, {"p": part})
    assert str(found) == "effort j - 1 = 0"


def test_there_is_one_empty_relation():
    of = ports(q=Q.displacement)
    flow = ("flow", Path.parse("q"), 0)
    twice = [ExactRelation.of(of, rows) for rows in ([{ONE: 2}], [{ONE: 1}, {flow: 1}], [{flow: 1}, {flow: 1, ONE: 5}])]
    assert twice[0] == twice[1] == twice[2] and twice[0].empty
    assert not ExactRelation.of(of, [{flow: 1}]).empty
    assert str(ExactRelation.of(of, [])) == "(no equation)"


def test_units_follow_through_parts_that_do_not_know_them():
    """A sensor of unknown unit, its lever and the spring that it reads: the unit of the level comes out as metres."""
    sensor = Units.of(ports(l=LEVEL, q=Q.displacement), [({"l": 2, "q": -2}, {})])
    free = Units.of(ports(l=LEVEL))
    assert free.unit("l") is None
    pattern = Pattern(
        {"l": junction(LEVEL, exposed=True), "q": junction(Q.displacement)},
        {"s": {"l": "l", "q": "q"}, "f": {"l": "l"}},
    )
    found = pattern.apply(units, {"s": sensor, "f": free})
    assert found.unit("l") == "m" and found.consistent
    wrong = Units.of(ports(l=LEVEL), [({"l": 1}, {"s": 1})])
    broken = pattern.apply(units, {"s": sensor, "f": wrong})
    assert not broken.consistent
    with pytest.raises(SemanticsError, match="l: found equations that contradict each other"):
        broken.unit("l")
    assert Units.of(ports(p=Q.momentum, a=Q.angle)).unit("p") == "kg m s^-1"
    assert Units.of(ports(p=Q.momentum, a=Q.angle)).unit("a") == "1"


def test_a_quantity_of_ones_own_brings_its_unit():
    """The unit that a quantity states is the one that is used, whatever words it is written in."""
    bits = Quantity("data", Space("real", 1, 1), 1, unit="bit")
    length = Quantity("reach", Space("real", 1, 1), 1, unit="J/N")
    assert Units.of(ports(b=bits)).unit("b") == "bit"
    assert Units.of(ports(l=LEVEL, b=bits), [({"l": 1, "b": -1}, {"bit": 1, "m": -1})]).unit("l") == "m^-1 bit^2"
    assert Units.of(ports(r=length)).unit("r") == "m"


def test_the_smallest_identification_that_travels_upwards():
    """A part that joins two of its ports joins what they are on."""
    part = Corelation.of(ports(a=Q.displacement, b=Q.displacement), [("a", "b")])
    pattern = Pattern.from_text(
        "j: displacement, exposed; k: displacement, exposed; l: displacement, exposed; w(a=j, b=k); v(l)"
    )
    alone = Corelation.of(ports(l=Q.displacement))
    assert str(pattern.apply(corelations, {"w": part, "v": alone})) == "j ~ k; l"
    assert str(Corelation.of(Directory({}))) == "(no port)"


def test_predator_and_prey_are_the_sum_of_what_befalls_them():
    growth = Sharer.of(ports(x=LEVEL), {"x": "x"}, lambda v: {"x": (2 * v["x"][0],)})
    death = Sharer.of(ports(y=LEVEL), {"y": "y"}, lambda v: {"y": (-3 * v["y"][0],)})
    meeting = Sharer.of(
        ports(x=LEVEL, y=LEVEL),
        {"x": "x", "y": "y"},
        lambda v: {"x": (-v["x"][0] * v["y"][0],), "y": (v["x"][0] * v["y"][0],)},
    )
    pattern = Pattern(
        {"x": junction(LEVEL), "y": junction(LEVEL)},
        {"grow": {"x": "x"}, "die": {"y": "y"}, "meet": {"x": "x", "y": "y"}},
    )
    whole = pattern.apply(resource_sharers, {"grow": growth, "die": death, "meet": meeting})
    prey, hunter = (frozenset(map(Path.parse, names)) for names in (("grow.x", "meet.x"), ("die.y", "meet.y")))
    assert set(whole.states) == {prey, hunter}
    assert whole.rates({prey: (5,), hunter: (7,)}) == {prey: (2 * 5 - 35,), hunter: (-3 * 7 + 35,)}
    rates = whole.rates({prey: (np.float64(0.1),), hunter: (np.float64(0.2),)})
    assert rates[prey][0] == pytest.approx(0.18)


REFUSED = {
    "no such port to join": (lambda: Corelation.of(ports(a=Q.angle), [("a", "b")]), "b: no such outer port"),
    "unlike quantities": (
        lambda: Corelation.of(ports(a=Q.angle, q=Q.charge), [("a", "q")]),
        r"q: joined to a, found charge on real, expected angle on real; only equal quantities share a state",
    ),
    "no such conductor": (lambda: Conductors.of(ports(a=Q.angle), [("a", "b", 1, 2)]), "b: no such outer port"),
    "bounds in the wrong order": (
        lambda: Conductors.of(ports(a=Q.angle), [("a", ".", 2, 1)]),
        r"a: the conductance is \(2, 1\), expected bounds 0 ≤ lower ≤ upper < ∞",
    ),
    "bounds without end": (lambda: Conductors.of(ports(a=Q.angle), [("a", ".", 2, np.inf)]), "a: the conductance is"),
    "a unit that is none": (
        lambda: Units.of(ports(a=Q.angle), [({"a": 1}, {"furlong": 1})]),
        "furlong: found furlong, expected kg, m, s, A, K, mol",
    ),
    "a port that shows nothing": (
        lambda: Sharer.of(ports(a=Q.angle), {}, lambda v: {}, {"z": 1}),
        "a: the port shows the state None, expected a state of dimension 1, known: z of dimension 1",
    ),
    "a state of two dimensions": (
        lambda: Sharer.of(ports(a=Q.angle, p=Q.pose), {"a": "z", "p": "z"}, lambda v: {}),
        "p: the port shows the state z, expected a state of dimension 6, known: z of dimension 1",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_element_is_refused_by_name(case):
    make, words = REFUSED[case]
    with pytest.raises(SemanticsError, match=words):
        make()
