"""The commands on real models, from the file to the result folder."""

import json
import math
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import ephs
from ephs.solve.running.journal import _FRAME, Journal
from tests.scenes import ROOT
from tests.typed import typed

SPINNING = """format = 1
[bodies.top]
mass = 1.0
inertia = [1.0, 1.0, 1.0]
position = [0.0, 0.0, 1.0]
velocity = [100.0, 0.0, 0.0]
angular_velocity = [0.0, 100.0, 0.0]
[joints.ball]
type = "spherical"
bodies = ["ground", "top"]
at = [0.0, 0.0, 0.0]
"""


def test_run_writes_the_result_folder(tmp_path, capsys):
    assert typed(f"run {ROOT}/scenes/slider-crank.toml --until 0.2 --out {tmp_path}") == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["scene"] == "slider-crank"
    assert summary["method"] == "rk87"
    assert summary["t_end"] == 0.2
    assert summary["mobility"] == 1
    assert set(summary["bodies"]) == {"crank", "rod", "slider"}
    assert summary["thermal"]["housing"]["temperature"] > 293.15
    assert summary["max_energy_error"] < 1e-6  # the tolerance where none is given
    for key in ("max_constraint_error", "max_velocity_error"):
        assert summary[key] < 1e-10
    solution = ephs.load_solution(tmp_path / "solution.nc")
    assert solution.body("rod").position[-1].tolist() == summary["bodies"]["rod"]["position"]
    page = (tmp_path / "report.html").read_text()
    assert "slider-crank" in page
    assert str(tmp_path / "report.html") in capsys.readouterr().out


@pytest.mark.parametrize("name", ["free_oscillator", "damped_oscillator"])
def test_run_takes_a_system_of_ones_own(tmp_path, name):
    model = f"{ROOT}/examples/oscillator.py:{name}"
    options = "--until 1 --step 0.01 --initial osc.pe.q=1.0 --initial osc.ke.p=0.5"
    assert typed(f"run {model} {options} --out {tmp_path}") == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["steps"] == 100
    assert {"osc.pe.q", "osc.ke.p"} <= set(summary["states"])
    assert (summary["heat"] > 0.0) == (name == "damped_oscillator")
    solution = ephs.load_solution(tmp_path / "solution.nc")
    assert (solution["osc.pe.q"][0], solution["osc.ke.p"][0]) == (1.0, 0.5)


def test_systems_of_files_begin_as_their_components_say(tmp_path):
    """x(t) = 0.7 cos t + 0.2 sin t for k = m = 1, with nothing given on the command line but one of the two."""
    file = tmp_path / "mine.py"
    file.write_text(
        "import ephs\nfrom ephs import library as lib\n"
        "pattern = ephs.Pattern.from_text('q: displacement; p: momentum; spring(q); mass(p); pkc(q, p)')\n"
        "start = pattern(spring=lib.spring(k=1.0).with_initial({'q': 0.7}), mass=lib.point_mass(m=1.0)"
        ".with_initial({'p': 0.2}), pkc=lib.pkc())\n"
    )
    run = f"run {file}:start --until 1 --rtol 1e-9 --atol 1e-9 --no-report --out"
    for words, start in (("", (0.7, 0.2)), ("--initial spring.q=-1", (-1.0, 0.2))):
        folder = tmp_path / f"out{len(words)}"
        assert typed(f"{run} {folder} {words}") == 0
        sol = ephs.load_solution(folder / "solution.nc")
        assert (sol["spring.q"][0], sol["mass.p"][0]) == start
        assert sol["spring.q"][-1] == pytest.approx(start[0] * math.cos(1.0) + start[1] * math.sin(1.0), abs=1e-7)


@pytest.mark.parametrize(
    ("initial", "words"), [("osc.pe.q", "PATH=NUMBER"), ("osc.q=1", "osc.pe.q"), ("osc.pe.q=1,2", "(1,)")]
)
def test_bad_initial_values_are_told(tmp_path, capsys, initial, words):
    model = f"{ROOT}/examples/oscillator.py:free_oscillator"
    assert typed(f"run {model} --until 1 --initial {initial} --out {tmp_path}") == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("scene", sorted((ROOT / "scenes").glob("*.toml")), ids=lambda path: path.stem)
def test_check_holds_of_the_shipped_scenes(scene, capsys):
    assert typed(f"check {scene}") == 0
    said = capsys.readouterr().out
    assert "FAILS" not in said
    assert "mobility" in said


