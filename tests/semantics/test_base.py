"""States that interconnection makes one: across levels, stored twice, shown at outer ports, stored by nobody."""

import numpy as np
import pytest

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs import quantity as Q
from ephs.mechanics.elements.components import gravity
from ephs.operad import ROOT, Path
from ephs.semantics import AssemblyError, Reference, Relation, SemanticsError, System
from ephs.semantics.meaning.step import solved as solve
from ephs.semantics.primitives.behaviour import NaturalBehaviour
from ephs.semantics.spaces import SE3
from ephs.semantics.systems.laws import random_probe, system_law
from tests.numerics import EPS

ROTATION = np.array([[0.0, -1.0], [1.0, 0.0]])
COUPLED = Pattern.from_text(
    "j: displacement; k: displacement; p: momentum; v: momentum; j ~ k; "
    "s(q=j); t(q=k); m(p); n(p=v); x(q=j, p); y(q=k, p=v)"
)
"""Two oscillators whose springs have one state."""
READER = ephs.gyrator(
    {"q": Q.charge, "p": Q.flux_linkage, "~x": Q.displacement}, lambda x: (1.0 + x**2) * ROTATION, name="reader"
)
BLIND = ephs.gyrator({"q": Q.charge, "p": Q.flux_linkage, "~a": Q.displacement}, ROTATION, name="blind")
SPRING = ephs.storage({"q": Q.displacement}, lambda q: q**2)
WIRE = Pattern.from_text(
    "a: displacement, exposed as state; b: displacement, exposed as state; a ~ b; "
    "c: charge; f: flux_linkage; e(q=c, p=f, a=~a)"
)
CIRCUIT = "c: charge; f: flux_linkage; r(q=c, p=f, x=~k); C(q=c); L(b=f)"
COIL = {"C": lib.capacitor(c=1.0), "L": lib.inductor(l=1.0)}
OPEN = Pattern.from_text("k: displacement, exposed as state; " + CIRCUIT)
"""A circuit whose gyrator reads a state that is shown at an outer port and stored by nobody."""
CLOSED = Pattern.from_text("k: displacement; " + CIRCUIT)


def both(system, *values, **more):
    """The relation of a system at a point, by both routes, which agree."""
    flat, nested = (system.relation(route=route) for route in ("flat", "nested"))
    assert flat.classes == nested.classes
    flat, nested = flat.at(*values, **more), nested.at(*values, **more)
    assert flat.contradiction == nested.contradiction
    assert flat.same(nested)
    return nested


def rate(relation, name):
    """The one possible rate of a state."""
    assert relation.dimension == 1
    return relation.values[Path.of(name)]


def test_identifications_travel_through_three_levels():
    """What the innermost part identifies reaches a reader three levels up, through links on the way."""
    middle = Pattern.from_text(
        "a: displacement, exposed as state; m: displacement, exposed as state; b: displacement; w(a=~a, b=~b); b ~ m"
    )
    outer = Pattern.from_text("a: displacement, exposed as state; k: displacement, exposed as state; n(a=~a, m=~k)")
    top = Pattern.from_text("j: displacement; k: displacement; o(a=~j, k=~k); s(q=j); " + CIRCUIT)
    system = top(o=outer(n=middle(w=WIRE(e=BLIND))), s=SPRING, r=READER, **COIL)
    assert rate(both(system, {"s.q": 3.0, "L.b": 1.0}), "C.q") == pytest.approx(10.0)
    for seed in range(3):
        probe = random_probe(system, seed)
        for law in ("functoriality", "naturality", "Dirac", "renaming"):
            assert system_law(law)(probe).holds


TWICE = {
    "on one junction": Pattern.from_text("j: displacement; s(q=j); t(q=j)")(s=SPRING, t=SPRING),
    "on linked junctions": Pattern.from_text("j: displacement; k: displacement; s(q=j); t(q=k); j ~ k")(
        s=SPRING, t=SPRING
    ),
    "at different levels": Pattern.from_text("j: displacement; s(q=j); t(q=~j)")(
        s=SPRING, t=Pattern.from_text("q: displacement, exposed as state; t(q)")(t=SPRING)
    ),
    "joined by a part": Pattern.from_text("j: displacement; k: displacement; w(a=~j, b=~k); s(q=j); t(q=k)")(
        w=WIRE(e=BLIND), s=SPRING, t=SPRING
    ),
}


@pytest.mark.parametrize("case", TWICE)
def test_a_state_stored_twice_has_a_relation_on_the_diagonal_only(case):
    system = TWICE[case]
    first, second = (path for path in system.states)
    there = both(system, {str(first): 1.0, str(second): 1.0})
    assert not there.empty and not there.contradiction
    # a value that is not given is that of its class
    assert there.distance(both(system, {str(first): 1.0})) <= 1e-15
    apart = both(system, {str(first): 1.0, str(second): 2.0})
    assert apart.empty and apart.dimension == 0
    assert str(first) in apart.contradiction and str(second) in apart.contradiction
    assert apart.rates == there.rates and apart.order == there.order
    (both_of,) = (each for each in system.relation().classes if len(each.stores) > 1)
    assert both_of.name == min(first, second) and not both_of.free
    assert apart.distance(there) == there.distance(apart) == 1.0


