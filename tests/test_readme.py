"""The README's Python runs as it stands, in order, in one namespace."""

import re
import traceback

import pytest

from tests.scenes import ROOT

README = ROOT / "README.md"
FENCE = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def execute(text: str, name: str) -> dict[str, object]:
    """Run the Python blocks of a Markdown text, so that tracebacks show the lines of the text."""
    names: dict[str, object] = {"__name__": "__readme__"}
    for block in FENCE.finditer(text):
        before = text.count("\n", 0, block.start(1))
        exec(compile("\n" * before + block.group(1), name, "exec"), names)
    return names


def test_the_readme_runs():
    assert "solution" in execute(README.read_text(encoding="utf-8"), str(README))


def test_a_failing_block_is_found_at_its_line():
    text = "# Title\n\n```python\nx = 1\n```\n\nwords\n\n```python\ny = x\nz = 1 / 0\n```\n"
    with pytest.raises(ZeroDivisionError) as caught:
        execute(text, "some.md")
    last = traceback.extract_tb(caught.tb)[-1]
    assert (last.filename, last.lineno) == ("some.md", 11)
