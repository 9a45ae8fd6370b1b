"""`ephs info`, `ephs plot` and `--no-report`."""

import re
from pathlib import Path

import numpy as np
import pytest

import ephs
from ephs.mechanics.sweep.outputs import known_outputs
from ephs.show.plots.chosen import plot_signals
from tests.scenes import ROOT
from tests.typed import typed

CRANK = str(ROOT / "scenes/slider-crank.toml")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("out")
    assert typed(f"run {CRANK} --until 0.2 --no-report --out {made}") == 0
    return made


def test_no_report_writes_everything_else(folder):
    assert {path.name for path in folder.iterdir()} == {"solution.nc", "summary.json", "run.json"}


def test_info_names_everything_that_the_scene_names(capsys):
    assert typed(f"info {CRANK}") == 0
    said = capsys.readouterr().out
    scene = ephs.load(CRANK)
    for name in [*scene.bodies, *scene.joints, *scene.thermal]:
        assert name in said
    assert "degrees of freedom 1;" in said
    assert len(said.splitlines()) <= 24


def test_info_lists_states_of_a_system(capsys):
    assert typed(f"info {ROOT}/examples/oscillator.py:damped_oscillator") == 0
    said = capsys.readouterr().out
    assert all(path in said for path in ("osc.pe.q", "osc.ke.p", "env.s", "kg m/s"))


def test_plot_lists_every_signal_and_each_can_be_plotted(folder, capsys):
    assert typed(f"plot {folder}") == 0
    said = capsys.readouterr().out
    sol = ephs.load_solution(folder / "solution.nc")
    for name in known_outputs(sol.scene):
        assert name.rpartition(".")[2] in said
        (axes, *_) = plot_signals(sol, name).axes
        assert len(axes.lines) >= 1


def test_plotted_values_are_those_of_the_solution(folder):
    sol = ephs.load_solution(folder / "solution.nc")
    figure = sol.plot("signals", "joints.bearing", "joints.bearing.rate", "bodies.rod.position.z")
    shown = [axes.lines[0].get_ydata() for axes in figure.axes]
    wanted = [sol.joint("bearing").coordinate, sol.joint("bearing").rate, sol.body("rod").position[:, 2]]
    for one, other in zip(shown, wanted, strict=True):
        assert np.array_equal(one, np.ravel(other))


@pytest.mark.parametrize(("wrong", "near"), [("joints.bering.rate", "joints.bearing.rate"), ("enrgy", "energy")])
def test_plot_suggests_signals_of_the_same_kind(folder, capsys, wrong, near):
    assert typed(f"plot {folder} {wrong}") == 2
    assert near in capsys.readouterr().err


def test_suggestions_for_a_joint_are_joints(folder, capsys):
    assert typed(f"plot {folder} joints.rod.position") == 2
    assert "bodies." not in capsys.readouterr().err


@pytest.mark.parametrize("name", ["", ":", ":dam"])
def test_a_python_file_without_a_name_tells_its_models(capsys, name):
    assert typed(f"info {ROOT}/examples/oscillator.py{name}") == 2
    assert "free_oscillator, damped_oscillator" in capsys.readouterr().err


def test_info_says_none_of_fixed_joints_and_zero_of_rounding(capsys):
    assert typed(f"info {ROOT}/examples/arm.urdf") == 0
    said = capsys.readouterr().out
    (fixed,) = (line for line in said.splitlines() if " fixed " in line)
    assert fixed.endswith("none")
    assert "e-" not in said


def test_plot_takes_a_saved_solution(folder, tmp_path, capsys):
    assert typed(f"plot {folder}") == 0
    listed = capsys.readouterr().out
    saved = tmp_path / "crank.nc"
    saved.write_bytes((folder / "solution.nc").read_bytes())
    assert typed(f"plot {saved}") == 0
    assert capsys.readouterr().out == listed
    assert typed(f"plot {saved} energy") == 0
    assert (tmp_path / "signals.svg").is_file()


@pytest.mark.parametrize(
    ("options", "near"),
    [
        ({"inputs": {"joints.bearng": 1.0}}, "joints.bearing"),
        ({"initial": {"body.rod.ke.p": 1.0}}, "bodies.rod.ke.p"),
    ],
)
def test_misspelled_inputs_and_states_are_answered_with_the_nearest(options, near):
    with pytest.raises(ephs.AssemblyError, match=f"did you mean '{near}'"):
        ephs.simulate(ephs.load(CRANK), 0.1, **options)


def test_a_run_that_fails_at_its_start_suggests_no_films(tmp_path, capsys):
    text = (ROOT / "examples/arm.urdf").read_text()
    arm = str(tmp_path / "massless-base.urdf")
    Path(arm).write_text(re.sub(r"<inertial>.*?</inertial>", "", text, count=1, flags=re.DOTALL))
    assert typed(f"run {arm} --base free --until 0.1 --out {tmp_path}") == 3
    said = capsys.readouterr()
    assert "root_joint" in said.err
    assert "next:" not in said.out


@pytest.mark.parametrize("options", [{"inputs": [1.0]}, {"initial": "bodies.rod"}, {"inputs": 3}])
def test_inputs_and_states_without_names_are_refused(options):
    (key,) = options
    with pytest.raises(ephs.OptionError, match=rf"{key} is .*, expected names with values, as in {key}=\{{"):
        ephs.simulate(ephs.load(CRANK), 0.1, **options)


def test_a_model_in_place_of_results_is_answered_with_the_run_to_make(capsys):
    for words in (f"animate {CRANK} -o page.html", f"plot {CRANK} energy"):
        assert typed(words) == 2
        said = " ".join(capsys.readouterr().err.split())
        assert "found a model, expected a result folder of ephs run" in said and f"first: ephs run {CRANK}" in said


def test_broken_syntax_has_line_column_and_text(tmp_path, capsys):
    file = tmp_path / "scene.toml"
    file.write_text("format = 1\n[bodies.a]\nmass = 1.8 kg\n")
    assert typed(f"check {file}") == 2
    said = capsys.readouterr().err
    assert 'line 3, column 12: found "mass = 1.8 kg"' in said and "units" in said