def test_two_rotations_are_one_state_up_to_sign_and_rounding():
    twice = Pattern.from_text("p: pose; a(q=p); b(q=p)")
    system = twice(
        a=gravity([0.0, 0.0, -1.0], "SE3"),
        b=gravity([0.0, 0.0, -1.0], "SE3"),
    )
    one = SE3.random(np.random.default_rng(0))
    other = np.concatenate([-one[:4], one[4:] * (1.0 + 2e-16)])
    assert not both(system, {"a.q": one, "b.q": other}).contradiction
    assert both(system, {"a.q": one, "b.q": SE3.retract(one, np.full(6, 1e-12))}).contradiction


def test_values_are_equal_up_to_rounding_of_their_size():
    system = TWICE["on one junction"]
    for value, sign in ((1.0, 1.0), (0.0, 1.0), (1000.0, -1.0)):
        near, far = (value + sign * k * EPS * max(1.0, value) for k in (6.0, 12.0))
        assert not both(system, {"s.q": value, "t.q": near}).contradiction
        assert both(system, {"s.q": value, "t.q": far}).contradiction


def test_the_routes_are_what_they_are_called():
    whole = Pattern.from_text("k: displacement; s(q=k); o(k=~k)")(s=SPRING, o=OPEN(r=READER, **COIL))
    flat, nested = (whole.relation(route=route) for route in ("flat", "nested"))
    assert whole.relation() == flat == whole.flatten().relation(route="nested") != nested
    assert "fibre" not in repr(nested)


def test_relations_of_other_names_or_other_states_are_not_compared():
    system = TWICE["on one junction"]
    one = system.relation().at({"s.q": 1.0})
    with pytest.raises(ValueError, match="other names"):
        one.distance(OPEN(r=READER, **COIL).relation().at())
    lone = Pattern.from_text("j: displacement; s(q=j)")(s=SPRING).relation()
    assert lone.at({"s.q": 1.0}).distance(lone.at({"s.q": 2.0})) == 0.0  # closed: no motion but rest, at any effort


def test_a_state_that_an_outer_port_shows_has_its_value_from_there():
    system = OPEN(r=READER, **COIL)
    for value in (0.0, 0.7, -2.0):
        relation = both(system, {"L.b": 1.0}, {"k": value})
        assert rate(relation, "C.q") == pytest.approx(1.0 + value**2)
        assert relation.distance(both(system, {"L.b": 1.0, "r.x": value})) <= 1e-15
    assert (
        both(system, {"r.x": 1.0}, {"k": 2.0}).contradiction
        == "one state has several values: state r.x = [1.]; port k = [2.]"
    )
    held = {"L.b": np.ones(1)}
    solved = solve(system, held, NaturalBehaviour(Reference(), 1e-9), {}, {"k": 3.0})
    assert solved.rates[Path.of("C.q")] == pytest.approx(10.0)


def test_a_state_that_nobody_stores_is_a_coordinate_of_the_base():
    system = CLOSED(r=READER, **COIL)
    (free,) = (each for each in system.relation().classes if each.free)
    assert str(free.name) == "r.x"
    for value in (0.0, 0.7):
        assert rate(both(system, {"L.b": 1.0, "r.x": value}), "C.q") == pytest.approx(1.0 + value**2)
    probe = random_probe(system)
    assert free.name in probe.state
    assert system_law("functoriality")(probe).holds and system_law("renaming")(probe).holds


def test_a_state_shown_at_an_outer_power_port_has_a_value_from_there_too():
    spring = SPRING
    shown = Pattern.from_text("k: displacement, exposed; s(q=k)")(s=spring)
    assert both(shown, {"s.q": 2.0}).distance(both(shown, {}, {"k": 2.0})) <= 1e-15
    apart = both(shown, {"s.q": 2.0}, {"k": 1.0})
    assert apart.empty and len(apart.order) == len(both(shown).order) == 4
    assert [str(each.name) for each in shown.relation().classes] == ["s.q"]
    assert [(each.name, each.free) for each in as_relation(lib.pkc()).classes] == [
        (Path.of("p"), False),
        (Path.of("q"), False),
    ]


