"""What a run of the benchmarks says beside an earlier one. Nothing is timed here."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks import quick
from benchmarks.verdict import EVERYTHING, SLOWER, Timing, compare, in_both, timing

NAMES = [f"case {k}" for k in range(9)]
seconds = st.floats(1e-6, 1e3)
runs = st.fixed_dictionaries({name: st.builds(Timing, seconds, st.floats(0.0, 0.5)) for name in NAMES})


def run(**changed):
    """A run in which each case takes a second, but for those that are said."""
    return {name: Timing(changed.get(name.replace(" ", "_"), 1.0), 0.01) for name in NAMES}


def times(timings, factor):
    return {name: Timing(factor * t.seconds, t.spread) for name, t in timings.items()}


def test_the_least_counts_and_the_spread_is_that_of_the_processes():
    assert timing([[3.0, 2.0], [2.5, 9.0], [4.0]]) == Timing(2.0, 0.25)
    assert timing([[1.0]]) == Timing(1.0, 0.0)


@given(runs, runs, st.floats(0.1, 10.0))
def test_a_verdict_does_not_depend_on_the_machine(now, then, factor):
    one, other = compare(now, then), compare(times(now, factor), then)
    assert one.ratios == pytest.approx(other.ratios)


@pytest.mark.parametrize(
    ("ratio", "slower", "unsure", "faster"),
    [
        (1.0, 0, 0, 0),
        (1.14, 0, 0, 0),
        (1.16, 0, 1, 0),
        (1.19, 1, 0, 0),
        (3.0, 1, 0, 0),
        (0.88, 0, 0, 0),
        (0.8, 0, 0, 1),
    ],
)
def test_what_changed_by_more_than_15_percent_and_its_spread_is_named(ratio, slower, unsure, faster):
    verdict = compare(run(case_3=ratio), run())
    assert (verdict.slower, verdict.unsure, verdict.faster) == tuple(
        ("case 3",) * count for count in (slower, unsure, faster)
    )
    assert ("SLOWER: case 3, " in str(verdict)) == bool(slower)
    assert ("nothing got slower" in str(verdict)) != bool(slower)


def test_the_worst_comes_first_and_new_and_missing_cases_are_named():
    now = run(case_1=1.5, case_2=2.5, case_4=0.5) | {"fresh": Timing(1.0, 0.0)}
    del now["case 8"]
    verdict = compare(now, run())
    assert verdict.slower == ("case 2", "case 1") and verdict.faster == ("case 4",)
    assert (verdict.new, verdict.missing) == (("fresh",), ("case 8",))
    for line in (
        "SLOWER: case 2, 2.50 times",
        "faster: case 4, 0.50",
        "in the baseline: fresh",
        "not measured: case 8",
    ):
        assert line in str(verdict)


def test_what_all_cases_have_in_common_is_seen_beside_others():
    others = ("case 0", "case 1")
    slow = {name: Timing(1.0 if name in others else 1.3, 0.01) for name in NAMES}
    assert compare(slow, run()).slower == ()
    verdict = compare(slow, run(), others)
    assert verdict.slower == (EVERYTHING,) and verdict.ratios[EVERYTHING] == pytest.approx(1.3)
    assert compare(times(slow, 2.0), run(), others).ratios[EVERYTHING] == pytest.approx(1.3)
    assert not set(others) & set(verdict.ratios)


def test_a_second_look_of_a_part_clears_or_confirms():
    first = compare(run(case_1=1.5, case_2=1.6), run())
    part = {name: timing for name, timing in run(case_1=1.0, case_2=1.4).items() if name < "case 6"}
    both = in_both(first, compare(part, run(), among=NAMES[3:6]))
    assert first.slower == ("case 2", "case 1") and both.slower == ("case 2",) and both.unsure == ()
    assert both.ratios["case 2"] == pytest.approx(1.4) and both.missing == ()


class Measured:
    """Stands for measuring: what each look finds, in turn."""

    def __init__(self, *looks):
        self.looks, self.asked = list(looks), []

    def __call__(self, names, seed=0):
        self.asked.append(set(names))
        return self.looks.pop(0), {"absent": {"pin: x": "not installed"}, "failed": {}}


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.setattr(quick, "OUT", tmp_path / "out" / "bench.json")
    monkeypatch.setattr(quick, "BASELINE", tmp_path / "baseline.json")
    monkeypatch.setattr(quick, "CASES", dict.fromkeys(NAMES))
    monkeypatch.setattr(quick, "OTHERS", ("case 0",))
    return tmp_path


def test_a_run_is_held_against_the_baseline_that_a_run_wrote(files, monkeypatch, capsys):
    slow = run(case_5=2.0)
    for looks, words, code, said in (
        ([run()], ["--update"], 0, "the baseline"),
        ([run()], [], 0, "nothing got slower"),
        ([slow, slow], [], 1, "SLOWER: case 5, 2.00 times"),
        ([slow, run()], [], 0, "nothing got slower"),
    ):
        measured = Measured(*looks)
        monkeypatch.setattr(quick, "look", measured)
        assert quick.main(words) == code
        printed = capsys.readouterr().out
        assert said in printed and "absent: pin: x: not installed" in printed
        assert measured.looks == [] and measured.asked[0] == set(NAMES)
        assert len(measured.asked) == 1 or {"case 0", "case 5"} < measured.asked[1] < set(NAMES)
    found = json.loads((files / "out" / "bench.json").read_text())
    assert found["cases"]["case 5"] == asdict(Timing(2.0, 0.01)) and found["verdict"]["slower"] == []
    assert {"processor", "python", "numpy"} <= set(found["machine"])


def test_a_case_that_fails_is_not_passed_over(files, monkeypatch, capsys):
    run_of_all = Measured(run(), run())
    monkeypatch.setattr(quick, "look", run_of_all)
    quick.main(["--update"])
    monkeypatch.setattr(quick, "look", lambda names: (run(), {"absent": {}, "failed": {"case 9": "ValueError: x"}}))
    assert quick.main([]) == 1
    assert "failed: case 9: ValueError: x" in capsys.readouterr().out


def test_what_is_measured_is_the_time_that_work_takes(monkeypatch):
    """On a clock that only the work moves."""
    clock = [0.0]

    def taking(seconds):
        def work():
            clock[0] += seconds

        return lambda: work

    def absent():
        raise ImportError("no peer")

    def broken():
        raise ValueError("no scene")

    cases = {"short": taking(0.001), "long": taking(2.0), "absent": absent, "broken": broken}
    monkeypatch.setattr(quick, "CASES", cases)
    monkeypatch.setattr(quick, "_spent", lambda: clock[0])
    found = quick.measure(list(cases), 3, 0)
    assert found["seconds"]["short"] == pytest.approx([0.001] * 3) and found["seconds"]["long"] == pytest.approx(
        [2.0] * 3
    )
    assert found["absent"] == {"absent": "no peer"} and found["failed"] == {"broken": "ValueError: no scene"}
    assert quick.measure(list(cases), 0, 0)["seconds"] == {}


def test_looks_gather_what_processes_measured(monkeypatch):
    calls = []

    def run(call, _limit, failed):
        calls.append(call)
        if len(calls) == 3:
            return {**failed, "failure": "killed"}
        rounds = [] if len(calls) == 1 else [float(len(calls)), 9.0]
        return {**failed, "seconds": {"a": rounds} if rounds else {}}

    monkeypatch.setattr(quick.process, "run", run)
    timings, without = quick.look(["a"])
    assert len(calls) == quick.PROCESSES + 1 and len(set(calls)) == len(calls)
    assert timings == {"a": timing([[2.0], [4.0], [5.0]])}
    assert without["failed"] == {"the process": "killed"}


def test_bad_words_are_told(capsys):
    assert quick.main(["--updat"]) == 2
    assert "--updat: expected" in capsys.readouterr().err


def test_the_committed_baseline_is_of_these_cases():
    known = json.loads((Path(quick.__file__).parent / "baseline.json").read_text())
    assert set(known["cases"]) <= set(quick.CASES) and set(quick.OTHERS) < set(quick.CASES)
    assert all(case["seconds"] > 0.0 and case["spread"] >= 0.0 for case in known["cases"].values())
    assert SLOWER > 1.0
