"""What becomes of one input: a model, a clear error, or a defect of the program."""

import os
import re
import resource
import signal
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import final

import ephs
from ephs.mechanics.scene.load import load
from tests.fuzz.seeds import LEG, MESH

__all__ = ["LOAD_S", "MEMORY", "Judge", "Verdict", "bounded"]

LOAD_S = 2.0
"""Processor time in which an input is a model or an error."""
RUN_S = 20.0
"""… and in which a short run of it has ended."""
MEMORY = 1 << 30
"""Bytes that an input may take."""
LONGEST = 3000
"""Letters of a message's line."""
REFUSALS = (ephs.SimulationError, ephs.SceneError, ephs.AssemblyError, ephs.OptionError)


class _Late(BaseException):
    """Time is up; no `except Exception` may keep it."""


@final
@dataclass(frozen=True, slots=True)
class Verdict:
    """``"model"``, ``"error"`` or ``"defect"``; of a defect its signature, by which others are known to be the same."""

    outcome: str
    signature: str = ""
    detail: str = ""
    deep: bool = False


def bounded(more: int = MEMORY) -> None:
    """Let this process have so much more memory than it has now."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * os.sysconf("SC_PAGE_SIZE") + more, -1))


@contextmanager
def _timed(seconds: float) -> Iterator[None]:
    def late(_number: int, _frame: FrameType | None) -> None:
        raise _Late(f"{seconds:g} s")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@final
class Judge:
    """Reads inputs from a folder of its own, where other files lie that they may name."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "leg.toml").write_text(LEG)
        (folder / "mesh.stl").write_bytes(MESH)
        (folder / "sub").mkdir(exist_ok=True)
        if not (folder / "pipe.toml").exists():
            os.mkfifo(folder / "pipe.toml")

    def __call__(self, kind: str, data: bytes, deep: bool = False) -> Verdict:
        """What becomes of it; ``deep``: what is a model has to run as well, and to be written and read again."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                for told in (ephs.ModelWarning, ephs.SceneWarning):
                    warnings.simplefilter("ignore", told)
                return self._pattern(kind, data) if kind in ("json", "text") else self._scene(kind, data, deep)
        except (Exception, _Late, RecursionError, MemoryError) as error:
            return Verdict("defect", _signature(error), "".join(traceback.format_exception(error))[-4000:])

    def _pattern(self, kind: str, data: bytes) -> Verdict:
        with _timed(LOAD_S):
            try:
                if kind == "json":
                    found = ephs.Pattern.from_json(data)
                else:
                    found = ephs.Pattern.from_text(data.decode("utf-8", "replace"))
            except ephs.PatternError as error:
                return _checked(str(error).splitlines())
            again = ephs.Pattern.from_json(found.to_json()), ephs.Pattern.from_text(found.to_text())
            if not all(one == found for one in again):
                raise AssertionError("written and read again, it is another pattern")
        return Verdict("model")

    def _scene(self, kind: str, data: bytes, deep: bool) -> Verdict:
        file = self.folder / ("scene.toml" if kind == "toml" else f"model.{kind}")
        file.write_bytes(data)
        with _timed(LOAD_S):
            try:
                scene = load(file)
            except ephs.SceneError as error:
                if not all(fault.found and fault.expected for fault in error.faults) or not error.faults:
                    raise AssertionError(f"an error without words: {error.faults}") from error
                return _checked(str(error).splitlines())
            scene.system()
        if deep:
            with _timed(RUN_S):
                if kind != "toml":
                    self._converted(file)
                for options in ({"step": 1e-3, "method": "natural"}, {}):
                    try:
                        ephs.simulate(scene, 2e-3, max_steps=3, **options)
                    except REFUSALS as error:
                        _checked(str(error).splitlines())
        return Verdict("model", deep=deep)

    def _converted(self, file: Path) -> None:
        from ephs.mechanics.imports import convert

        target = self.folder / "converted.toml"
        convert(file, target)
        load(target)


def _checked(lines: list[str]) -> Verdict:
    """An error, if its words can be read."""
    if not any(lines):
        raise AssertionError("an error without words")
    for line in lines:
        if len(line) > LONGEST:
            raise AssertionError(f"a message of {len(line)} letters: {line[:200]!r}")
        if not line.isprintable():
            raise AssertionError(f"a message that is not printable: {line[:500]!r}")
    return Verdict("error")


def _signature(error: BaseException) -> str:
    """The error's kind, and where in this project it came up."""
    own = [
        f"{Path(frame.filename).stem}.{frame.name}"
        for frame in traceback.extract_tb(error.__traceback__)
        if "ephs" in Path(frame.filename).parts and "site-packages" not in frame.filename
    ]
    words = " " + re.sub(r"[^a-z]+", "-", str(error)[:30]) if isinstance(error, AssertionError) else ""
    return f"{type(error).__name__}{words} at {own[-1] if own else 'none'}"
