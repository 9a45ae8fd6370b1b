"""Rates of systems in integral causality: they solve the general equations, and so do their derivatives."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.cells import grid, ladder
from ephs.semantics.descriptor.numbering import spans
from ephs.solve.equations.model import evaluate_at
from ephs.solve.march.control import Proportional
from ephs.solve.methods.continuous import Continuous
from ephs.solve.methods.integral import Integral
from ephs.solve.methods.records import IRREVERSIBLE
from examples import physics
from tests.numerics import EPS, largest, slope
from tests.solve.test_energies import compiled, state

ROUNDING = EPS
SYSTEMS = {"ladder": ladder(4), "grid": grid(9), "motor": physics.motor, "cylinder": physics.cylinder}
OTHERS = {"springs in series": physics.springs, "a rod": physics.masses, "a lever": physics.lever}


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("seed", range(3))
def test_rates_and_all_else_solve_the_general_equations(name, seed):
    model, inputs = compiled(SYSTEMS[name])
    x, own = state(model, seed), Integral.of(model)
    found = own.instant(x, own.guess(x), inputs)
    status, _, memory = evaluate_at(model, x, found.unknowns, 0.0)
    assert status == 0
    assert (np.abs(memory.residual) <= 8 * x.size * ROUNDING * memory.scale).all()
    w = np.random.default_rng(seed).standard_normal((1, x.size))
    assert np.array_equal(own.residuals(x[None], w, inputs[None])[0], w[0] - found.unknowns[: x.size])
    general = Continuous(model).instant(x, found.unknowns, inputs)
    t = model.tables
    makers = np.flatnonzero(t.kind == IRREVERSIBLE)
    ports = spans(t.e_at[makers], t.dims[makers, 0])
    pairs = (found.sums, general.sums), (found.flows[ports], general.flows[ports]), (found.energies, general.energies)
    for one, other in pairs:
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-13 * largest(other, initial=0.0))


@pytest.mark.parametrize("name", SYSTEMS)
def test_derivatives_are_those_of_the_rates(name):
    model, inputs = compiled(SYSTEMS[name])
    x, own = state(model, 7), Integral.of(model)
    found = own.matrices(x, own.guess(x), inputs)
    none = np.zeros((1, x.size))
    for j, unit in enumerate(np.eye(x.size)):
        h = 1e-5 * max(abs(x[j]), 1e-2)
        change = slope(lambda d, unit=unit: own.residuals((x + d * unit)[None], none, inputs[None])[0], h)
        column = found.states.toarray()[:, j]
        assert largest(change - column) <= 1e-6 * max(largest(column), 1.0)
    assert np.array_equal(found.unknowns.toarray(), np.eye(x.size))


@pytest.mark.parametrize("name", OTHERS)
def test_efforts_that_no_storage_has_need_the_general_equations(name):
    model, _ = compiled(OTHERS[name])
    assert Integral.of(model) is None


def test_stages_are_independent():
    model, inputs = compiled(SYSTEMS["motor"])
    own, xs = Integral.of(model), np.array([state(model, seed) for seed in range(3)])
    together = own.residuals(xs, np.zeros_like(xs), np.tile(inputs, (3, 1))).copy()
    alone = [own.residuals(x[None], np.zeros((1, x.size)), inputs[None])[0].copy() for x in xs]
    assert np.array_equal(together, alone)


def test_a_step_that_hardly_grows_is_kept():
    policy = Proportional(SimpleNamespace(exponent=4.0, share=0.0, hold=1.2))
    kept = [policy.judge(1.0, error, 100.0)[1] for error in (0.8, 0.5, 0.35)]
    assert kept == [1.0, 1.0, 1.0]
    assert policy.judge(1.0, 0.1, 100.0)[1] == pytest.approx(0.9 * 0.1**-0.25)
    assert policy.judge(1.0, 0.95, 100.0)[1] < 1.0
    assert policy.judge(1.0, 2.0, 100.0) == (False, pytest.approx(0.9 * 2.0**-0.25))
    assert policy.judge(1.0, 0.1, 100.0)[1] == 1.0  # after a failure
