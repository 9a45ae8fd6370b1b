"""Compilation of kernels, with a disk cache that cannot go stale.

Numba files a compiled function under the source of the *file that defines it*. If a helper in another file
changes, the caller is taken from the cache with the old helper inside. Here the cache of a file's kernels lies in a
folder named by a fingerprint of the file, of all sources from which it imports, and theirs, of the compiler's
versions, and of its settings, so that a change starts new folders for what it can reach, and only for that. Functions
from outside of the package are compiled in every process: what they reach is not known.

Rule for authors: whatever a kernel takes from other modules (helpers, constants) must come from a file that
counts as a source: one whose text imports ``spaces.jit``, one with ``kernels`` in its name, or one in this
folder.
"""

import hashlib
import os
import platform
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar, final

IMPORT = re.compile(r"^[ \t]*from (ephs[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
SETTINGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "USING_SVML")
"""What Numba reads from the environment and what changes the code that it makes."""
PACKAGE = Path(__file__).resolve().parents[2]
Function = TypeVar("Function", bound=Callable[..., Any])


@final
class KernelCacheWarning(UserWarning):
    """Compiled kernels cannot be kept on disk; every process compiles them anew."""


@final
@dataclass(frozen=True, slots=True)
class _Source:
    """What counts of a file, as it was when it was first asked for: that is what this process has imported."""

    digest: str
    reached: frozenset[Path]
    makes: bool


@cache
def _source(path: Path) -> _Source:
    content = path.read_bytes()
    inside = path.parent == PACKAGE / "semantics" / "spaces" or "kernels" in path.name
    makes = inside or b"spaces.jit" in content or b"spaces import jit" in content
    found: set[Path] = set()
    for module, names in IMPORT.findall(content.decode()):
        at = PACKAGE.parent.joinpath(*module.split("."))
        words = [name.split() for name in re.sub(r"#[^\n]*", "", names).strip("()").split(",")]
        within = [at / f"{name[0]}.py" for name in words if name]
        found |= {file for file in (at.with_suffix(".py"), at / "__init__.py", *within) if file.is_file()}
    return _Source(hashlib.sha256(content).hexdigest(), frozenset(found), makes)


def is_source(path: Path) -> bool:
    """Whether kernels are made from a file of the package."""
    return _source(path).makes


@cache
def sources_of(path: Path) -> tuple[Path, ...]:
    """A file, the sources that it reaches by imports, and what these import directly, in a fixed order."""
    found, rest = {path}, [path]
    while rest:
        for file in _source(rest.pop()).reached - found:
            found.add(file)
            if is_source(file):
                rest.append(file)
    return tuple(sorted(found))


@cache
def fingerprint(path: Path | None = None) -> str:
    """Name of the present state of a file's kernels, or of those that reach no file: sources, versions, settings."""
    versions = [import_module(name).__version__ for name in ("numba", "llvmlite", "numpy")]
    settings = [str(getattr(_numba().config, name, None)) for name in SETTINGS]
    digest = hashlib.sha256()
    digest.update(repr((platform.python_implementation(), platform.python_version(), versions, settings)).encode())
    for source in () if path is None else sources_of(path):
        digest.update(f"{source.relative_to(PACKAGE).as_posix()}:{_source(source).digest}:".encode())
    return digest.hexdigest()[:24]


@cache
def cache_folder(path: Path | None = None) -> Path | None:
    """Folder of the compiled kernels of a file of the package, or of those that reach no file. It need not exist.

    It lies below ``NUMBA_CACHE_DIR`` if that is set, else below ``XDG_CACHE_HOME`` or ``~/.cache``. None where there is
    no home.
    """
    given = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        base = Path(given) if given else Path.home() / ".cache"
    except RuntimeError:
        return None
    return base.absolute() / "ephs" / fingerprint(path)


def _numba() -> Any:
    # Imported when first needed; its settings have no types.
    return import_module("numba")


def _kept(function: Callable[..., Any], dispatcher: Any, text: str | None) -> Any:
    # Numba's own cache knows one file only, trusts what it finds there, and stops a run that cannot write.
    file = Path(function.__code__.co_filename).resolve()
    if text is not None or (file.is_relative_to(PACKAGE) and file.is_file()):
        from ephs.semantics.spaces.keeping import KernelFiles

        dispatcher._cache = KernelFiles(function, cache_folder(None if text is not None else file), text or "")
    return dispatcher


def compiling() -> bool:
    """Whether kernels are compiled at all (``NUMBA_DISABLE_JIT=1`` runs them as plain Python)."""
    return not _numba().config.DISABLE_JIT


def kernel(function: Function) -> Function:
    """Compile a function when first called: IEEE arithmetic, divisions as in NumPy, cached on disk."""
    if not compiling():
        return function
    return _kept(function, _numba().njit(fastmath=False, error_model="numpy")(function), None)


def lean_kernel(function: Function) -> Function:
    """Compile as `kernel` does a function that neither allocates, nor assigns whole arrays, nor returns one.

    Then references to arrays are not counted. To count them, for each call, for all arrays of the tables that it takes,
    costs more than a small mechanism's accelerations. Other threads go on meanwhile.
    """
    if not compiling():
        return function
    return _kept(function, _numba().njit(fastmath=False, error_model="numpy", nogil=True, _nrt=False)(function), None)


def cfunc_kernel(signature: Any, text: str | None = None) -> Callable[[Function], Function]:
    """Compile a function at once, to be called through its ``address`` from other kernels; cached on disk.

    Parameters
    ----------
    signature
        A Numba signature, such as ``"void(int64, CPointer(float64))"``.
    text
        The source of a function that is in no file, and that takes nothing of the package.

    Without compilation the function itself is returned; it then has no address.
    """

    def decorate(function: Function) -> Function:
        if not compiling():
            return function
        parsed = import_module("numba.core.sigutils").normalize_signature(signature)
        made = import_module("numba.core.ccallback").CFunc(function, parsed, {}, {"error_model": "numpy"})
        _kept(function, made, text).compile()
        return made

    return decorate
