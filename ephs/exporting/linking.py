"""Linked programs, by a cross compiler installed as a Python package."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from ephs.exporting.errors import ExportError
from ephs.exporting.module import Exported
from ephs.semantics.stage.objects import emitted

CALLS: Final = ("start", "parameters", "inputs", "advance", "time", "outputs", "accelerations")
"""Functions of an exported mechanism."""


def webassembly(made: Exported) -> bytes:
    """Return an exported mechanism as a module of WebAssembly, which exports its memory and functions.

    Raises
    ------
    ExportError
        There is no linker.
    """
    with TemporaryDirectory() as folder:
        code, linked = Path(folder, "code.o"), Path(folder, "code.wasm")
        code.write_bytes(emitted(made.text, "webassembly"))
        exports = [f"--export={made.name}_{call}" for call in CALLS]
        tool("WebAssembly", "wasm-ld", code, "-o", linked, "--no-entry", "--strip-all", "--gc-sections",
             "--export=__heap_base", *exports)  # fmt: skip
        return linked.read_bytes()


def require_tools(what: str) -> None:
    """Refuse to make ``what`` without the cross compiler.

    Raises
    ------
    ExportError
        It is not installed.
    """
    if find_spec("ziglang") is None:
        raise ExportError("tool", what=what, tool="ziglang", package="ephs[export]")


def tool(what: str, *words: str | Path) -> None:
    """Run a tool of the cross compiler.

    Raises
    ------
    ExportError
        It is not installed, or refuses.
    """
    require_tools(what)
    done = subprocess.run(
        [sys.executable, "-m", "ziglang", *map(str, words)], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise ExportError("refused", tool=f"ziglang {words[0]}", found=done.stderr.strip()[:2000])
