"""Object code of modules: from the package, from the store or from LLVM, for this machine or for another."""

import hashlib
import os
from collections.abc import Callable, Generator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final

from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.llvm import LEVEL, Library, Target, compile_text, host, load, version
from ephs.semantics.stage.shipping import shipped
from ephs.semantics.stage.store import STORE

LEVELS: Final = ("0", "1", "2", "3")
"""Values of the environment variable ``EPHS_LLVM_LEVEL``."""
HIGHEST: Final = int(LEVELS[-1])
TARGETS: Final = {
    "linux-x86-64-v2": Target("x86_64-unknown-linux-gnu", "x86-64-v2", ""),
    "linux-x86-64-v3": Target("x86_64-unknown-linux-gnu", "x86-64-v3", ""),
    "linux-arm64": Target("aarch64-unknown-linux-gnu", "generic", ""),
    "macos-arm64": Target("arm64-apple-macosx11.0.0", "apple-m1", ""),
    "macos-x86-64": Target("x86_64-apple-macosx11.0.0", "x86-64-v2", ""),
    "windows-x86-64": Target("x86_64-pc-windows-msvc", "x86-64-v2", ""),
    "webassembly": Target("wasm32-unknown-unknown", "generic", "+bulk-memory"),
}
"""Machines that object code can be emitted for on any machine. Only those of `FITTING` are tested."""
FITTING: Final = {
    "linux-x86-64-v3": ("x86_64", "avx avx2 bmi bmi2 f16c fma lzcnt movbe"),
    "linux-x86-64-v2": ("x86_64", "cx16 popcnt sahf sse3 sse4.1 sse4.2 ssse3"),
    "linux-arm64": ("aarch64", ""),
}
"""Targets shipped with the package, the best first: architecture and required processor features."""


def level() -> int:
    """Return the optimisation level of programs compiled for this process: ``EPHS_LLVM_LEVEL``, else `LEVEL`.

    Level 0 compiles in a tenth of the time. Its programs give the same bits and run several times slower, so it suits
    short tests; no sum or product is reordered or fused at any level.

    Raises
    ------
    StageError
        The variable is no level of LLVM.
    """
    given = os.environ.get("EPHS_LLVM_LEVEL", str(LEVEL))
    if given not in LEVELS:
        raise StageError("level", where="EPHS_LLVM_LEVEL", found=repr(given), expected=", ".join(LEVELS))
    return int(given)


def name_of(text: str, target: Target, level: int = LEVEL) -> str:
    """Return the name of a module's object code: a digest of its text, the target, LLVM's version and the settings."""
    key = "\0".join([text, target.triple, target.processor, target.features, version(), str(level)])
    return f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.o"


_TOLD: Final[ContextVar[Callable[[str], None] | None]] = ContextVar("told", default=None)


@contextmanager
def telling(say: Callable[[str], None]) -> Generator[None]:
    """Call say(name) when compilation of a program starts, and say("") at its end."""
    before = _TOLD.set(say)
    try:
        yield
    finally:
        _TOLD.reset(before)


def compiled(text: str, name: str = "program", most: int = HIGHEST) -> Library:
    """Return a module in machine code for this process, compiled if neither package nor store has it.

    Parameters
    ----------
    text
        Assembly text of LLVM.
    name
        What is told where it is compiled.
    most
        Highest level that pays: of large programs that are run a few times.

    Raises
    ------
    StageError
        LLVM does not accept the text.
    """
    target = host()
    code = shipped(text, fitting(target))
    if code is not None:
        return load(code)
    optimisation = min(level(), most)
    file = name_of(text, target, optimisation)
    code = STORE.read(file)
    if code is None:
        _tell(name)
        code = compile_text(text, target, optimisation)
        _tell("")
        STORE.write(file, code)
    return load(code)


def _tell(name: str) -> None:
    if (say := _TOLD.get()) is not None:
        say(name)


def fitting(machine: Target) -> list[str]:
    """Return the targets of `FITTING` whose object code runs on a machine, the best first."""
    architecture, *system = machine.triple.split("-")
    features = set(machine.features.split(","))
    return [
        name
        for name, (needed, needs) in FITTING.items()
        if needed == architecture and "linux" in system and features.issuperset(f"+{one}" for one in needs.split())
    ]


def emitted(text: str, target: str) -> bytes:
    """Return a module's object code for a machine of `TARGETS`."""
    return compile_text(text, TARGETS[target])
