"""Floats with bounds of their errors: what they find is what ℚ finds of the same numbers, and bounds are never lost."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import ephs
from ephs.operad import ROOT, Path
from ephs.semantics.meaning.fields import ROUNDED, Rational, Rounded
from ephs.semantics.meaning.linear import LinearRelation
from ephs.semantics.meaning.posed import Answer
from ephs.semantics.meaning.relation import Instant
from ephs.semantics.meaning.variables import ONE, RelationVariable
from ephs.semantics.systems.probe import random_probe
from ephs.testing import fillings, nestings, systems
from tests.semantics.scales import scaled

X, Y, Z = (RelationVariable("own", "rate", ROOT, Path.parse(name), 0) for name in "xyz")


class Evaluated(Rational):
    """ℚ over the floats at a state, whose rounding it takes for meant."""

    __slots__ = ()
    decides = False


def rounded(relation: LinearRelation) -> LinearRelation:
    """A relation over ℚ in floats, each coefficient rounded."""
    field = Rounded()
    rows = [field.rounded({v: relation.field.value(n) for v, n in row.items()}) for row in relation.equations]
    return LinearRelation.of(field, relation.variables, rows)


DRAWN = {
    "systems": systems(),
    "rescaled": scaled(systems()),
    "rescaled, in general": scaled(nestings(max_depth=3, max_boxes=2).flatmap(fillings)),
}


# Systems of three levels are large to draw, and are meant here.
@settings(max_examples=settings().max_examples // 2, suppress_health_check=list(HealthCheck))
@given(st.data(), st.integers(0, 2**16))
@pytest.mark.parametrize("strategy", DRAWN)
def test_floats_find_the_relation_that_rational_numbers_find(strategy, data, seed):
    """Equal is: of one dimension, and each equation of one follows from those of the other to the error bounds.

    Where bounds a thousand times as large, or a thousandth, find other dimensions, the two may part.
    """
    system = data.draw(DRAWN[strategy])
    probe = random_probe(system, seed)
    found = system.relation(probe.reference).at(probe.state, probe.ports, efforts=probe.efforts)
    exact = rounded(Instant(found.relation, replace(found.point, field=Evaluated()), found.contradiction).linear)
    same = found.linear.same(exact) and found.dimension == exact.dimension
    assert same or not found.clear
    less = replace(exact, equations=exact.equations[1:])
    assert less.dimension == exact.dimension or less.empty or not found.linear.same(less)


@pytest.mark.parametrize(("apart", "clear"), [(0.0, True), (1.5e-15, False), (1e-9, True)])
def test_constraints_that_are_apart_by_little_more_than_rounding_are_not_clear(apart, clear):
    """Two conditions on velocities, 0 = a + b and 0 = a + (1 + δ) b: one or two."""
    ports = {"p": ephs.quantity.momentum, "p2": ephs.quantity.momentum}
    one, other = (ephs.constraint(ports, np.array([[1.0, entry]])) for entry in (1.0, 1.0 + apart))
    held = ephs.Pattern.from_text("p: momentum, exposed; q: momentum, exposed; a(p, p2=q); b(p, p2=q)")
    system = held(a=one, b=other)
    found = system.relation().at()
    exact = system.relation(field="rational").at()
    assert found.clear == clear and exact.clear
    assert found.linear.same(rounded(exact.linear)) == clear


def test_a_number_within_its_bound_keeps_it():
    """(0.1 + 0.2) x + y + z less 0.3 x + y + z is rounding: the terms stay, with bounds, and none is certain."""
    field = Rounded()
    row = field.rounded({X: 0.1 + 0.2, Y: 1.0, Z: 1.0})
    field.subtract(row, field.one, field.rounded({X: 0.3, Y: 1.0, Z: 1.0}))
    assert set(row) == {X, Y, Z} and field.support(row) == []
    assert row[X][1] >= 2.0 * ROUNDED * 0.3 > abs(0.1 + 0.2 - 0.3)
    assert LinearRelation.of(field, [X, Y, Z], [row]).equations == ()


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_a_bound_is_handed_on(scale):
    """0.3 − (0.1 + 0.2) is no pivot, and what is computed with it is known no better."""
    field = Rounded()
    near = field.number(0.1 + 0.2 - 0.3, 1e-16)
    rows = [{X: field.one, Y: near}, {Y: field.one, Z: field.number(-scale)}]
    found = LinearRelation.of(field, [X, Y, Z], rows)
    held = LinearRelation.of(field, [X, Y, Z], [{X: field.one, Z: field.number(0.5e-16 * scale)}, rows[1]])
    apart = LinearRelation.of(field, [X, Y, Z], [{X: field.one, Z: field.number(1e-15 * scale)}, rows[1]])
    assert held.within(found) and not apart.within(found)


def test_equations_among_variables_that_come_last_are_solved_too():
    """x = y: one of both follows from the other, whichever may stay free."""
    field = Rational()
    found = LinearRelation.of(field, [X, Y], [field.exact({X: 1.0, Y: -1.0})]).solved([X, Y])
    assert sorted(map(len, found.values())) == [1, 1] and found[X] == found[Y]


def test_values_are_those_of_the_variables_that_the_constant_determines():
    """x = 3, y = 0: z has no value."""
    field = Rational()
    rows = [field.exact({X: 2.0, ONE: -6.0}), field.exact({Y: 1.0})]
    assert LinearRelation.of(field, [X, Y, Z, ONE], rows).values() == {X: 3.0, Y: 0.0, ONE: 1.0}


def test_the_constant_is_no_pivot_of_a_canonical_form():
    field = Rational()
    (row,) = LinearRelation.of(field, [X, ONE], [field.exact({X: 2.0, ONE: -6.0})]).canonical
    assert row == {X: 1, ONE: -3}


def test_answers_are_read_as_they_are_meant():
    assert str(Answer(True)) == "yes" and str(Answer(False, ("a", "b"))) == "no; a; b"


def test_the_pivot_is_a_row_in_which_the_variable_is_large():
    small, large = {X: (1e-8, 0.0), Y: (1.0, 0.0)}, {X: (1.0, 0.0), Y: (1.0, 0.0)}
    assert Rounded().pivot([small, large], X) == 1
    assert Rounded().pivot([large, small], X) == 0
