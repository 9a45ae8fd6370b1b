"""Charts: outcomes told apart, errors that fall with tolerances, failures recorded, files and messages written."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

import ephs
from ephs.mechanics.methods.registry import METHODS
from ephs.show.charts import (
    FAMILIES,
    ChartOutcome,
    Point,
    draw_work_precision,
    shipped_reference,
    stability,
    tight_reference,
    work_precision,
)
from ephs.show.charts.families import scene_family
from ephs.show.charts.outcomes import BOUND, ENERGY, RIGHT, horizon, judge
from ephs.show.charts.reasons import letter_of, reason_of, reasons, reasons_table
from ephs.show.charts.reference import PosesInTime
from ephs.show.charts.runs import RunEnding, RunSetting, attempt
from tests.scenes import ROOT
from tests.typed import typed

TOP = ROOT / "scenes/heavy-top.toml"
T = np.linspace(0.0, 10.0, 101)


def swing(amplitude=1.0, phase=0.0, decay=0.0, drift=0.0):
    """A point that swings along x with an energy of 1 J, and the balance that someone made of it."""
    x = amplitude * np.exp(-decay * T) * np.cos(T + phase)
    position = np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=-1)[:, None, :]
    rotation = np.tile(np.eye(3), (len(T), 1, 1, 1))
    return PosesInTime(T, position, rotation, drift * T / T[-1], np.zeros((len(T), 2)), 1.0)


def spoilt(motion, value):
    position = motion.position.copy()
    position[50] = value
    return replace(motion, position=position)


@pytest.mark.parametrize(
    ("found", "outcome"),
    [
        (swing(), ChartOutcome.RIGHT),
        (swing(phase=0.5 * RIGHT), ChartOutcome.RIGHT),
        (replace(swing(), totals=np.full((len(T), 2), 0.5 * RIGHT)), ChartOutcome.RIGHT),
        (replace(swing(), totals=np.full((len(T), 2), 2.0 * RIGHT)), ChartOutcome.WRONG_BUT_BOUNDED),
        (swing(phase=1.0), ChartOutcome.WRONG_BUT_BOUNDED),
        (swing(phase=1.0, drift=0.5 * ENERGY), ChartOutcome.WRONG_BUT_BOUNDED),
        (swing(phase=1.0, drift=2.0 * ENERGY), ChartOutcome.ENERGY_DRIFT),
        (swing(phase=1.0, drift=-2.0 * ENERGY), ChartOutcome.DAMPED),
        (swing(decay=0.3), ChartOutcome.DAMPED),
        (swing(amplitude=2.0 * BOUND), ChartOutcome.DIVERGED),
        (spoilt(swing(), np.nan), ChartOutcome.DIVERGED),
        (spoilt(swing(), np.inf), ChartOutcome.DIVERGED),
        (replace(swing(), turnover=1e6), ChartOutcome.DIVERGED),
    ],
)
def test_outcomes_are_told_apart(found, outcome):
    assert judge(found, swing())[0] is outcome


def test_an_unmoved_body_is_judged_by_its_balance():
    rest = PosesInTime(
        T, np.zeros((101, 1, 3)), np.tile(np.eye(3), (101, 1, 1, 1)), np.zeros(101), np.zeros((101, 2)), 0.0
    )
    assert judge(rest, rest) == (ChartOutcome.RIGHT, 0.0)
    assert judge(replace(rest, turnover=1.0), rest)[0] is ChartOutcome.DIVERGED


def test_the_horizon_is_the_last_good_time():
    assert horizon(swing(), swing()) == T[-1]
    late = spoilt(swing(), 1.0)
    assert horizon(late, swing()) == T[49]
    assert horizon(swing(phase=1.0), swing()) == 0.0


def test_errors_fall_with_tolerances_and_are_written(tmp_path):
    scene = ephs.load(TOP)
    points = work_precision(scene, 0.1, ["rk54"], tolerances=(1e-4, 1e-8), steps=(20, 80), repeats=1)
    by_tolerance = [p for p in points if p.setting.kind == "tolerance"]
    by_step = [p for p in points if p.setting.kind == "step"]
    assert [p.outcome for p in points] == [RunEnding.DONE] * 4
    for loose, tight in (by_tolerance, by_step):
        assert tight.error < 1e-2 * loose.error
        assert tight.evaluations > loose.evaluations > 0
        assert tight.seconds > 0.0
    files = draw_work_precision(points, "top", tmp_path, "wp")
    assert [file.name for file in files] == ["wp.png", "wp.svg", "wp.csv", "wp.json"]
    assert all(file.stat().st_size > 0 for file in files)
    with files[2].open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["error"]) for row in rows] == [p.error for p in points]
    assert [row["setting"] for row in json.loads(files[3].read_text())] == [p.setting.value for p in points]


def test_points_at_the_floor_of_the_reference_are_marked():
    scene = ephs.load(TOP)
    truth = tight_reference(scene, 0.05)
    assert 0.0 < truth.cross_check < 1e-9
    vague = replace(truth, cross_check=1.0)
    for reference, floor in ((truth, False), (vague, True)):
        (point,) = work_precision(scene, 0.05, ["rk87"], reference=reference, tolerances=(1e-4,), steps=(), repeats=1)
        assert point.floor is floor


def test_points_that_the_audit_refuses_are_marked(tmp_path):
    """Steps of 0.05 s do not resolve the spin of the top: the audit refuses the run, a fine one it lets pass."""
    points = work_precision(ephs.load(TOP), 0.5, ["rk87"], tolerances=(), steps=(10, 500), repeats=1)
    coarse, fine = points
    assert "energy" in coarse.flagged or "accuracy" in coarse.flagged
    assert not fine.flagged
    files = draw_work_precision(points, "top", tmp_path, "wp")
    with files[2].open(newline="") as stream:
        assert [bool(row["flagged"]) for row in csv.DictReader(stream)] == [True, False]
    assert "refused by the audit" in files[1].read_text(encoding="utf-8")


@pytest.mark.parametrize("method", METHODS)
def test_every_method_gives_a_motion_or_says_why_not(method, tmp_path):
    scene = ephs.load(TOP)
    points = work_precision(scene, 0.01, [method], tolerances=(1e-4,), steps=(20,), repeats=1)
    assert len(points) == METHODS[method].adaptive + METHODS[method].fixed
    for point in points:
        assert np.isfinite(point.error) if point.outcome is RunEnding.DONE else point.message
    assert draw_work_precision(points, method, tmp_path, "wp")[0].is_file()


def test_a_run_that_takes_too_long_is_stopped():
    run = attempt(ephs.load(TOP), 1e4, "rk54", RunSetting("step", 1e-3), limit=0.1, max_steps=10**8)
    assert (run.solution, run.ending) == (None, RunEnding.SLOW)
    assert "took too long" in run.message


def test_a_shipped_reference_agrees_with_a_tight_run():
    scene = ephs.load(TOP)
    shipped, until = shipped_reference(ROOT / "benchmarks/reference/heavy-top.json", scene)
    assert until == 0.5
    assert shipped.motion.off(tight_reference(scene, until).motion)[0] < 1e-9


@pytest.mark.parametrize("name", FAMILIES)
def test_every_family_makes_its_scenes(name):
    family = FAMILIES[name]
    for value in family.values:
        assert isinstance(family.make(value), ephs.Scene)
        assert family.end(value) > 0.0
        assert family.label(value)
        assert all(0.0 < step <= family.end(value) for step in family.steps_at(value))
    assert set(family.recommended) <= set(METHODS)


def test_failures_of_methods_are_cells():
    cells = stability(FAMILIES["half-turn"], ["natural", "rk87"], quick=True)
    assert {cell.value for cell in cells} == {0.5, 1.1}
    natural = {cell.value: cell for cell in cells if cell.method == "natural" and cell.setting.kind == "step"}
    assert natural[1.1].outcome is not ChartOutcome.RIGHT
    spun = stability(FAMILIES["spin"], ["natural"], quick=True)
    refused = [cell for cell in spun if cell.outcome is ChartOutcome.REFUSED]
    assert refused
    assert all(cell.message for cell in refused)
    assert any("π" in cell.message for cell in refused)


def test_a_scene_of_ones_own_is_a_family_by_step():
    family = scene_family(ephs.load(TOP), 0.1)
    cells = stability(family, ["rk87"], quick=True)
    steps = [cell for cell in cells if cell.setting.kind == "step"]
    assert [cell.setting.value for cell in steps] == [cell.value for cell in steps] == [0.1 / 1000, 0.1 / 10]
    assert steps[0].outcome is ChartOutcome.RIGHT
    assert steps[0].error < steps[1].error


@pytest.mark.parametrize(
    ("message", "cause"),
    [
        ("", ""),
        (
            "t = 2 s at joints.b: no solution (3 depend on others (in world axes): d); take a shorter step",
            "no solution",
        ),
        ("t = 0 s at bodies.crank.ke.p: a state off its joints (by 4e-03); change it", "a state off its joints"),
        ("accuracy: 3 where 1 is allowed, t = 1 s at a.b\nheat: 2 where 1 is allowed, t = 0 s; x", "accuracy, heat"),
        ("its scenes have no loops", "its scenes have no loops"),
    ],
)
def test_causes_have_no_places_numbers_and_advice(message, cause):
    assert reason_of(message) == cause


def test_runs_that_differ_in_place_and_numbers_alone_share_a_reason(tmp_path):
    message = "t = {} s at joints.{}: no solution near by ({} rows); take a shorter step"
    blank = Point("rk54", RunSetting("step", 0.1), np.nan, np.nan, 0, 0, RunEnding.FAILED)
    points = [replace(blank, message=message.format(k, "ab"[k % 2], k)) for k in range(4)]
    points += [replace(blank, method="variational", message="its scenes have no loops", outcome=RunEnding.REFUSED)]
    points += [
        replace(blank, message="took too long: 1 s", outcome=RunEnding.SLOW),
        replace(blank, outcome=RunEnding.DONE),
    ]
    found = reasons(points)
    assert [(each.letter, each.text, dict(each.runs)) for each in found.values()] == [
        ("a", "no solution near by", {"rk54": 4}),
        ("b", "its scenes have no loops", {"variational": 1}),
    ]
    assert [letter_of(point, found) for point in points] == ["a"] * 4 + ["b", "", ""]
    assert "| refused | its scenes have no loops | variational 1 |" in reasons_table([*found.values()])
    _, svg, *_ = draw_work_precision(points, "failures only", tmp_path, "failed")  # no curve at all
    assert svg.stat().st_size > 0 and svg.suffix == ".svg"


def test_letters_of_reasons_are_different():
    points = [
        Point("rk54", RunSetting("step", 0.1), np.nan, np.nan, 0, 0, RunEnding.FAILED, "no " + "x" * k)
        for k in range(1, 800)
    ]
    letters = [each.letter for each in reasons(points).values()]
    assert len({*letters}) == len(points) and letters[:1] + letters[25:28] == ["a", "z", "aa", "ab"]


def test_the_commands_write_their_folders(tmp_path, capsys):
    words = f"chart work-precision {TOP} --until 0.01 --method rk87 -o {tmp_path}"
    assert typed(words) == 0
    assert typed(f"chart stability half-turn --quick -o {tmp_path}") == 0
    said = capsys.readouterr().out
    for name in ("work-precision-heavy-top", "stability-half-turn"):
        for ending in ("png", "svg"):
            assert str(tmp_path / f"{name}.{ending}") in said
            assert (tmp_path / f"{name}.{ending}").is_file()
    cells = json.loads((tmp_path / "stability.json").read_text())
    assert {cell["outcome"] for cell in cells} <= {outcome.value for outcome in ChartOutcome}
    assert {cell["method"] for cell in cells} == {n for n, m in METHODS.items() if m.scenes}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (f"work-precision {TOP} --method euler", "natural"),
        ("work-precision nowhere.toml", "no such file"),
        ("work-precision", "found no scene"),
        (f"work-precision {TOP} --until -1", "--until"),
        (f"work-precision {TOP} --reference {TOP}", "no reference states"),
        (f"work-precision {TOP} --reference nowhere.json", "nowhere.json"),
        (f"work-precision {TOP} --reference benchmarks/reference/tumbling-body.json", "tumbling-body"),
        (f"work-precision {ROOT}/examples/oscillator.py:free_oscillator", "expected a Scene"),
        ("stability nothing", "half-turn"),
        ("stability nowhere.toml", "no such file"),
        ("stability half-turn --until nan", "--until"),
    ],
)
def test_bad_names_are_one_message(words, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    assert typed(f"chart {words} -o {tmp_path}") == 2
    error = capsys.readouterr().err
    assert said in error
    assert "Traceback" not in error
    assert not list(tmp_path.iterdir())
