"""`ephs linearize` on real models, from the file to the matrices."""

import json

import pytest

import ephs
from tests.scenes import ROOT
from tests.typed import typed

LOOP = str(ROOT / "scenes/four-bar.toml")


def test_the_summary_names_states_and_modes_and_the_file_has_the_matrices(tmp_path, capsys):
    file = tmp_path / "four-bar.json"
    assert typed(f"linearize {LOOP} --at equilibrium -o {file}") == 0
    printed = capsys.readouterr().out
    assert "structure: ẋ = (J − R) Q x + B u" in printed and "damping" in printed and str(file) in printed
    data = json.loads(file.read_text())
    expected = ephs.linearize(ephs.load(LOOP), "equilibrium")
    assert data["A"] == expected.A.tolist() and data["states"] == list(expected.states)
    assert data["modes"][0]["frequency"] == expected.modes[0].frequency


def test_a_time_is_run_to_first(tmp_path):
    file = tmp_path / "four-bar.json"
    words = f"--at 0.2 --input joints.main --output-of joints.knee.coordinate -o {file}"
    assert typed(f"linearize {LOOP} {words}") == 0
    data = json.loads(file.read_text())
    scene = ephs.load(LOOP)
    there = scene.at(ephs.simulate(scene, 0.2, save_at=[0.2]), 0.2)
    expected = ephs.linearize(there, inputs=["joints.main"], outputs=["joints.knee.coordinate"])
    assert data["A"] == expected.A.tolist() and data["C"] == expected.C.tolist()


def test_systems_have_ports(capsys):
    model = f"{ROOT}/examples/physics.py:motor"
    assert typed(f"linearize {model} --input q=effort:1.0") == 0
    assert "rotor.mass.p" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "what"),
    [("--at soon",) * 2, ("--input joints.man", "joints.main"), ("-o a.mat", ".json, .npz, .nc"), ("--at -1",) * 2],
)
def test_bad_words_are_told(words, what, capsys):
    assert typed(f"linearize {LOOP} {words}") == 2
    assert what in capsys.readouterr().err


def test_no_equilibrium_is_told(capsys):
    assert typed(f"linearize {ROOT}/scenes/slider-crank.toml --at equilibrium") == 2
    assert "constant drive of bearing" in capsys.readouterr().err
