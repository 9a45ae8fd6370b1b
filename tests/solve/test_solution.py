"""Solutions: their ledgers, their summary, and their files."""

import numpy as np
import pytest

import ephs

START = {"osc.pe.q": 1.0}


@pytest.fixture
def solution(damped):
    return ephs.simulate(damped, 2.0, initial=START, step=0.01)


def test_a_ledger_of_a_part_and_of_a_subsystem(solution):
    q, p = solution["osc.pe.q"], solution["osc.ke.p"]
    assert np.allclose(solution.ledger("osc.pe").energy, 0.75 * q**2, rtol=1e-14)
    assert np.allclose(solution.ledger("osc").energy, 0.75 * q**2 + 0.5 * p**2, rtol=1e-14)
    assert np.allclose(solution.ledger("mf").made, solution["env.s"], rtol=1e-12)
    with pytest.raises(KeyError, match=r"nowhere.*osc\.pe"):
        solution.ledger("nowhere")


def test_what_is_not_there_is_named(solution):
    with pytest.raises(TypeError, match="not a scene"):
        solution.body("crank")


def test_whether_a_state_is_there_is_told_by_its_name_as_by_its_path(damped, solution):
    for path in solution:
        assert path in solution and str(path) in solution and solution[str(path)] is solution[path]
    assert "osc.q" not in solution and "no.such" not in solution and "a..b" not in solution
    derivatives = ephs.sensitivity(damped, ["mf.d"], 0.01, initial=START)
    assert "osc.pe.q" in derivatives and "heat" in derivatives and "osc.q" not in derivatives


def test_a_file_that_is_no_solution_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nothing\.nc"):
        ephs.load_solution(tmp_path / "nothing.nc")
    other = tmp_path / "other.nc"
    other.write_text("text")
    with pytest.raises(ValueError, match=r"other\.nc"):
        ephs.load_solution(other)
