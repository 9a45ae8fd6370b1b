"""Examples are the same on every machine, in every order; only `make fuzz` draws others."""

import os
import subprocess
import sys

import pytest

from tests.scenes import ROOT

DRAWING = """
from pathlib import Path
from hypothesis import given, settings, strategies as st
from ephs.testing import patterns

@settings(max_examples=60)
@given(drawn=st.tuples(st.integers(), st.floats(), st.text(), patterns()))
def test_drawn(drawn):
    with Path("drawn.txt").open("a", encoding="utf-8") as out:
        print(drawn, file=out)
"""


@pytest.fixture
def drawn(tmp_path):
    """Called with a name, options and variables of the environment: what a session in a folder of its own drew."""

    def draw(name: str, *options: str, before: str = "", **variables: str) -> str:
        folder = tmp_path / name
        folder.mkdir()
        (folder / "conftest.py").write_text(f"{before}\nfrom tests.conftest import *", encoding="utf-8")
        (folder / "test_drawing.py").write_text(DRAWING, encoding="utf-8")
        command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", *options]
        environment = os.environ | {"PYTHONPATH": str(ROOT)} | variables
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return (folder / "drawn.txt").read_text(encoding="utf-8")

    return draw


def test_sessions_draw_the_same_and_fuzzing_draws_anew(drawn):
    first = drawn("first", CI="")
    assert first.count("\n") >= 50
    assert drawn("again", before="import fractions, ephs.modelica", CI="1", PYTHONHASHSEED="5") == first
    assert drawn("anew", "--hypothesis-profile=fuzz", CI="1") != first
