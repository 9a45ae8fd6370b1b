"""Identity of a run's journal: model, options, and programs."""

import hashlib
import platform
import sys
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from importlib.metadata import version
from os import PathLike
from typing import Any

import numpy as np

from ephs.mechanics.runs.functions import function_digest
from ephs.operad import Path
from ephs.solve.posing.problem import Problem
from ephs.solve.running.journal import Journal, Written

_PROGRAMS = ("ephs", "numpy", "scipy", "llvmlite")


@contextmanager
def journaled(
    journal: "Journal | str | PathLike[str] | None", problem: Problem, asked: Mapping[str, Any]
) -> Generator[Written | None, None, None]:
    """The journal of a run, open during the run; None without a path.

    Raises
    ------
    OptionError
        The file is no journal, is another run's, or is being written by another process.
    """
    given = Journal.of(journal)
    if given is None:
        yield None
        return
    written = given.open(heading_of(problem, asked))
    try:
        yield written
    finally:
        written.close()


def heading_of(problem: Problem, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Heading of a journal: only the same run with the same versions resumes to the same numbers.

    Functions are told by their names and by what they compute, see `function_digest`.
    """
    programs = {name: version(name) for name in _PROGRAMS}
    machine = f"{platform.system()} {platform.machine()}"
    return {
        "name": problem.name,
        "model": problem.document(),
        "run": {
            **{key: _plain(value) for key, value in asked.items()},
            "model": _digest(problem),
            "programs": {**programs, "python": ".".join(map(str, sys.version_info[:3])), "machine": machine},
        },
    }


def _digest(problem: Problem) -> str:
    """Digest of every component with its numbers, the initial states and the surroundings."""
    d = problem.descriptor
    parts: list[Any] = [problem.document(), problem.reference]
    for slot in d.components:
        part, kernel = slot.primitive, slot.primitive.kernel
        found = [getattr(part, each.name) for each in fields(part)] if kernel is None else []
        numbers = (kernel.name, kernel.parameters) if kernel is not None else [_plain(f) for f in found if callable(f)]
        parts.append((str(slot.path), part.name, part.parameters, numbers))
    for path, signal in sorted(problem.signals.items()):
        parts.append((str(path), _plain(signal.value), signal.effort))
    made = hashlib.blake2b(repr(parts).encode(), digest_size=16)
    made.update(problem.point.tobytes())
    return made.hexdigest()


def _plain(value: Any) -> Any:
    """The value for JSON; long arrays as digests."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist()) if value.size <= 16 else f"{value.shape} {_sum(value)}"
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return value.item()
    if value is None or isinstance(value, str | int | float | bool):
        return value
    if isinstance(value, Path):
        return str(value)
    if callable(value):
        name = f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', type(value).__name__)}"
        return f"{name} {function_digest(value)}"
    if is_dataclass(value):
        told = {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
        return f"{type(value).__name__} {told}"  # a text, as of functions, which tells inputs from numbers
    return type(value).__name__


def _sum(value: Any) -> str:
    return hashlib.blake2b(np.ascontiguousarray(value).tobytes(), digest_size=16).hexdigest()
