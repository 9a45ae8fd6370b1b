"""Python in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path


def printed(code: str, **environment: str) -> str:
    """What code prints in the folder of the checkout, where no failure is."""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env=os.environ | environment,
        cwd=Path(__file__).resolve().parents[1],
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout
