"""The relation of a system, by either route, is what one stack of all equations says."""

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, find, given, settings
from hypothesis import strategies as st

from ephs.operad import Directory, PortType
from ephs.semantics import Irreversible, Reference
from ephs.semantics.bundles.bundle import Bundle
from ephs.semantics.verdicts.checks import random_point
from ephs.testing import fillings, nestings, systems
from tests.broken import put_in_place
from tests.semantics.stacked import components_of, equations_of, path_of, stacked, states_of
from tests.semantics.subspace import Subspace

REFERENCE = Reference(293.15, 300.0)
PROJECTOR = 1e-13
"""Difference of the projectors on two subspaces that are one, times the condition of what computed them."""
APART = 1e-6
"""The same at most, whatever the condition: subspaces of other relations differ by a tenth and more."""
patient = settings(suppress_health_check=list(HealthCheck), max_examples=30)
DRAWN = {
    "systems": systems(),
    "fillings": nestings(max_depth=4, max_boxes=2).flatmap(fillings),
}


def drawn_point(system, rng):
    """A value for each state, by all ports that have it, and by one of them: of a component, else an outer one."""
    parts, values, state, ports = dict(components_of(system)), {}, {}, {}
    for group in states_of(system):
        inner = sorted((boxes, port) for boxes, port in group if boxes and port in parts[boxes].reads)
        nodes = inner or sorted(node for node in group if not node[0])
        if nodes:
            boxes, port = nodes[rng.integers(len(nodes))]
            whole = parts[boxes] if boxes else system
            layout = Bundle.of(Directory({port: PortType(whole.interface[port].quantity)}))
            value = random_point(layout, layout.ports, rng)[port]
            values |= dict.fromkeys(group, value)
            (state if inner else ports)[path_of(boxes, port)] = value
    return values, state, ports


def drawn_efforts(system, rng):
    """Arguments of the Onsager matrices, by component's boxes."""
    found = {}
    for boxes, part in components_of(system):
        if isinstance(part, Irreversible):
            size = part.bundle.size
            hot = part.bundle.indicator("entropy") == 1.0
            found[boxes] = np.where(hot, rng.uniform(-30.0, 30.0, size), rng.standard_normal(size))
    return found


def check_stacked(system, seed, *routes):
    rng = np.random.default_rng(seed)
    values, state, ports = drawn_point(system, rng)
    efforts = drawn_efforts(system, rng)
    by_path = {path_of(boxes): e for boxes, e in efforts.items()}
    for route in routes:
        found = system.relation(REFERENCE, route=route).at(state, ports, efforts=by_path)
        basis, condition = stacked(system, lambda *node: values[node], efforts=efforts, reference=REFERENCE)
        assert found.dimension == basis.shape[1], route
        rates = sorted((path, of.space.dim) for path, of in system.states.items())
        kept = [path in dict(found.rates) for path, dim in rates for _ in range(dim)]
        kept += [True] * (len(basis) - len(kept))
        # of storages of one state the oracle has the rate of each
        apart = np.abs(found.projector - Subspace.from_span(basis[kept], 1.0).projector)
        assert apart.max(initial=0.0) <= min(APART, PROJECTOR * max(10.0, condition)), route


@pytest.mark.parametrize("strategy", DRAWN)
@patient
@given(st.data(), st.integers(0, 2**16))
def test_both_routes_give_the_relation_of_the_stack(strategy, data, seed):
    system = data.draw(DRAWN[strategy])
    check_stacked(system, seed, "nested", "flat")


SPOILED = {
    "efforts of three ports are joined at two": (
        equations_of,
        "pairwise(ports + outer)",
        "pairwise((ports + outer)[:2])",
    ),
    "the outer flow has the sign of inner ones": (equations_of, "-1.0 for p in outer}", "1.0 for p in outer}"),
    "a second flow counts twice": (equations_of, "1.0 for p in ports}", "1.0 + (p in ports[1:2]) for p in ports}"),
    "an open outer port passes a flow": (equations_of, "-1.0 for p in outer}", "-1.0 for p in outer if ports}"),
    "a closed port passes a flow": (equations_of, "1.0 for p in ports}", "1.0 for p in ports if outer or ports[1:]}"),
    "a link joins two states": (states_of, "for path in group)", "for path in sorted(group)[:2])"),
    "a state shown at three ports is one at two": (
        states_of,
        "if junction.exposed:",
        "if path in sorted(level.interface)[:2]:",
    ),
    "state ports do not show the state": (states_of, "if junction.exposed:", "if junction.exposed and junction.power:"),
}
"""Rules of the stack, as text that is replaced: what a relation would be that misunderstands them."""


@pytest.mark.parametrize("rule", SPOILED)
def test_draws_tell_each_rule_from_a_wrong_one(rule, monkeypatch):
    put_in_place(monkeypatch, *SPOILED[rule])

    def differs(drawn):
        try:
            check_stacked(*drawn, "nested")
        except AssertionError:
            return True
        return False

    limits = settings(patient, max_examples=200, database=None, phases=[Phase.generate])
    found = [st.tuples(strategy, st.integers(0, 2**16)) for strategy in DRAWN.values()]
    assert find(st.one_of(found), differs, settings=limits)
