"""Compilation of kernels, with a disk cache that cannot go stale.

Numba files a compiled function under the source of the *file that defines it*. If a helper in another file
changes, the caller is taken from the cache with the old helper inside. Here the cache of a file's kernels lies in a
folder named by a fingerprint of the file, of all sources from which it imports, and theirs, and of the compiler's
versions, so that a change starts new folders for what it can reach, and only for that.

Rule for authors: whatever a kernel takes from other modules (helpers, constants) must come from a file that
counts as a source: one whose text imports ``spaces.jit``, one with ``kernels`` in its name, or one in this
folder.
"""

import hashlib
import os
import platform
import re
import tempfile
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar, final

IMPORT = re.compile(r"^\s*from (ephs[\w.]*) import \(?([^()\n]*)", re.MULTILINE)
Function = TypeVar("Function", bound=Callable[..., Any])


@final
class KernelCacheWarning(UserWarning):
    """Compiled kernels cannot be kept on disk; every process compiles them anew."""


def kernel_sources(package: Path | None = None) -> tuple[Path, ...]:
    """All files of the package from which kernels are made, in a fixed order."""
    here = Path(__file__).resolve().parent
    root = here.parents[1] if package is None else package
    return tuple(path for path in sorted(root.rglob("*.py")) if _is_source(path, here))


def _is_source(path: Path, here: Path) -> bool:
    if path.parent == here or "kernels" in path.name:
        return True
    content = path.read_bytes()
    return b"spaces.jit" in content or b"spaces import jit" in content


@cache
def _reached(path: Path) -> frozenset[Path]:
    """The files of the package that a file imports directly."""
    root = Path(__file__).resolve().parents[3]
    found: set[Path] = set()
    for module, names in IMPORT.findall(path.read_text(encoding="utf-8")):
        at = root.joinpath(*module.split("."))
        inside = [at / f"{name.strip().split(' ')[0]}.py" for name in names.split(",")]
        found |= {file for file in (at.with_suffix(".py"), at / "__init__.py", *inside) if file.is_file()}
    return frozenset(found)


@cache
def sources_of(path: Path) -> tuple[Path, ...]:
    """A file, the sources that it reaches by imports, and what these import directly, in a fixed order."""
    here = Path(__file__).resolve().parent
    found, rest = {path}, [path]
    while rest:
        for file in _reached(rest.pop()) - found:
            found.add(file)
            if _is_source(file, here):
                rest.append(file)
    return tuple(sorted(found))


@cache
def fingerprint(path: Path | None = None) -> str:
    """Name of the present state of a file's kernels, or of all: their sources, Numba, LLVM's binding, NumPy, Python."""
    versions = [import_module(name).__version__ for name in ("numba", "llvmlite", "numpy")]
    digest = hashlib.sha256()
    digest.update(repr((platform.python_implementation(), platform.python_version(), versions)).encode())
    root = Path(__file__).resolve().parents[2]
    for source in kernel_sources() if path is None else sources_of(path):
        content = source.read_bytes()
        digest.update(f"{source.relative_to(root).as_posix()}:{len(content)}:".encode())
        digest.update(content)
    return digest.hexdigest()[:24]


@cache
def cache_folder(path: Path | None = None) -> Path | None:
    """Folder of the compiled kernels of a file of the package, or of what is generated from all.

    None, after one warning, where it cannot be written. It lies below ``NUMBA_CACHE_DIR`` if that is set, else below
    ``XDG_CACHE_HOME`` or ``~/.cache``.
    """
    base = _base()
    if base is None:
        return None
    folder = base / fingerprint(path)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@cache
def _base() -> Path | None:
    given = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        folder = (Path(given) if given else Path.home() / ".cache") / "ephs"
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, RuntimeError) as fault:
        warnings.warn(
            f"the folder for compiled kernels cannot be written ({fault}); every run compiles them anew. "
            "Set XDG_CACHE_HOME to a folder that can be written.",
            KernelCacheWarning,
            stacklevel=2,
        )
        return None
    return folder


def _numba() -> Any:
    # Imported when first needed; its settings have no types.
    return import_module("numba")


@contextmanager
def _caching(function: Callable[..., Any]) -> Generator[bool, None, None]:
    # Numba chooses a function's cache folder when it is decorated, from this setting, and keeps it.
    # It refuses to cache what has no source file, such as functions typed at a prompt.
    settings = _numba().config
    file = Path(function.__code__.co_filename)
    inside = file.resolve().is_relative_to(Path(__file__).resolve().parents[2])
    folder = cache_folder(file.resolve() if inside else None) if file.is_file() else None
    before = settings.CACHE_DIR
    settings.CACHE_DIR = before if folder is None else str(folder)
    try:
        yield folder is not None
    finally:
        settings.CACHE_DIR = before


def compiling() -> bool:
    """Whether kernels are compiled at all (``NUMBA_DISABLE_JIT=1`` runs them as plain Python)."""
    return not _numba().config.DISABLE_JIT


def kernel(function: Function) -> Function:
    """Compile a function when first called: IEEE arithmetic, divisions as in NumPy, cached on disk."""
    if not compiling():
        return function
    with _caching(function) as cached:
        return _numba().njit(cache=cached, fastmath=False, error_model="numpy")(function)


def lean_kernel(function: Function) -> Function:
    """Compile as `kernel` does a function that neither allocates, nor assigns whole arrays, nor returns one.

    Then references to arrays are not counted. To count them, for each call, for all arrays of the tables that it takes,
    costs more than a small mechanism's accelerations. Other threads go on meanwhile.
    """
    if not compiling():
        return function
    with _caching(function) as cached:
        return _numba().njit(cache=cached, fastmath=False, error_model="numpy", nogil=True, _nrt=False)(function)


def cfunc_kernel(signature: Any) -> Callable[[Function], Function]:
    """Compile a function at once, to be called through its ``address`` from other kernels; cached on disk.

    Parameters
    ----------
    signature
        A Numba signature, such as ``"void(int64, CPointer(float64))"``.

    Without compilation the function itself is returned; it then has no address.
    """

    def decorate(function: Function) -> Function:
        if not compiling():
            return function
        with _caching(function) as cached:
            return _numba().cfunc(signature, cache=cached, error_model="numpy")(function)

    return decorate
