"""The command line: exit codes, messages, what is passed on and what is written."""

import inspect
import json
import re
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import ephs
from ephs import Outcome
from ephs.cli import commands as cli
from ephs.cli.input import LoadOptions, Stepping
from ephs.cli.linear import linearize
from ephs.cli.run import run
from ephs.cli.sweep import sweep
from ephs.semantics.systems.report import CheckItem
from ephs.solve.auditing.findings import Audit, Finding
from examples.failures import CASES, Case
from tests.typed import typed


class FakeSystem:
    """Stands for a System that can be drawn."""

    def flatten(self):
        return "flattened"


@dataclass(frozen=True)
class FakeScene:
    """Stands for a Scene."""

    name: str = "crank"
    drawn: FakeSystem = field(default_factory=FakeSystem)

    def system(self):
        return self.drawn


class FakeSolution:
    """Stands for a Solution that ends at 0.25 s."""

    t = (0.0, 0.25)
    scene = outline = None
    audit = Audit()

    def summary(self):
        return {"scene": "crank", "steps": 7, "max_energy_error": 3e-15, "work": None}

    def save(self, path):
        Path(path).write_text("data")


class FakeSceneError(ValueError):
    """A scene's error, as the package raises it."""

    __module__ = "ephs.mechanics.scene.errors"


class FakeSimulationError(RuntimeError):
    """A failed run, with what was computed."""

    def __init__(self, message, partial):
        super().__init__(message)
        self.partial = partial


class FakeInterrupted(FakeSimulationError):
    """An interrupted run."""


@pytest.fixture
def house(monkeypatch, tmp_path):
    """The package with its lower rooms replaced; `calls` tells what reached them."""
    calls = SimpleNamespace(load=None, simulate=None, drawn=None)

    def load(path, **options):
        calls.load = (str(path), options)
        return FakeScene()

    def simulate(model, until, **options):
        calls.simulate = (model, until, options)
        options["progress"](0.1, until, {"steps": 3})
        return FakeSolution()

    def write_report(solution, folder):
        report = folder / "report.html"
        report.write_text("<html>")
        return report

    def draw(system, path, *, opened):
        calls.drawn = system
        Path(path).write_text("<svg>")
        return SimpleNamespace(faults=["a name lies on a wire"] if opened else [])

    names = {
        "load": load,
        "simulate": simulate,
        "Scene": FakeScene,
        "System": FakeSystem,
        "SimulationError": FakeSimulationError,
        "Interrupted": FakeInterrupted,
    }
    for name, value in names.items():
        monkeypatch.setattr(ephs, name, value, raising=False)
    monkeypatch.setattr("ephs.mechanics.scene.document.scene_to_text", repr)
    monkeypatch.setattr("ephs.mechanics.constraints.plausible.doubts", lambda scene: ())
    monkeypatch.setitem(sys.modules, "ephs.show", SimpleNamespace(draw=draw))
    monkeypatch.setitem(sys.modules, "ephs.show.report", SimpleNamespace(write_report=write_report))
    monkeypatch.chdir(tmp_path)
    Path("crank.toml").write_text("format = 1\n")
    return calls


def fails_with(error):
    def fail(*_arguments, **_options):
        raise error

    return fail


@pytest.mark.parametrize(("policy", "code", "said"), [("", 4, 1), ("--audit warn", 0, 1), ("--audit off", 0, 0)])
def test_a_run_that_does_not_pass_its_audit_is_saved_and_exits_with_4(house, monkeypatch, capsys, policy, code, said):
    finding = Finding("energy", 0.5, 1e-9, 0.25, "joints.pin", "take a smaller step")
    monkeypatch.setattr(FakeSolution, "audit", Audit((finding,)))
    assert typed(f"run crank.toml --until 2 {policy}") == code
    folder = Path("out/crank")
    assert sorted(file.name for file in folder.iterdir()) == ["report.html", "run.json", "solution.nc", "summary.json"]
    assert capsys.readouterr().err.splitlines().count(f"crank.toml: {finding}") == said


