"""The cases of the quick set do what they are there for. Nothing is timed here."""

import pytest

from benchmarks.quick_cases import CASES, OTHERS, RUNS
from ephs.mechanics.methods.registry import METHODS


@pytest.mark.parametrize("name", CASES)
def test_a_case_runs(name):
    CASES[name]()()


def test_every_method_and_every_peer_is_among_them():
    assert {f"step a window by {name}" for name in METHODS} <= set(CASES)
    assert {name for name, method in METHODS.items() if method.fixed} == set(RUNS)
    assert {name.partition(":")[0] for name in OTHERS} == {"python", "numpy", "pin", "mujoco"}
