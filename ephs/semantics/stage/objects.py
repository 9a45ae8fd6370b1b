"""Object code of modules: from the store or from LLVM, for this machine or for another."""

import hashlib
from typing import Final

from ephs.semantics.stage.llvm import LEVEL, Library, Target, compile_text, host, load, version
from ephs.semantics.stage.store import STORE

__all__ = ["TARGETS", "compiled", "emitted", "name_of"]

TARGETS: Final = {
    "linux-x86-64-v2": Target("x86_64-unknown-linux-gnu", "x86-64-v2", ""),
    "linux-x86-64-v3": Target("x86_64-unknown-linux-gnu", "x86-64-v3", ""),
    "linux-arm64": Target("aarch64-unknown-linux-gnu", "generic", ""),
    "macos-arm64": Target("arm64-apple-macosx11.0.0", "apple-m1", ""),
    "macos-x86-64": Target("x86_64-apple-macosx11.0.0", "x86-64-v2", ""),
    "windows-x86-64": Target("x86_64-pc-windows-msvc", "x86-64-v2", ""),
}
"""Machines that object code can be emitted for on any machine. Only the first two are tested."""


def name_of(text: str, target: Target) -> str:
    """Return the name of a module's object code: a digest of its text, the target, LLVM's version and the settings."""
    key = "\0".join([text, target.triple, target.processor, target.features, version(), str(LEVEL)])
    return f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.o"


def compiled(text: str) -> Library:
    """Return a module in machine code for this process, compiled if the store does not have it.

    Parameters
    ----------
    text
        Assembly text of LLVM.

    Raises
    ------
    StageError
        LLVM does not accept the text.
    """
    target = host()
    name = name_of(text, target)
    code = STORE.read(name)
    if code is None:
        code = compile_text(text, target)
        STORE.write(name, code)
    return load(code)


def emitted(text: str, target: str) -> bytes:
    """Return a module's object code for a machine of `TARGETS`."""
    return compile_text(text, TARGETS[target])
