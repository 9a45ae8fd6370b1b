"""The totals of a system at a state are those of a solution there, and of its parts together."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs import library as lib
from ephs.testing import systems
from tests.oscillator import rubbed_oscillator


def test_the_books_at_a_state_are_those_of_a_solution_there():
    system = rubbed_oscillator(2.0, 0.5, 0.3, env=lib.thermal_capacity(c1=300.0, c2=2.0))
    sol = ephs.simulate(system, 1.0, initial={"pe.q": 1.0}, step=0.1)
    for i in range(len(sol)):
        state = {path: values[i] for path, values in sol.states.items()}
        found = system.ledger(state)
        whole = system.ledger.total(state)
        assert math.isclose(
            whole.energy - system.ledger.total({"pe.q": 1.0}).energy, sol.energy[i] - sol.energy[0], abs_tol=1e-9
        )
        assert math.isclose(whole.entropy, sol.entropy[i], abs_tol=1e-12)
        assert math.isclose(whole.exergy, sol.exergy[i], rel_tol=1e-12, abs_tol=1e-9)
        for path, account in found.items():
            assert math.isclose(account.energy, sol.ledgers.storages[path][i], rel_tol=1e-12, abs_tol=1e-12)
    assert list(map(str, system.ledger.producers)) == ["mf"]
    assert set(map(str, system.ledger.storages)) == {"pe", "ke", "env"}
    assert "entropy is made by mf" in str(system.ledger)


@settings(max_examples=30)
@given(st.data())
def test_flattening_changes_no_book(data):
    system = data.draw(systems())
    assert system.flatten().ledger() == system.ledger()
    assert system.ledger.total() == sum(system.ledger().values(), type(system.ledger.total())(0.0, 0.0, 0.0, 0.0))


def test_an_unknown_state_is_refused():
    with pytest.raises(ephs.AssemblyError, match="nobody"):
        rubbed_oscillator().ledger({"nobody": 1.0})
