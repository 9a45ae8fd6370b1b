"""The benchmark of stiff rods: its slider comes to the rigid one in proportion to 1/E, and what fails is a row."""

import numpy as np
import pytest

from benchmarks import rigid


@pytest.mark.parametrize(("method", "defect"), [("natural", 1e-13), ("natural4", 1e-13)])
def test_distance_falls_by_what_the_stiffness_grows_by(method, defect):
    """Ten times the modulus leaves a tenth: both rods are stiff, so what is left is linear in 1/E to a tenth."""
    rows = rigid.report(names=[method], moduli=[2e11, 2e12]).rows
    assert rows[0]["error"] / rows[1]["error"] == pytest.approx(10.0, rel=0.1)
    assert max(row["defect"] for row in rows) <= defect


def test_the_rigid_slider_starts_and_ends_where_the_crank_is_upright_and_level():
    start, end = rigid.rigid(np.array([0.0, rigid.UNTIL]))
    assert start == pytest.approx(np.sqrt(0.3**2 - 0.15**2)) and end == pytest.approx(0.45)


def test_what_a_method_refuses_is_a_row():
    row = rigid.measure(2e9, "radau, constant steps")
    assert row["failed"] and "steps" not in row
    assert row["failed"] in rigid.report(names=["radau, constant steps"], moduli=[2e9]).text