def test_run_passes_on_what_was_given_and_leaves_the_defaults_alone(house):
    words = "--until 2 --method natural --step 0.01 --form paper --base free --adjust --out deep/er"
    assert typed(f"run crank.toml {words}") == 0
    assert house.load == ("crank.toml", {"base": "free", "adjust": True})
    _, until, options = house.simulate
    assert until == 2.0
    assert {key: options[key] for key in options if key not in ("progress", "journal", "audit")} == {
        "method": "natural",
        "step": 0.01,
        "form": "paper",
    }
    assert Path("deep/er/summary.json").is_file()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("run crank.toml", ["--until"]),
        ("run crank.toml --until -1", ["--until", "-1", "positive"]),
        ("run crank.toml --until nan", ["--until", "nan", "positive"]),
        ("run crank.toml --until inf", ["--until", "inf", "finite"]),
        ("run crank.toml --until 1 --step 0", ["--step", "0", "positive"]),
        ("run crank.toml --until soon", ["--until", "soon"]),
        ("run crank.toml --until 1 --metod natural", ["--metod", "--method"]),
        ("run crank.toml --until 1 --form folder", ["--form", "folder", "folded"]),
        ("run absent.toml --until 1", ["absent.toml: no such file"]),
        ("run absent.py:x --until 1", ["absent.py: no such file"]),
        ("walk crank.toml", ["walk"]),
        ("draw crank.toml -o a.jpeg", ["a.jpeg", ".svg, .tex, .png"]),
        ("draw crank.toml", ["--output"]),
    ],
)
def test_bad_words_are_named_and_exit_with_2(house, capsys, words, expected):
    assert typed(words) == 2
    said = capsys.readouterr()
    assert all(word in said.err for word in expected), said.err
    assert said.out == ""
    assert "Traceback" not in said.err


def test_a_message_without_the_file_gets_it(house, capsys, monkeypatch):
    monkeypatch.setattr(ephs, "simulate", fails_with(FakeSceneError("method: found 'x'")))
    assert typed("run crank.toml --until 1") == 2
    assert capsys.readouterr().err == "crank.toml: method: found 'x'\n"


def test_a_defect_of_the_package_is_not_hidden(house, monkeypatch):
    monkeypatch.setattr(ephs, "simulate", fails_with(ValueError("a defect")))
    with pytest.raises(ValueError, match="a defect"):
        typed("run crank.toml --until 1")


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (
            FakeSimulationError("joints.pin at t = 0.25 s: Newton stalled", FakeSolution()),
            3,
            "joints.pin at t = 0.25",
        ),
        (FakeInterrupted("", FakeSolution()), 130, "interrupted at t = 0.25 s"),
    ],
    ids=["failed", "interrupted"],
)
def test_what_was_computed_is_saved(house, capsys, monkeypatch, error, code, words):
    monkeypatch.setattr(ephs, "simulate", fails_with(error))
    assert typed("run crank.toml --until 1 --out part") == code
    assert Path("part/solution.nc").is_file()
    assert json.loads(Path("part/summary.json").read_text())["steps"] == 7
    said = capsys.readouterr().err
    assert words in said
    assert "saved what was computed: part" in said


def test_a_run_that_never_began_is_bad_input(house, capsys, monkeypatch):
    monkeypatch.setattr(ephs, "simulate", fails_with(FakeSimulationError("unknown method", None)))
    assert typed("run crank.toml --until 1") == 2
    assert capsys.readouterr().err == "crank.toml: unknown method\n"


def test_an_interrupt_while_loading_exits_with_130(house, monkeypatch):
    monkeypatch.setattr(ephs, "load", fails_with(KeyboardInterrupt()))
    assert typed("run crank.toml --until 1") == 130


def test_jumps_are_times(house, capsys):
    assert typed("run crank.toml --until 1 --jumps 0.1,0.25") == 0
    assert house.simulate[2]["jumps"] == [0.1, 0.25]
    assert typed("run crank.toml --until 1 --jumps 0.1,soon") == 2
    assert "--jumps 0.1,soon: expected TIME,TIME,... in seconds" in capsys.readouterr().err


def test_an_unusable_result_folder_is_told_before_the_run(house, capsys):
    Path("taken").write_text("a file")
    assert typed("run crank.toml --until 1 --out taken") == 2
    assert "taken" in capsys.readouterr().err
    assert house.simulate is None


def test_a_missing_extra_keeps_the_data(house, capsys, monkeypatch):
    absent = ModuleNotFoundError("No module named 'matplotlib'", name="matplotlib.pyplot")
    report = SimpleNamespace(write_report=fails_with(absent))
    monkeypatch.setitem(sys.modules, "ephs.show.report", report)
    assert typed("run crank.toml --until 1") == 0
    assert "ephs[viz]" in capsys.readouterr().err
    assert Path("out/crank/solution.nc").is_file()


