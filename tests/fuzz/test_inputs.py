"""Whatever a file says, it is a model or a clear error, soon and in little memory; `make fuzz-inputs` looks for more.

The corpus holds what was found to be neither, made small.
"""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fuzz.judging import Judge
from tests.fuzz.mutations import KINDS, mutated
from tests.fuzz.seeds import seeds

CORPUS = Path(__file__).with_name("corpus")
FOUND = sorted(path.name for path in CORPUS.iterdir())
TEXTS = seeds()


@pytest.fixture(scope="module")
def judge(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tests.fuzz.judging.RUN_S", 3600.0)  # the first run of a kind may have to compile kernels
        yield Judge(tmp_path_factory.mktemp("inputs"))


@pytest.mark.parametrize("name", FOUND)
def test_what_was_found_is_mended(name, judge):
    verdict = judge(name.rpartition(".")[2], (CORPUS / name).read_bytes(), deep=True)
    assert verdict.outcome in ("model", "error"), verdict.detail


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_seeds_are_read(kind, judge):
    outcomes = {judge(kind, text.encode(), deep=True).outcome for text in dict.fromkeys(TEXTS[kind])}
    assert "model" in outcomes and "defect" not in outcomes


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_mutated_inputs_are_models_or_clear_errors(seed, judge):
    for number in range(50):
        kind, data = mutated(seed, number, TEXTS)
        verdict = judge(kind, data, deep=number == 0)
        assert verdict.outcome in ("model", "error"), (seed, number, kind, verdict.detail)


def test_inputs_repeat():
    assert [mutated(3, k, TEXTS) for k in range(30)] == [mutated(3, k, TEXTS) for k in range(30)]
    assert len({mutated(3, k, TEXTS)[1] for k in range(30)}) > 25


@pytest.mark.parametrize("fault", [ZeroDivisionError("x"), RecursionError(), MemoryError(), RuntimeWarning("overflow")])
def test_a_bare_error_is_a_defect(fault, judge, monkeypatch):
    def broken(*_given):
        raise fault

    monkeypatch.setattr("tests.fuzz.judging.load", broken)
    assert judge("toml", b"format = 1").signature.startswith(type(fault).__name__)


def test_time_is_bounded(judge, monkeypatch):
    def endless(*_given):
        while True:
            try:
                sum(range(1000))
            except Exception:  # which may not keep the bound
                continue

    monkeypatch.setattr("tests.fuzz.judging.load", endless)
    monkeypatch.setattr("tests.fuzz.judging.LOAD_S", 0.05)
    assert judge("toml", b"format = 1").outcome == "defect"
