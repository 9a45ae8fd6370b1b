"""Instants and steps solved by a system's own nesting: what is prescribed, and bounds of rounding."""

import numpy as np
import pytest

import ephs
from ephs import Pattern, Reference
from ephs import library as lib
from ephs import quantity as Q
from ephs.operad import Path
from ephs.semantics.descriptor.descriptor import Input
from ephs.semantics.meaning.components import largest, process
from ephs.semantics.meaning.fields import ROUNDED, Rounded
from ephs.semantics.meaning.step import solved
from ephs.semantics.primitives.behaviour import Continuous

NOW = Continuous(Reference())


@pytest.mark.parametrize("effort", [False, True])
def test_outer_ports_have_what_is_prescribed(effort):
    """A body that is pushed, and one that is led."""
    body = Pattern.from_text("p: momentum, exposed; a(p)")(a=lib.point_mass(m=2.0))
    given = Input(np.array([0.75 if effort else -3.0]), effort)
    found = solved(body, {Path.of("a.p"): np.array([1.5])}, NOW, {Path.of("p"): given})
    assert found.residual <= 4.0 * np.finfo(float).eps
    flow, speed = found.outer[Path.of("p")]
    assert (speed if effort else flow) == pytest.approx(given.value, rel=1e-14)
    assert speed == pytest.approx(0.75, rel=1e-14)
    if not effort:
        assert abs(found.rates[Path.of("a.p")][0]) == pytest.approx(3.0, rel=1e-14)


def test_the_bound_of_rounding_is_that_of_the_least_exact_rate():
    """Two bodies on springs that pull with 0.3 N and 3e7 N."""
    text = "x: displacement; p: momentum; s(q=x); g(q=x, p); m(p)"
    parts = [Pattern.from_text(text)(s=lib.spring(k=k), g=lib.pkc(), m=lib.point_mass(m=1.0)) for k in (3.0, 3e8)]
    both = Pattern.from_text("one(); two()")(one=parts[0], two=parts[1])
    state = {Path.of(f"{box}.{port}"): np.array([0.1]) for box in ("one", "two") for port in ("s.q", "m.p")}
    found = solved(both, state, NOW)
    assert found.rates[Path.of("two.m.p")] == pytest.approx(-3e7, rel=1e-15)
    assert 3e7 * ROUNDED <= found.rounding <= 1e3 * 3e7 * ROUNDED


def test_numbers_are_rounded_beside_the_largest_of_their_units():
    """Of both their units: 1 beside 1e6 in another row and another column; beside 1e9 of other units it is itself."""
    matrix = np.zeros((3, 3))
    matrix[0, 1], matrix[1, 0], matrix[0, 2], matrix[2, 0], matrix[1, 1] = 1.0, -1.0, 1e9, -1e9, 1e6
    bundle = ephs.irreversible(
        {"p": Q.momentum, "r": Q.momentum, "s": Q.entropy}, lambda **_: np.zeros((3, 3)), name="none"
    ).bundle
    found = process(Rounded(), bundle, matrix, np.zeros((0, 3)))
    errors = {
        (str(result.port), str(key.port)): bound
        for row in found.equations
        for result in (key for key in row if key.kind == "flow")
        for key, (_, bound) in row.items()
        if key.kind == "effort"
    }
    assert errors["p", "r"] == pytest.approx(1e6 * ROUNDED)
    assert errors["r", "p"] == pytest.approx(1e6 * ROUNDED)
    assert errors["p", "s"] == pytest.approx(1e9 * ROUNDED)
    assert largest(bundle, np.array([1.0, -3.0, 7.0])).tolist() == [3.0, 3.0, 7.0]
