"""A measurement in a process of its own, so that memory and compiled functions are its own."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

__all__ = ["run", "with_bytecode"]


def with_bytecode() -> dict[str, str]:
    """The environment, with compiled modules of Python kept as in an installation."""
    return {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}


def run(
    call: str, limit: float, failed: Mapping[str, Any], environment: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """What a function returns in a new process.

    Parameters
    ----------
    call
        ``module:expression``; the expression's value can be written as JSON.
    limit
        Seconds after which the process is ended.
    failed
        What is returned, with the key ``failure``, where the process does not return anything.
    environment
        Variables that are set beside those of this process.
    """
    module, _, expression = call.partition(":")
    code = f"import json, {module} as m; print(json.dumps(m.{expression}))"
    try:
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            timeout=limit,
            cwd=Path(__file__).parent.parent,
            env={**with_bytecode(), **(environment or {})},
            check=False,
        )
    except subprocess.TimeoutExpired:
        return {**failed, "failure": f"took more than {limit:g} s"}
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines()
        return {**failed, "failure": lines[-1][:120] if lines else f"ended with {done.returncode}"}
    return json.loads(done.stdout.splitlines()[-1])
