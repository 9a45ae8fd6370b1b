"""What composites inherit from their parts, on generated systems: the functor, the balances, naturality."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ephs.operad import Path, Pattern, junction, quantity
from ephs.semantics import System, library
from ephs.semantics.meaning import relation_of_pattern
from ephs.semantics.meaning.fields import Rational
from ephs.semantics.meaning.functor import is_dirac
from ephs.semantics.meaning.step import step
from ephs.semantics.primitives import structures
from ephs.semantics.systems.laws import SYSTEM_LAWS, random_probe
from ephs.testing import (
    check_entropy_production,
    check_functoriality,
    check_natural,
    check_power_balance,
    fillings,
    nestings,
    patterns,
    systems,
)
from tests.numerics import largest

# A system holds many draws; what is slow is the plain solver, which is the point.
# Relations of whole hierarchies are composed and compared: what Hypothesis deems slow and large is meant here.
patient = settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
few = settings(patient, max_examples=10)
seeds = st.integers(0, 2**16)


@patient
@given(systems(), seeds)
def test_flatten_then_fill_is_fill_then_compose(system, seed):
    check_functoriality(system, seed=seed)


@pytest.mark.parametrize(
    "drawn",
    [nestings(max_depth=3).flatmap(fillings), systems(posed=False)],
    ids=["any filling of any nesting", "states stored twice or by nobody"],
)
@patient
@given(st.data(), seeds)
def test_also_where_there_is_no_motion(drawn, data, seed):
    """Any filling of any nesting of patterns has a relation, and both routes lead to it."""
    check_functoriality(data.draw(drawn), seed=seed)


def test_a_constraint_that_cancels_on_a_junction_is_no_equation():
    """Constraint 0 = (0.1 + 0.2) e₁ − 0.3 e₂ of two ports on one junction: what rounding leaves holds no effort."""
    interface = library.power_ports(p0=quantity.momentum, p1=quantity.momentum)
    row = structures.constant_structure("row", interface, np.zeros((2, 2)), np.array([[0.1 + 0.2, -0.3]]))
    pattern = Pattern.from_text("j: momentum, exposed; row(p0=j, p1=j)")
    system = System(pattern, {Path.of("row"): row})
    probe = random_probe(system, 0)
    for route in ("flat", "nested"):
        relation = system.relation(probe.reference, route=route).at(probe.state, probe.ports)
        assert relation.dimension == 2  # any effort at no flow, and the constant coordinate
    check_functoriality(system)


@settings(patient, max_examples=8)
@given(st.lists(st.floats(0.1, 1.0), min_size=1, max_size=3), st.integers(-60, 60))
def test_the_size_of_a_row_means_nothing(entries, power):
    """Also one of rounding alone, 0.1 + 0.2 − 0.3: its relation is Lagrangian, and the same at any size."""
    n = len(entries)
    ports = {f"p{i}": quantity.momentum for i in range(n)}
    pattern = Pattern(
        junctions={name: junction(each, exposed=True) for name, each in ports.items()},
        boxes={"row": {name: name for name in ports}},
    )
    found = []
    for size in (1.0, 2.0**power):
        skew = np.zeros((n, n))
        row = structures.constant_structure("row", library.power_ports(**ports), skew, size * np.array([entries]))
        system = System(pattern, {Path.of("row"): row})
        probe = random_probe(system, 0)
        for route in ("flat", "nested"):
            found.append(system.relation(probe.reference, route=route).at(probe.state, probe.ports))
        assert all(law(probe).holds for law in SYSTEM_LAWS)
    assert {relation.dimension for relation in found} == {n + 1}
    assert all(found[0].same(other) for other in found[1:])


@patient
@given(systems(isolated=True), seeds)
def test_isolated_systems_are_told_apart_by_their_rates(system, seed):
    probe = random_probe(system, seed)
    relation = system.relation(probe.reference).at(probe.state, probe.ports, efforts=probe.efforts)
    assert relation.ports == ()
    assert [path for path, _ in relation.rates] == sorted(system.states)


@given(patterns())
def test_a_pattern_conserves_power_and_has_half_dimension(pattern):
    relation = relation_of_pattern(Rational(), pattern)
    assert 2 * relation.dimension == len(relation.variables)
    assert is_dirac(relation)


@few
@given(systems(max_depth=2, max_junctions=2), seeds)
def test_energy_is_balanced_over_a_step(system, seed):
    check_power_balance(system, seed=seed)


@few
@given(systems(max_depth=2, max_junctions=2), seeds)
def test_entropy_is_balanced_and_never_destroyed(system, seed):
    check_entropy_production(system, seed=seed, trials=20)


@settings(patient, max_examples=6)
@given(systems(max_depth=2, max_junctions=2, groups=False), seeds)
def test_a_step_of_the_nested_system_is_the_step_of_the_flat_one(system, seed):
    check_natural(system, seed=seed)


def test_drawn_systems_move_and_dissipate():
    """The laws of steps would be empty words if few systems took one, or if in few of them something happened."""
    steps, motions, heats = [], [], []

    @settings(patient, max_examples=100, derandomize=True, database=None)
    @given(systems(max_depth=2), seeds)
    def collect(system, seed):
        probe = random_probe(system, seed)
        _, solved = step(system, probe.state, probe.h, probe.reference, probe.inputs)
        steps.append(solved.residual < 1e-9)
        motions.append(sum(largest(rate) > 1e-9 for rate in solved.rates.values()) >= 3)
        entropies = [path for path, of in system.states.items() if of.kind == "entropy"]
        heats.append(sum(float(solved.rates[path][0]) for path in entropies) > 1e-12)

    collect()
    assert np.mean(steps) > 0.9
    assert np.mean(motions) > 0.2
    assert np.mean(heats) > 0.15
