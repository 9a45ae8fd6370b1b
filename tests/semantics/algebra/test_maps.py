"""What commutes with every pattern, and what does not, for a reason."""

from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ephs.operad import ROOT, AlgebraMap, Directory, Path, Pattern, PortType, law, quantity
from ephs.semantics.algebra import (
    ExactRelation,
    Sharer,
    base,
    behaviour,
    conduction,
    cost,
    counting,
    euler,
    exact_relations,
    flattening,
    intervals,
    meaning_of_systems,
    midpoint,
    relations,
    resource_sharers,
    runge_kutta,
    systems,
    tangent,
)
from ephs.semantics.bundles.bundle import Bundle
from ephs.semantics.meaning import LinearRelation, glued
from ephs.semantics.meaning.components import at_ports
from ephs.semantics.meaning.fields import Rounded
from ephs.semantics.meaning.variables import ONE, RelationVariable
from ephs.testing import check_algebra_map, patterns
from ephs.testing import systems as drawn_systems
from ephs.testing.controls import refuted
from ephs.testing.elements import ELEMENTS, FEW
from tests.numerics import EPS

Q = quantity


def exact_conductors(interface):
    """Conductors whose bounds agree."""
    return ELEMENTS[intervals](interface).map(lambda element: intervals.lax.points(element)[0])


MAPS = {
    flattening: ELEMENTS[systems],
    meaning_of_systems(): ELEMENTS[systems],
    counting: ELEMENTS[systems],
    base: ELEMENTS[relations],
    behaviour: ELEMENTS[exact_relations],
    midpoint(Fraction(1, 10)): ELEMENTS[exact_relations],
    conduction: exact_conductors,
    euler(Fraction(1, 10)): ELEMENTS[resource_sharers],
    tangent: ELEMENTS[resource_sharers],
}


@pytest.mark.parametrize("alpha", MAPS, ids=repr)
def test_the_map_commutes_with_every_pattern(alpha):
    check_algebra_map(alpha, MAPS[alpha], quantities=FEW, max_examples=15)


def test_a_map_that_forgets_ports_or_adds_at_every_level_is_seen():
    closed = AlgebraMap(cost, cost, lambda s: replace(s, interface=Directory({}), carried=frozenset()))
    assert refuted(law("interface kept by a map"), closed, ELEMENTS[cost])
    more = AlgebraMap(cost, cost, lambda s: replace(s, components=s.components + 1))
    assert refuted(law("naturality"), more, ELEMENTS[cost])


def test_a_rule_whose_stages_look_ahead_does_not_commute():
    """A part by itself does not know where the others take a shared state: Runge's middle is another for the whole."""
    assert refuted(law("naturality"), runge_kutta(Fraction(1, 10)), ELEMENTS[resource_sharers])


def test_the_middle_of_intervals_does_not_commute():
    """Elimination is not linear in conductances, so that bounds cannot be replaced by their middle."""
    middle = AlgebraMap(intervals, exact_relations, conduction.component)
    assert refuted(law("naturality"), middle, ELEMENTS[intervals])


PORT = Directory({"x": PortType(Q.displacement)})
DECAY = Sharer.of(PORT, {"x": "x"}, lambda v: {"x": (1 - v["x"][0],)})
LOSS = Sharer.of(PORT, {"x": "x"}, lambda v: {"x": (-v["x"][0] * v["x"][0],)})


def slope(sharer, at):
    """The derivative of the one rate by the one state."""
    (rate,) = tangent(sharer).rates({state: (at, 1.0) for state in sharer.states}).values()
    return rate[1]


def test_linearising_commutes_at_the_state_of_the_whole_and_not_at_each_parts_own_equilibrium():
    whole = Pattern.from_text("j: displacement, exposed; a(x=j); b(x=j)").apply(
        resource_sharers, {"a": DECAY, "b": LOSS}
    )
    rest = (5.0**0.5 - 1.0) / 2.0
    (state,) = whole.states
    assert abs(whole.rates({state: (rest,)})[state][0]) <= 4.0 * EPS
    assert slope(whole, rest) == pytest.approx(-(5.0**0.5), rel=1e-15)
    assert slope(DECAY, rest) + slope(LOSS, rest) == slope(whole, rest)
    # by themselves the parts rest at 1 and at 0
    assert slope(DECAY, 1.0) + slope(LOSS, 0.0) == -1.0


@settings(max_examples=25)
@given(patterns(of=FEW), st.data())
def test_relations_over_the_rationals_are_those_over_the_reals(pattern, data):
    """The exact relation of a composite is what floats with error bounds give."""
    parts = {box: data.draw(ELEMENTS[exact_relations](of.interface)) for box, of in pattern.boxes.items()}
    exact = pattern.apply(exact_relations, parts)
    field = Rounded()
    real = glued(field, pattern, {box: over_the_reals(field, part, box) for box, part in parts.items()})
    assert over_the_reals(field, exact, ROOT).same(real.join(LinearRelation.of(field, [ONE])))


def over_the_reals(field, relation, box):
    """An exact relation as one of floats; states have a name for good, below a box."""

    def named(kind, path, i):
        if kind == "one":
            return ONE
        outer = kind in ("flow", "effort")
        return RelationVariable("outer" if outer else "own", kind, ROOT, path if outer else box / path, i)

    bundle = Bundle.of(relation.interface)
    known = {named(kind, path, i) for path, dim in relation.inner for kind in ("state", "rate") for i in range(dim)}
    known |= {ONE, *at_ports("flow", bundle), *at_ports("effort", bundle)}
    rows = [field.exact({named(*key): float(value) for key, value in row}) for row in relation.equations]
    return LinearRelation.of(field, known, rows)


@settings(max_examples=15, suppress_health_check=list(HealthCheck))
@given(drawn_systems(isolated=True))
def test_costs_are_the_sizes_of_the_equations(system):
    found, flat = counting(system), system.descriptor()
    assert found.components == len(flat.components)
    assert found.rates == flat.rate_size
    assert found.balances == flat.effort_size


def test_discretising_a_linear_oscillator_exactly():
    """The midpoint rule with h = 1 turns the unit oscillator by 2 arctan(1/2): cos = 3/5, sin = 4/5."""
    q, p, one = Path.parse("q"), Path.parse("p"), Fraction(1)

    def storage(port):
        of = Directory({port: PortType(Q.displacement)})
        rows = [
            {("flow", port, 0): 1, ("rate", port, 0): -1},
            {("effort", port, 0): 1, ("state", port, 0): -1},
        ]
        return ExactRelation.of(of, rows, {port: 1})

    pair = Directory({q: PortType(Q.displacement), p: PortType(Q.displacement)})
    turn = ExactRelation.of(
        pair,
        [{("flow", q, 0): 1, ("effort", p, 0): 1}, {("flow", p, 0): 1, ("effort", q, 0): -1}],
    )
    pattern = Pattern.from_text("q: displacement; p: displacement; pe(q); ke(p); pkc(q, p)")
    whole = pattern.apply(exact_relations, {"pe": storage(q), "ke": storage(p), "pkc": turn})
    step = midpoint(1)(whole)
    before = {("before", Path.parse("pe.q"), 0): one, ("before", Path.parse("ke.p"), 0): Fraction(0)}
    after = dict(before)
    for row in step.equations:
        (key, _), *rest = row
        after[key] = -sum((value * before[other] for other, value in rest), Fraction(0))
    assert after["after", Path.parse("pe.q"), 0] == Fraction(3, 5)
    assert after["after", Path.parse("ke.p"), 0] == Fraction(-4, 5)  # q̇ = p, ṗ = −q