@pytest.mark.parametrize(("ok", "code"), [(True, 0), (False, 1)])
def test_check_prints_each_law_and_exits_by_the_verdict(house, capsys, monkeypatch, ok, code):
    items = [CheckItem("power balance", True, "defect 1e-16"), CheckItem("energy [mf]", ok, "found 0.1")]
    module = SimpleNamespace(check_model=lambda model, initial: SimpleNamespace(items=items, ok=ok))
    monkeypatch.setitem(sys.modules, "ephs.mechanics.runs.check", module)
    assert typed("check crank.toml") == code
    said = capsys.readouterr().out
    assert all(name in said and detail in said for name, _, detail in items)
    assert ("FAILS" in said) is not ok


def test_draw_takes_the_hierarchy_or_its_flattening(house, capsys):
    assert typed("draw crank.toml -o pictures/a.svg") == 0
    assert isinstance(house.drawn, FakeSystem)
    assert Path("pictures/a.svg").read_text() == "<svg>"
    assert typed("draw crank.toml --flat -o b.png") == 0
    assert house.drawn == "flattened"
    assert capsys.readouterr().out.split() == ["pictures/a.svg", "b.png"]
    assert typed("draw crank.toml --opened -o c.svg") == 0
    assert capsys.readouterr().out.splitlines() == [
        "c.svg",
        "overlapping names and wires: 1",
    ]


def test_a_model_from_a_python_file(house):
    Path("beside.py").write_text("import ephs\nmodel = ephs.System()\n")
    Path("mine.py").write_text("from beside import model\nother = 1\n")
    before = list(sys.path)
    try:
        assert typed("run mine.py:model --until 1") == 0
    finally:
        sys.modules.pop("beside", None)
    assert isinstance(house.simulate[0], FakeSystem)
    assert Path("out/model/summary.json").is_file()
    assert sys.path == before


@pytest.mark.parametrize(
    ("text", "name", "expected"),
    [
        ("model = 1", "model", ["model is a int", "System or a Scene"]),
        ("import ephs\nosc = ephs.System()", "ocs", ["no System or Scene ocs in it", "expected one of osc"]),
        ("x = 1", "model", ["no System and no Scene"]),
        ("x = 1\ny = 1 / 0", "x", ["line 2", "ZeroDivisionError: division by zero"]),
        ("x = 1\ny = (", "x", ["line 2", "SyntaxError"]),
        ("def f():\n    raise SystemExit(4)\nf()", "x", ["line 2", "SystemExit: 4"]),
        ("import absent_module", "x", ["line 1", "absent_module"]),
    ],
)
def test_a_bad_python_file_is_told_without_a_traceback(house, capsys, text, name, expected):
    Path("mine.py").write_text(text)
    assert typed(f"check mine.py:{name}") == 2
    said = capsys.readouterr().err
    assert said.startswith("mine.py:")
    assert all(word in said for word in expected), said


@pytest.mark.parametrize("command", [run, cli.check, cli.draw, cli.convert, sweep, linearize, LoadOptions, Stepping])
def test_every_option_is_explained(command):
    documented = re.findall(r"^(\w+)$", inspect.getdoc(command), flags=re.MULTILINE)
    groups = ("loading", "stepping")  # explained by themselves
    options = [name for name in inspect.signature(command).parameters if name not in groups]
    assert [name for name in documented if name != "Parameters"] == options


@pytest.mark.parametrize(
    ("number", "case"),
    [(i, case) for i, case in enumerate(CASES) if not case.options() and case.step],
    ids=lambda value: value.outcome.name if isinstance(value, Case) else str(value),
)
def test_a_run_that_fails_exits_with_3_says_why_and_saves_what_there_is(tmp_path, capsys, monkeypatch, number, case):
    monkeypatch.setattr("ephs.show.report.write_report", lambda solution, folder: None)
    file, out = tmp_path / "failing.py", tmp_path / "out"
    file.write_text(f"from examples.failures import CASES\nmodel = CASES[{number}].model()\n")
    words = f"--until {case.until} --step {case.step} --method {case.methods[0]} --out {out}"
    assert typed(f"run {file}:model {words}") == 3
    said = capsys.readouterr().err
    assert "t = " in said and case.outcome.value in said and case.outcome.advice in said
    if "saved what was computed" in said:
        solution = ephs.load_solution(out / "solution.nc")
        assert len(solution) and all(np.isfinite(values).all() for values in solution.states.values())
    else:
        assert case.outcome in (Outcome.SINGULAR, Outcome.INCONSISTENT)
