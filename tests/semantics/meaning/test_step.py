"""Instants and steps solved by a system's own nesting: what is prescribed, and bounds of rounding."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import Pattern, Reference
from ephs import library as lib
from ephs import quantity as Q
from ephs.operad import Path
from ephs.semantics.descriptor.descriptor import Input
from ephs.semantics.meaning.components import largest, process
from ephs.semantics.meaning.fields import ROUNDED, Rounded
from ephs.semantics.meaning.step import part_of, solved
from ephs.semantics.primitives.behaviour import ContinuousBehaviour, NaturalBehaviour
from ephs.semantics.primitives.differences import slope
from ephs.semantics.spaces import manifold
from ephs.semantics.systems.laws import random_probe
from ephs.testing import systems
from tests.numerics import EPS

NOW = ContinuousBehaviour(Reference())


@pytest.mark.parametrize("effort", [False, True])
def test_outer_ports_have_what_is_prescribed(effort):
    """A body that is pushed, and one that is led."""
    body = Pattern.from_text("p: momentum, exposed; a(p)")(a=lib.point_mass(m=2.0))
    given = Input(np.array([0.75 if effort else -3.0]), effort)
    found = solved(body, {Path.of("a.p"): np.array([1.5])}, NOW, {Path.of("p"): given})
    assert found.residual <= 4.0 * EPS
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


def parts_of(system, seed, behaviour):
    """The relations of all components, at the identity where a probe has no state."""
    states, leaves = dict(random_probe(system, seed).state), list(system.leaves())
    names = {path: path for path in states}
    for path, each in leaves:
        for port, described in each.interface.items():
            states.setdefault(path / port, manifold(described.quantity.space).identity())
    return [part_of(each, path, states, names, behaviour) for path, each in leaves]


@settings(max_examples=20)
@given(system=systems(max_depth=2), seed=st.integers(0, 2**16), now=st.booleans())
def test_slopes_of_components_are_those_of_their_results(system, seed, now):
    """Those of structures are exact, of columns all at once; over a step and at an instant."""
    rng = np.random.default_rng(seed)
    for part in parts_of(system, seed, NOW if now else NaturalBehaviour(Reference(293.15, 300.0), 1e-2)):
        at = 0.1 * rng.standard_normal(len(part.arguments))
        found, expected = part.slope(at), slope(part.value, at)
        assert found.shape == (len(part.results), len(part.arguments))
        assert np.abs(found - expected).max(initial=0.0) <= 1e-6 * (1.0 + np.abs(expected).max(initial=0.0))


def chain(count):
    """Masses in a line, with springs to both sides and friction."""
    text, parts = ["s: entropy", "env(s)"], {"env": lib.environment()}
    for i in range(count):
        text += [f"q{i}: displacement", f"p{i}: momentum", f"k{i}(q=q{i})", f"m{i}(p=p{i})", f"d{i}(p=p{i}, s)"]
        text += [f"g{i}(q=q{i}, p=p{i})"] + [f"h{i}(q=q{i}, p=p{i - 1})"] * (i > 0)
        parts |= {f"k{i}": lib.spring(k=1.0 + i), f"m{i}": lib.point_mass(m=1.0), f"d{i}": lib.friction(d=0.1)}
        parts |= {f"g{i}": lib.pkc()} | ({f"h{i}": lib.pkc()} if i else {})
    return Pattern.from_text("; ".join(text))(**parts)


def test_fifty_boxes_are_checked_in_ten_seconds():
    system = chain(10)
    assert len(list(system.leaves())) == 50
    start = time.process_time()
    assert system.check().ok
    assert time.process_time() - start <= 10.0
