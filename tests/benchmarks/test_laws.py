"""The table of both laws by methods: the kinds of systems that other tests of the laws leave out, and a control."""

import pytest

from benchmarks import laws
from ephs.mechanics.methods.registry import METHODS

CELLS = {cell.words: cell for cell in laws.CELLS}
ROUNDING = 1e-13
"""Of sums of energies relative to the gross ones: ten times the rounding of a hundred steps."""


@pytest.mark.parametrize("cell", ["motor", "LC", "RLC", "fluid", "gases"])
@pytest.mark.parametrize("name", [name for name in laws.METHODS if name != "variational"])
def test_circuits_fluids_and_gases_keep_both_laws(name, cell):
    row = laws.measure(CELLS[cell], laws.METHODS[name])
    if name == "semi" and cell != "motor":
        assert row["failed"] == "–"
        return
    assert not row["failed"]
    assert row["defect"] <= ROUNDING
    assert row["least"] >= 0.0


def test_what_a_method_does_not_keep_is_seen():
    row = laws.measure(CELLS["drive"], laws.METHODS["variational"])
    assert row["defect"] > 1e6 * ROUNDING
    text = laws.report([CELLS["tree"]], ["natural", "variational"]).text
    assert text.count("\n") == 3 and "| natural | " in text


def test_every_method_is_in_the_table():
    assert {asked.method for asked in laws.METHODS.values()} == {"auto", *METHODS}
