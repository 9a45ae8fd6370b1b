"""Object code and results of staging on disk: one file for each; incomplete files count as absent.

A file begins with the digest of its content and gets its name in one move. So a file that is cut short or spoilt is
compiled anew and replaced, and processes that compile the same module at once replace a file by its like.
"""

import hashlib
import os
import time
import uuid
import warnings
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final, final

MARK: Final = hashlib.sha256().digest_size
UNUSED: Final = 30 * 86400.0
"""Seconds after which a file that no process has used is removed."""


@final
class ObjectCacheWarning(UserWarning):
    """Object code cannot be cached on disk; every process compiles it again."""


@final
@dataclass(slots=True)
class _Store:
    """Files of object code in a folder.

    Attributes
    ----------
    usable
        Whether this process still writes; one fault ends that, with one warning.
    """

    usable: bool = True

    def read(self, name: str) -> bytes | None:
        """Return the content under a name, or None if it is absent or incomplete."""
        folder = folder_of()
        if folder is None:
            return None
        file = folder / name
        try:
            content = file.read_bytes()
        except OSError:
            return None
        if hashlib.sha256(content[MARK:]).digest() != content[:MARK]:
            return None
        with suppress(OSError):  # a folder that can only be read stays as it is
            os.utime(file)
        return content[MARK:]

    def write(self, name: str, content: bytes) -> None:
        """Store content under a name, if the cache is writable."""
        if not self.usable:
            return
        folder = folder_of()
        if folder is None:
            self._lose("there is no home folder")
            return
        scratch = folder / f"{name}.{uuid.uuid4().hex}.tmp"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            scratch.write_bytes(hashlib.sha256(content).digest() + content)
            scratch.replace(folder / name)
        except OSError as fault:
            with suppress(OSError):
                scratch.unlink(missing_ok=True)
            self._lose(fault)
            return
        _prune(folder)

    def _lose(self, fault: object) -> None:
        self.usable = False
        warnings.warn(
            f"object code cannot be kept on disk ({fault}). This run goes on, and every further one compiles it anew. "
            "Set XDG_CACHE_HOME to a folder that can be written and has room.",
            ObjectCacheWarning,
            stacklevel=2,
        )


STORE: Final = _Store()
"""The store of this process."""


def folder_of() -> Path | None:
    """Return the folder below ``XDG_CACHE_HOME``, else ``~/.cache``; it need not exist. None: there is no home."""
    given = os.environ.get("XDG_CACHE_HOME")
    try:
        base = Path(given) if given else Path.home() / ".cache"
    except RuntimeError:
        return None
    return base.absolute() / "ephs" / "objects"


@cache
def _prune(folder: Path) -> None:
    """Remove files that no process has used for long, once in a process."""
    with suppress(OSError):
        for file in folder.iterdir():
            if time.time() - file.stat().st_mtime > UNUSED:
                file.unlink(missing_ok=True)
