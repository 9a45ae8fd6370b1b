"""What elements without a formula state of themselves: no state or effort contradicts it; constants are decided."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ephs import quantity as Q
from ephs.operad import Quantity, Space
from ephs.semantics import StructureError
from ephs.semantics.library import power_ports
from ephs.semantics.primitives import structures
from ephs.semantics.verdicts.verdict import examine
from tests.scenes import shipped


def stating():
    """Elements of scenes by name, whose conditions are stated."""
    found = {}
    for name in ("slider-crank", "motor-four-bar", "body", "n-four-bar", "screw-press"):
        for _, part in shipped(name).system().leaves():
            if part.kind != "environment" and any(c.how[0] == "stated" for c in part.verdict.conditions):
                found.setdefault(part.name, part)
    return found


def test_nothing_contradicts_what_elements_state():
    """The search that parts without a statement go through, at hundreds of states each."""
    found = stating()
    assert {"kinetic", "gravity", "holonomic", "joint_friction"} <= set(found)
    for name, part in found.items():
        assert examine(replace(part, proof=None)) == "searched", name


def test_a_false_statement_is_contradicted():
    part = stating()["gravity"]
    wrong = replace(part, proof=None, gradient=lambda x: 1.0001 * part.gradient(x), kernel=None)
    with pytest.raises(StructureError, match="gradient"):
        examine(wrong)


def damper(mu):
    space = Quantity("momentum", Space("real", len(mu), len(mu)), -1)
    return structures.dissipation("damper", power_ports(p=space, s=Q.entropy), np.array(mu))


@settings(max_examples=20)
@given(st.lists(st.lists(st.integers(-9, 9), min_size=3, max_size=3), min_size=1, max_size=3), st.data())
def test_friction_by_a_matrix_is_proved_if_it_is_not_negative(rows, data):
    """Of any rank, of any units, decided by elimination over ℚ; one digit less is not proved."""
    scale = np.diag([2.0 ** data.draw(st.integers(-30, 30)) for _ in range(3)])
    a = np.array(rows, dtype=float) @ scale
    mu = a.T @ a  # of whole numbers and powers of two: exact
    assert damper(mu).verdict == "proved"
    assume(np.linalg.matrix_rank(np.array(rows)) < 3 and all(np.diag(mu) > 0.0))
    less = mu.copy()
    less[0, 0] = np.nextafter(less[0, 0], 0.0)
    kept = np.linalg.matrix_rank(np.array(rows)[:, 1:])
    assume(np.linalg.matrix_rank(np.array(rows)) == kept)  # the first column depends on the others
    assert not structures.dissipation_proof(damper(mu).interface, less)[1].proved
