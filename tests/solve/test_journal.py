"""Journals: readable whatever ends the run, and what goes on from them is the undisturbed run, bit for bit."""

import json
import resource
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ephs
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.registry import METHODS
from ephs.solve.posing.errors import Outcome
from ephs.solve.running import journal
from ephs.solve.running.journal import FORMAT, read_journal
from examples.failures import runs
from tests.mechanics.ball import BALL
from tests.scenes import ROOT, shipped
from tests.written import scene_of_text

SCENE = shipped("slider-crank")
TIMES = np.linspace(0.0, 0.2, 23)
LOOSE = {"rtol": 1e-4, "atol": 1e-6}
RUNS = {
    **{f"{name}, constant steps": {"method": name, "step": 0.01} for name, m in METHODS.items() if m.fixed},
    **{f"{name}, chosen steps": {"method": name, **LOOSE} for name, m in METHODS.items() if m.adaptive},
    **{f"{name}, at times": {"method": name, "step": 0.01, "save_at": TIMES} for name in ("natural", "natural4")},
    **{f"{name}, at times": {"method": name, "save_at": TIMES, **LOOSE} for name in ("rk87", "radau", "auto")},
    "auto": {**LOOSE},
    "radau, seven stages": {"method": "radau", "rtol": 1e-7, "atol": 1e-9},
    "folded": {"form": "folded", "method": "natural", "step": 0.01},
    "driven": {"method": "rk54", "inputs": {"joints.bearing": lambda t, state: 1e-3 * np.sin(9.0 * t)}, **LOOSE},
    "driven, radau": {"method": "radau", "inputs": {"joints.bearing": lambda t: 1e-3 * np.sin(9.0 * t)}, **LOOSE},
    **{
        f"jumping, {method}{step}": {"method": method, "inputs": {"joints.bearing": lambda t: 1e-3 * (t < 0.1)}}
        | {"jumps": [0.055]}
        | step
        | (LOOSE if not step else {})
        for method, step in (
            ("rk54", {}),
            ("radau", {}),
            ("natural4", {}),
            ("variational", {"step": 0.01}),
            ("natural", {"step": 0.01}),
        )
    },
    "events": {"events": [lambda t, state: np.sin(40.0 * t)], **LOOSE},
    "backward": {"t0": 0.2, "until": 0.1, "method": "rk87"},
}


def arrays(solution):
    """Everything that a run gives but the time that it took."""
    events = [[event.t for event in solution.events]] if solution.stats.get("events") else []
    return [
        solution.t,
        *solution.states.values(),
        solution.energy,
        solution.heat,
        solution.work,
        *map(np.array, events),
    ]


def same(one, other):
    return all(np.array_equal(a, b) for a, b in zip(arrays(one), arrays(other), strict=True))


def counts(solution):
    """All that was counted, times apart."""
    return {name: value for name, value in solution.stats.items() if not name.endswith("_s")}


def simulate(model, options, **more):
    options = {"until": 0.2, **options}
    return ephs.simulate(model, options.pop("until"), **options, **more)


@pytest.fixture
def copies(monkeypatch):
    """Every entry is written at once; functions that write anew what the journal was after each."""
    made: list[Callable[[], Path]] = []
    write = journal.Written.write

    def noted(self, *entry):
        write(self, *entry)
        made.append(partial(beginning, self._path, self._path.stat().st_size))

    monkeypatch.setattr(journal, "EVERY", -1.0)
    monkeypatch.setattr(journal.os, "fsync", lambda handle: None)
    monkeypatch.setattr(journal.Written, "write", noted)
    monkeypatch.setattr("ephs.solve.running.loop.BURST", 3)
    return made


def beginning(path, size):
    """A file of the first bytes of another one, to which entries were only appended."""
    found = path.with_name("copy")
    found.write_bytes(path.read_bytes()[:size])
    return found


