"""Compiled kernels on disk: a file for each kernel and signature, which is whole or counts as not there.

Numba's dispatchers ask an object like this for what was compiled before, and give it what they compile. A file begins
with the digest of the rest, and comes into being under its name in one move: what is cut short or spoilt is compiled
anew and replaced, and processes that compile the same kernel at the same time replace a file by its like. Folders of
earlier sources are removed when no process has used them for long.
"""

# Numba's compiled functions have no types.
# pyright: basic, reportPrivateImportUsage=false

import hashlib
import os
import pickle
import re
import shutil
import time
import uuid
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, final

from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from ephs.semantics.spaces.jit import KernelCacheWarning

__all__ = ["DISK", "KernelFiles"]

MARK = hashlib.sha256().digest_size
UNUSED = 30 * 86400.0
"""Seconds after which a folder that no process has used is removed."""


@final
@dataclass(slots=True)
class _Disk:
    """Whether this process still keeps what it compiles."""

    usable: bool = True

    def lose(self, fault: object) -> None:
        """Keep nothing from now on, and say so."""
        self.usable = False
        warnings.warn(
            f"compiled kernels cannot be kept on disk ({fault}). This run goes on, and every further one compiles them "
            "anew, which takes minutes. Set XDG_CACHE_HOME to a folder that can be written and has room.",
            KernelCacheWarning,
            stacklevel=2,
        )


DISK = _Disk()


@final
class KernelFiles:
    """The files of one kernel, in the place of Numba's cache.

    Parameters
    ----------
    function
        The kernel as it is written.
    folder
        Where its files lie, named by all that it reaches. None: nowhere.
    text
        What else tells it from others.
    """

    __slots__ = ("_folder", "_name", "_text")

    def __init__(self, function: Callable[..., Any], folder: Path | None, text: str) -> None:
        name = f"{function.__module__}.{function.__qualname__}-{function.__code__.co_firstlineno}"
        self._name = name.replace("<", "").replace(">", "")
        self._folder, self._text = folder, text

    @property
    def cache_path(self) -> str | None:
        """The folder, for the dispatcher's statistics."""
        return None if self._folder is None else str(self._folder)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was compiled for a signature on such a processor, or None."""
        target_context.refresh()
        if self._folder is None:
            return None
        key = self._key(sig, target_context.codegen())
        try:
            content = self._file(self._folder, key).read_bytes()
        except OSError:
            return None
        if hashlib.sha256(content[MARK:]).digest() != content[:MARK]:
            return None
        _use(self._folder)
        found, payload = pickle.loads(content[MARK:])
        return CompileResult._rebuild(target_context, *payload) if found == key else None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled, where it can be kept."""
        if not DISK.usable or data.library.has_dynamic_globals:  # addresses of this process say nothing to others
            return
        if self._folder is None:
            DISK.lose("there is no home folder")
            return
        key = self._key(sig, data.codegen)
        body = dumps((key, data._reduce()))
        file = self._file(self._folder, key)
        scratch = file.with_name(f"{file.name}.{uuid.uuid4().hex}.tmp")
        try:
            if not self._folder.is_dir():
                _prune(self._folder.parent)
            self._folder.mkdir(parents=True, exist_ok=True)
            _use(self._folder)
            scratch.write_bytes(hashlib.sha256(body).digest() + body)
            scratch.replace(file)
        except OSError as fault:
            with suppress(OSError):
                scratch.unlink(missing_ok=True)
            DISK.lose(fault)

    def flush(self) -> None:
        """Forget the kernel: the next call compiles it anew."""
        if self._folder is not None:
            for file in self._folder.glob(f"{self._name}-*.kernel"):
                file.unlink(missing_ok=True)

    def _key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        return sig, codegen.magic_tuple(), self._text

    def _file(self, folder: Path, key: tuple[Any, ...]) -> Path:
        return folder / f"{self._name}-{hashlib.sha256(repr(key).encode()).hexdigest()[:24]}.kernel"


@cache
def _use(folder: Path) -> None:
    """Mark a folder as used, once in a process; one that can only be read stays as it is."""
    with suppress(OSError):
        os.utime(folder)


@cache
def _prune(base: Path) -> None:
    """Remove the folders in which kernels lie that nobody has used for long, once in a process."""
    with suppress(OSError):
        for folder in base.iterdir():
            named = re.fullmatch(r"[0-9a-f]{24}", folder.name) is not None
            if named and not folder.is_symlink() and time.time() - folder.stat().st_mtime > UNUSED:
                shutil.rmtree(folder, ignore_errors=True)