@pytest.mark.parametrize("suffix", [".svg", ".tex", ".png"])
def test_draw_writes_the_pattern(tmp_path, suffix):
    file = tmp_path / f"pattern{suffix}"
    assert typed(f"draw {ROOT}/scenes/mbs.toml --flat -o {file}") == 0
    assert file.stat().st_size > 1000


def test_bad_scenes_are_told_all_their_faults(tmp_path, capsys):
    scene = tmp_path / "bad.toml"
    scene.write_text(SPINNING.replace("mass = 1.0", "mass = -1.0\nmas = 2.0").replace('"ground"', '"sky"'))
    assert typed(f"run {scene} --until 1") == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    assert all(word in said for word in (str(scene), "bodies.top.mass", "bodies.top.mas", "sky"))


def test_animate_makes_a_page_of_a_result_folder(tmp_path, capsys):
    folder, page = tmp_path / "out", tmp_path / "pages" / "film.html"
    assert typed(f"run {ROOT}/scenes/slider-crank.toml --until 0.1 --out {folder}") == 0
    capsys.readouterr()
    assert typed(f"animate {folder} -o {page} --wrenches --colour temperature --fps 10") == 0
    assert capsys.readouterr().out.strip() == str(page)
    text = page.read_text(encoding="utf-8")
    assert "<title>slider-crank</title>" in text and "force on body 2" in text


@pytest.mark.parametrize(
    ("folder", "page", "words"),
    [
        ("nowhere", "film.html", "no solution.nc in it"),
        ("broken", "film.html", "not a netCDF file"),
        ("circuit", "film.html", "found no bodies"),
        ("circuit", "film.pdf", "expected one of .html"),
    ],
)
def test_animate_refuses_what_it_cannot_show(tmp_path, capsys, folder, page, words):
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "solution.nc").write_text("text")
    model = f"{ROOT}/examples/oscillator.py:free_oscillator"
    assert typed(f"run {model} --until 0.1 --step 0.1 --out {tmp_path / 'circuit'}") == 0
    capsys.readouterr()
    assert typed(f"animate {tmp_path / folder} -o {tmp_path / page}") == 2
    said = capsys.readouterr().err
    assert words in said and "Traceback" not in said


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_run_is_readable_and_goes_on_to_the_undisturbed_numbers(tmp_path, capsys, how):
    scene, folder = ROOT / "scenes/slider-crank.toml", tmp_path / "out"
    words = f"run {scene} --until 2 --method natural --step 1e-4 --keep 160 --out"
    journal = folder / "run.journal"
    listening = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "  # also in background
    command = [sys.executable, "-c", f"{listening}from ephs.cli import main; sys.exit(main(sys.argv[1:]))"]
    process = subprocess.Popen([*command, *words.split(), folder], stderr=subprocess.PIPE, text=True)
    while process.poll() is None and not (len(_entries(journal)) > 2 and len(ephs.load_solution(journal)) > 1):
        time.sleep(0.02)
    process.send_signal(how)
    said = process.communicate()[1]
    assert process.returncode == (130 if how == signal.SIGINT else -how)
    if how == signal.SIGINT:
        assert f"ephs run {folder} --resume" in said
        assert len(ephs.load_solution(folder / "solution.nc")) > 1
    there = ephs.load_solution(journal)
    assert typed(f"run {folder} --resume") == 0
    assert typed(f"{words} {tmp_path}/whole") == 0
    found, whole = (ephs.load_solution(tmp_path / name / "solution.nc") for name in ("out", "whole"))
    assert 1 < len(there) < len(whole) == 161
    for path, values in whole.states.items():
        assert (found[path] == values).all()
        assert (there[path] == values[: len(there)]).all()
    assert (found.energy == whole.energy).all()
    assert not journal.exists()
    capsys.readouterr()
    for resumed in ("run", words):
        assert typed(f"{resumed} {folder} --resume") == 0
        assert "has reached its end already" in capsys.readouterr().out


def test_results_of_another_run_are_not_taken_for_this_one(tmp_path, capsys):
    scene = tmp_path / "top.toml"
    shutil.copy(ROOT / "scenes/heavy-top.toml", scene)
    words = f"run {scene} --until 0.01 --out {tmp_path}/out"
    assert typed(f"{words} --resume") == typed(f"{words} --resume") == 0
    assert "has reached its end already" in capsys.readouterr().out
    before = (tmp_path / "out/summary.json").read_bytes()
    for key, value in (("method", "radau"), ("rtol", "1e-5"), ("keep", "7")):
        assert typed(f"{words} --resume --{key} {value}") == 2
        assert f"results of another run with {key} = " in capsys.readouterr().err
    scene.write_text(scene.read_text().replace("mass = ", "mass = 1"))
    assert typed(f"{words} --resume") == 2
    assert "results of another run with model = " in capsys.readouterr().err
    assert (tmp_path / "out/summary.json").read_bytes() == before
    shutil.copy(ROOT / "scenes/heavy-top.toml", scene)
    words = words.replace("0.01", "0.02")  # a later end is another run
    assert typed(f"{words} --resume") == 2
    assert "results of another run with until = 0.01" in capsys.readouterr().err
    assert (tmp_path / "out/summary.json").read_bytes() == before
    assert typed(f"{words} --replace") == 0
    assert (tmp_path / "out/summary.json").read_bytes() != before
    assert typed(f"{words} --resume --replace") == 2
    assert "expected one of them" in capsys.readouterr().err