@pytest.mark.parametrize("name", RUNS)
def test_a_run_goes_on_from_any_entry_to_the_very_same_numbers(name, copies, tmp_path):
    model = shipped("heavy-top") if name == "backward" else SCENE
    whole = simulate(model, RUNS[name])
    assert same(simulate(model, RUNS[name], journal=tmp_path / "run.journal"), whole)
    for copy in [copies[len(copies) // 3], copies[-2], copies[-1]]:
        again = simulate(model, RUNS[name], journal=copy())
        assert same(again, whole)
        assert counts(again) == counts(whole)  # not one evaluation more, nor a matrix


def test_a_run_that_goes_from_method_to_method_goes_on_too(copies, tmp_path):
    model, options = scene_of_text(BALL.format(slip=1e-4)), {"until": 0.8, "rtol": 1e-4}
    whole = simulate(model, options)
    assert {"semi", "radau"} <= {switch["to"] for switch in whole.stats["switches"]}
    assert same(simulate(model, options, journal=tmp_path / "run.journal"), whole)
    for copy in copies[:: max(1, len(copies) // 6)]:
        again = simulate(model, options, journal=copy())
        assert same(again, whole) and counts(again) == counts(whole)


def test_a_system_goes_on_too(copies, tmp_path, damped):
    kinds = [("radau", None), ("radau", 0.01), ("natural", 0.01), ("natural4", None)]
    for method, step in kinds:
        options = {"method": method} | ({"step": step} if step else {})
        options |= {"initial": {"osc.pe.q": 1.0}, "until": 0.3}
        copies.clear()
        whole = simulate(damped, options)
        simulate(damped, options, journal=tmp_path / f"{method}-{step}")
        middle = tmp_path / "middle"
        copies[len(copies) // 2]().rename(middle)
        for copy in copies[:: max(1, len(copies) // 6)]:
            again = simulate(damped, options, journal=copy())
            assert same(again, whole) and counts(again) == counts(whole)
        found = ephs.load_solution(middle, damped)
        assert np.array_equal(found.t, whole.t[: len(found)])
        assert np.array_equal(found["osc.pe.q"], whole["osc.pe.q"][: len(found)])


AGAIN = [
    (case, name) for case, name in runs() if case.within[1] > 0.0 and case.outcome in (Outcome.RANGE, Outcome.DIVERGED)
]


@pytest.mark.parametrize(
    ("case", "name"), AGAIN, ids=lambda value: value if isinstance(value, str) else value.words.replace(" ", "-")
)
def test_a_run_that_failed_fails_again_where_it_did(case, name, tmp_path):
    errors, model = [], case.model()
    for _ in range(2):
        with pytest.raises(ephs.SimulationError) as failed:
            replace(case, model=lambda: model).run(name, journal=tmp_path / "run.journal")
        errors.append(failed.value)
    one, two = errors
    assert (one.outcome, one.time, one.path) == (two.outcome, two.time, two.path)
    assert same(one.partial, two.partial) and counts(one.partial)["steps"] == counts(two.partial)["steps"]


@pytest.mark.parametrize("name", ["driven", "folded"])
def test_a_journal_is_read_where_it_knows_of_inputs_the_names_only(name, tmp_path):
    file = tmp_path / "run.journal"
    whole = simulate(SCENE, RUNS[name], journal=file)
    found = ephs.load_solution(file)
    assert same(found, whole)
    assert found.stats["steps"] == whole.stats["steps"]
    inputs = [variable.values for variable in found.inputs.values()]
    assert any(np.isnan(values).all() for values in inputs) == (name == "driven")


class Restless(ReducedMethod):
    """A method of one's own that does not say what it takes along."""

    name, exponent = "restless", 2.0

    def step(self, state, h):
        from ephs.mechanics.methods.explicit import Explicit, tableau

        return Explicit(self.equations, self.control, tableau("rk54")).step(state, h)


def test_a_method_that_cannot_say_where_it_stands_begins_anew(copies, tmp_path):
    from ephs.mechanics.methods.registry import MethodEntry, on_joints

    method = MethodEntry("restless", 5, False, True, False, True, "one's own", on_joints(Restless))
    options = {"method": method, "step": 0.02}
    whole = simulate(SCENE, options)
    simulate(SCENE, options, journal=tmp_path / "run.journal")
    middle = copies[len(copies) // 2]()
    assert 0 < len(ephs.load_solution(middle)) < len(whole)
    assert read_journal(middle).snapshot is None
    assert same(simulate(SCENE, options, journal=middle), whole)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A journal of many entries, and the undisturbed run."""
    file = tmp_path_factory.mktemp("journal") / "run.journal"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(journal, "EVERY", -1.0)
        patch.setattr("ephs.solve.running.loop.BURST", 2)
        return file, simulate(SCENE, RUNS["natural, constant steps"], journal=file)


@settings(max_examples=25)
@given(st.data())
def test_any_beginning_of_a_journal_is_a_journal(written, data):
    file, whole = written
    text = file.read_bytes()
    cut = file.with_name("cut.journal")
    at = data.draw(st.integers(0, len(text)))
    cut.write_bytes(text[:at])
    again = simulate(SCENE, RUNS["natural, constant steps"], journal=cut)
    assert same(again, whole)


@settings(max_examples=25)
@given(st.data())
def test_what_is_damaged_is_not_read_and_what_stood_before_it_is(written, data):
    file, whole = written
    text = bytearray(file.read_bytes())
    text[data.draw(st.integers(0, len(text) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    damaged = file.with_name("damaged.journal")
    damaged.write_bytes(text)
    try:
        found = ephs.load_solution(damaged)
    except ephs.OptionError as error:  # the heading is
        assert "expected a journal" in str(error)
        return
    except ValueError as error:  # its first letters are
        assert "not a netCDF file" in str(error)
        return
    assert np.array_equal(found.t, whole.t[: len(found)])
    assert np.array_equal(found.energy, whole.energy[: len(found)])


def test_another_runs_journal_is_refused_and_left_as_it_is(written):
    file, _ = written
    before = file.read_bytes()
    options = RUNS["natural, constant steps"]
    heavier = shipped("heavy-top")
    for model, more, key in ((SCENE, {"until": 0.3}, "until"), (SCENE, {"step": 0.02}, "step"), (heavier, {}, "model")):
        with pytest.raises(ephs.OptionError, match=f"its {key} is"):
            simulate(model, {**options, **more}, journal=file)
    assert file.read_bytes() == before


def test_a_file_that_is_no_journal_is_refused(tmp_path):
    file = tmp_path / "run.journal"
    file.write_text("my notes")
    with pytest.raises(ephs.OptionError, match="expected a journal"):
        simulate(SCENE, LOOSE, journal=file)
    assert file.read_text() == "my notes"


@pytest.mark.parametrize(
    "payload",
    [
        b"[" * 100_000,
        b"null",
        json.dumps({"format": FORMAT}).encode(),
        json.dumps({"format": FORMAT, "model": "", "run": {}, "note": {}}).encode(),
        json.dumps({"format": 99}).encode(),
    ],
)
def test_a_heading_that_somebody_made_is_refused_in_words(tmp_path, payload):
    file = tmp_path / "run.journal"
    file.write_bytes(journal._FRAME.pack(journal.MAGIC, len(payload), journal._digest(payload)) + payload)
    with pytest.raises(ValueError, match="journal"):
        ephs.load_solution(file)


def test_a_journal_has_one_writer(tmp_path):
    file = tmp_path / "run.journal"
    first = journal.Journal(file).open({"name": "", "model": "", "run": {"form": "paper", "inputs": None}})
    with pytest.raises(ephs.OptionError, match="no other run is writing"):
        journal.Journal(file).open({"name": "", "model": "", "run": {"form": "paper", "inputs": None}})
    first.close()


def test_a_full_disk_ends_the_run_by_name_and_the_run_goes_on_when_there_is_room(tmp_path, monkeypatch):
    monkeypatch.setattr(journal, "EVERY", -1.0)
    monkeypatch.setattr("ephs.solve.running.loop.BURST", 2)
    options = RUNS["natural, constant steps"]
    file = tmp_path / "run.journal"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    whole = simulate(SCENE, options)
    simulate(SCENE, options, journal=tmp_path / "other.journal")
    room = (tmp_path / "other.journal").stat().st_size * 2 // 3
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, limits[1]))  # Python ignores the signal, and sees EFBIG
    try:
        with pytest.raises(ephs.SimulationError, match="free space") as failed:
            simulate(SCENE, options, journal=file)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert failed.value.outcome is Outcome.UNWRITTEN
    assert 0 < len(failed.value.partial) < len(whole)
    assert same(simulate(SCENE, options, journal=file), whole)


def test_runs_killed_at_random_moments_go_on(tmp_path):
    """A process that is killed writes nothing more: three moments for each of four methods."""
    command = [sys.executable, str(Path(__file__).with_name("kill_runs.py")), str(tmp_path), "12", "1"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "9 " in done.stdout
