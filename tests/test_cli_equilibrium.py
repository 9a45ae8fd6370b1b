"""`ephs equilibrium`: a file's rod at rest under its load, and what has no rest."""

import json

import pytest

import ephs
from tests.typed import typed

ROD = """format = 1
[world]
gravity = [0.0, 0.0, 0.0]
[beams.rod]
from = [0.0, 0.0, 0.0]
to = [1.0, 0.0, 0.0]
elements = 4
section = { circle = 0.01, E = 2.1e9, nu = 0.4, rho = 1200.0 }
ends = ["ground"]
[loads.tip]
body = "rod.4"
force = [-60.0, 0.0, 0.0]
"""


def test_the_shape_at_rest_is_printed_and_written(tmp_path, capsys):
    file = tmp_path / "rod.toml"
    file.write_text(ROD, encoding="utf-8")
    assert typed(f"equilibrium {file} --out {tmp_path / 'out'}") == 0
    printed = capsys.readouterr().out
    data = json.loads((tmp_path / "out" / "equilibrium.json").read_text())
    expected = ephs.equilibrium(ephs.load(file))
    assert data["bodies"]["rod.4"]["position"] == expected.model.body("rod.4").pose[4:].tolist()
    assert data["critical"] == list(expected.critical) and "critical at these parts" in printed
    assert data["shares"][-1] == 1.0 and "rod.4" in printed


@pytest.mark.parametrize("found", ["missing.toml", "examples/oscillator.py:damped_oscillator"])
def test_what_is_no_scene_is_bad_input(found):
    assert typed(f"equilibrium {found}") == 2
