"""The strategies serve other people's suites: one of them is run as they would run it."""

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).with_name("downstream")


def test_a_foreign_suite_passes(tmp_path):
    environment = os.environ | {"PYTHONPATH": str(HERE / "src")}
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "--confcutdir",
        str(HERE / "suite"),
        "--rootdir",
        str(tmp_path),
    ]
    command += ["-c", os.devnull, "--hypothesis-seed=0", str(HERE / "suite")]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "10 passed" in done.stdout


def test_it_knows_nothing_but_what_is_public():
    text = (HERE / "suite" / "test_counting.py").read_text(encoding="utf-8")
    imports = [line for line in text.splitlines() if line.startswith(("from ephs", "import ephs", "    from ephs"))]
    assert sorted(imports) == ["    from ephs import Pattern, Quantity, System", "from ephs.testing import ("]