def test_storages_of_one_state_move_together_over_a_step():
    """Both ends of a step are points of the base."""
    parts = {"m": lib.point_mass(m=1.0), "x": lib.pkc(), "y": lib.pkc(), "s": SPRING, "t": SPRING}
    even, uneven = (COUPLED(parts | {"n": lib.point_mass(m=m)}) for m in (1.0, 2.0))
    state = {"s.q": 1.0, "m.p": 0.5, "n.p": 0.5}
    solved = solve(even, state, NaturalBehaviour(Reference(), 0.01), {})
    assert solved.residual <= 1e-12
    assert solved.rates[Path.of("s.q")] == pytest.approx(solved.rates[Path.of("t.q")], abs=1e-12)
    # the springs would part, and no force holds them together
    assert solve(uneven, state, NaturalBehaviour(Reference(), 0.01), {}).residual > 1e-3
    assert solve(even, state | {"t.q": 1.1}, NaturalBehaviour(Reference(), 0.01), {}).residual == np.inf


def test_a_relation_fills_a_box_beside_systems_and_primitives_in_any_order():
    top = Pattern.from_text("k: displacement; s(q=k); o(k=~k)")
    circuit = OPEN(r=READER, **COIL)
    whole = top(s=SPRING, o=circuit)
    values = {"s.q": 2.0, "o.L.b": 1.0, "o.C.q": 0.3}
    for route in ("flat", "nested"):
        part = circuit.relation(route=route)
        for fillings in (
            {"s": SPRING, "o": part},
            {"o": part, "s": SPRING},
            {"o": part, "s": Pattern.identity(SPRING.interface)({ROOT: SPRING})},
        ):
            glued = top(fillings)
            assert isinstance(glued, Relation)
            assert glued.classes == whole.relation().classes
            assert glued.at(values).distance(whole.relation().at(values)) <= 1e-13
    assert top(s=SPRING, o=circuit.relation()) == top(o=circuit.relation(), s=SPRING)
    assert isinstance(whole, System)


def test_the_relation_of_nothing_composes():
    nothing = Pattern({}, {})
    relation = Pattern.identity(SPRING.interface)({ROOT: SPRING}).relation()
    empty = relation.compose(nothing, {})
    assert empty.classes == () and empty.at().dimension == 1


def test_what_does_not_compose_is_refused_by_name():
    top = Pattern.from_text("k: displacement; s(q=k); o(k=~k)")
    relation = OPEN(r=READER, **COIL).relation()
    with pytest.raises(SemanticsError, match=r"o: the relation is relative to .*300.*take relations to one reference"):
        relation.compose(
            top, {Path.of("s"): as_relation(SPRING), Path.of("o"): OPEN(r=READER, **COIL).relation(Reference(300.0))}
        )
    by_text, by_path = (relation.compose(top, {of("s"): SPRING, of("o"): relation}) for of in (str, Path.of))
    assert by_text == by_path
    with pytest.raises(TypeError, match="s: a filling is a System, a primitive or a Relation, found float"):
        relation.compose(top, {Path.of("s"): 1.0, Path.of("o"): relation})


def as_relation(primitive):
    return Pattern.identity(primitive.interface)({ROOT: primitive}).relation()


@pytest.mark.parametrize(
    ("state", "ports", "words"),
    [
        ({"x": 1.0}, {}, "x: no such state; the states are C.q, L.b, r.x"),
        ({}, {"x": 1.0}, "x: no such outer port; the outer ports are k"),
        ({"C.q": [1.0, 2.0]}, {}, r"C.q: the initial value has shape \(2,\)"),
        ({}, {"k": np.nan}, "k: the initial value is .*nan"),
    ],
)
def test_points_that_are_none_are_refused_by_name(state, ports, words):
    with pytest.raises(AssemblyError, match=words):
        OPEN(r=READER, **COIL).relation().at(state, ports)


FRICTION = Pattern.from_text("p: momentum, exposed; s: entropy, exposed; mf(p, s)")(mf=lib.friction(d=1.0)).relation()


def test_efforts_are_named_by_text_as_by_path():
    """The matrix of friction depends on the velocity at which it is taken."""
    e = np.array([2.0, 100.0])
    named, pathed = FRICTION.at(None, None, {"mf": e}), FRICTION.at(efforts={Path.of("mf"): e})
    assert named.distance(pathed) == 0.0
    assert named.distance(FRICTION.at()) > 0.1


@pytest.mark.parametrize(
    ("efforts", "words"),
    [
        ({"fm": [1.0, 2.0]}, "fm: no such component; the components are mf"),
        ({"mf.p": [1.0, 2.0]}, "mf.p: no such component; the components are mf"),
        ({"mf": 1.0}, r"mf: the efforts are 1.0, expected finite numbers of shape \(2,\)"),
        ({"mf": [1.0, np.inf]}, r"mf: the efforts are \[1.0, inf\], expected finite numbers of shape \(2,\)"),
        ({"mf": "much"}, "mf: the efforts are 'much', expected finite numbers"),
    ],
)
def test_efforts_of_no_component_are_refused_by_name(efforts, words):
    with pytest.raises(AssemblyError, match=words):
        FRICTION.at(efforts=efforts)