def _entries(journal):
    try:
        size = journal.stat().st_size
    except FileNotFoundError:
        return []
    with open(journal, "rb") as file:
        found = []
        while file.tell() + _FRAME.size <= size:
            found.append(_FRAME.unpack(file.read(_FRAME.size))[1])
            file.seek(found[-1], 1)
        return found


def test_a_journal_that_is_not_resumed_is_kept(tmp_path, capsys):
    words = f"run {ROOT}/scenes/heavy-top.toml --until 0.01 --out {tmp_path}"
    (tmp_path / "run.journal").write_text("of hours")
    assert typed(f"{words} --resume") == 2
    assert "expected a journal" in capsys.readouterr().err
    assert typed(f"{words} --replace") == 0
    assert "run.journal.old" in capsys.readouterr().err
    assert (tmp_path / "run.journal.old").read_text() == "of hours"


def test_no_run_replaces_results(tmp_path, capsys):
    """The first stays as it is; the others are numbered, and so is a run beside an unfinished one."""
    first = tmp_path / "top"
    words = f"run {ROOT}/scenes/heavy-top.toml --until 0.01 --no-report --out"
    assert typed(f"{words} {first}") == 0
    assert "--replace" not in capsys.readouterr().err
    kept = {file.name: file.read_bytes() for file in first.iterdir()}
    for number in (2, 3):
        assert typed(f"{words} {first}") == 0
        said = capsys.readouterr()
        assert f"{first} has the results of a run; this one goes to {first}-{number} (--replace" in said.err
        assert f"ephs plot {first}-{number}" in said.out
        assert {file.name for file in Path(f"{first}-{number}").iterdir()} == set(kept)
    assert {file.name: file.read_bytes() for file in first.iterdir()} == kept
    begun = tmp_path / "begun"
    begun.mkdir()
    (begun / "run.journal").write_text("of hours")
    assert typed(f"{words} {begun}") == 0
    assert f"{begun} has an unfinished run; this one goes to {begun}-2 (--resume" in capsys.readouterr().err
    assert [file.name for file in begun.iterdir()] == ["run.journal"]


@pytest.mark.parametrize("what", ["compiler", "system"])
def test_live_is_refused_before_the_run(tmp_path, capsys, monkeypatch, what):
    """Where no page can be made, nothing is run, and no folder made."""
    monkeypatch.setattr("ephs.exporting.linking.find_spec", lambda name: None if what == "compiler" else object())
    model = "scenes/heavy-top.toml" if what == "compiler" else "examples/oscillator.py:damped_oscillator"
    words = f"run {ROOT / model} --until 0.01 --live --out {tmp_path / 'out'}"
    assert typed(words) == 2
    assert ("ephs[export]" if what == "compiler" else "expected a scene") in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_journal_runs_no_code(tmp_path, capsys):
    """A result folder from a stranger may name a Python file: it is run only where the user names it."""
    own = tmp_path / "own.py"
    own.write_text(f"from pathlib import Path\nPath({str(tmp_path / 'ran')!r}).touch()\n")
    heading = {"name": "x", "model": "", "run": {"form": "reduced", "inputs": None}}
    Journal(tmp_path / "run.journal", {"scene": f"{own}:x", "asked": {"until": 1.0}}).open(heading).close()
    assert typed(f"run {tmp_path} --resume") == 2
    assert f"ephs run {own}:x --until 1.0" in capsys.readouterr().err
    assert not (tmp_path / "ran").exists()


def test_resuming_what_is_not_there_is_bad_input(tmp_path, capsys):
    assert typed(f"run {tmp_path} --resume") == 2
    assert "no run.journal in it" in capsys.readouterr().err
    assert typed(f"run {ROOT}/scenes/heavy-top.toml") == 2
    assert "--until is missing" in capsys.readouterr().err
    assert typed(f"run {ROOT}/scenes/heavy-top.toml --until 1 --keep 0") == 2
