"""Which test reaches which line, and how long it takes: kernels in plain Python, one process a test file."""

import hashlib
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from tests.mutate.mutants import ROOT, Mutant
from tests.mutate.server import forked, pytest_run


@dataclass(frozen=True, slots=True)
class Pace:
    """Seconds of a processor that tests may take, unchanged and watched.

    ``each``: a test, to be used at all; ``file``: after which no further test of a file is begun; ``budget``: all those
    together that a mutant has to live through.
    """

    each: float = 3.0
    file: float = 20.0
    budget: float = 8.0


class TooSlow(BaseException):
    """A test takes too long without compilation."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Seconds of each test that passes, and for each file the tests that reach each line.

    ``loading`` is the same of lines that run when the tests' file is loaded: what is made there all its tests may see.
    """

    seconds: dict[str, float]
    lines: dict[str, dict[int, set[str]]]
    loading: dict[str, dict[int, set[str]]]

    def tests(self, mutant: Mutant, budget: float, among: Iterable[str] = ("tests",)) -> list[str]:
        """The tests that reach a mutant's lines, quickest first, up to a sum of seconds.

        What runs when the package's own modules are loaded has no test of its own: there it is all that reach the file.
        """
        of, made = self.lines.get(mutant.file, {}), self.loading.get(mutant.file, {})
        lines = range(mutant.lines[0], mutant.lines[1] + 1)
        found: set[str] = set().union(*(of.get(line, set()) for line in lines))
        if not found or mutant.loading:
            found = set().union(*of.values())
        found = found.union(*(made.get(line, set()) for line in lines))
        chosen: list[str] = []
        total = 0.0
        for test in self._sorted(found, mutant, among):
            total += self.seconds[test]
            if total > budget and chosen:
                break
            chosen.append(test)
        return chosen

    def _sorted(self, tests: set[str], mutant: Mutant, among: Iterable[str]) -> list[str]:
        """Those at paths, quickest first, such as lie where the mutant's own tests lie as if they took half as long."""
        paths = tuple(among)
        own = f"tests/{mutant.file.removeprefix('ephs/').rpartition('/')[0]}/"
        inside = (test for test in tests if any(test.startswith((path + "/", path + "::")) for path in paths))
        return sorted(inside, key=lambda t: (self.seconds[t] * (0.5 if own in t else 1.0), t))


def digest(*files: Path) -> str:
    """Of the texts of files."""
    state = hashlib.sha256()
    for file in files:
        state.update(file.read_bytes())
    return state.hexdigest()[:16]


def files_at(paths: Iterable[str]) -> Iterator[Path]:
    """The test files at paths from the root."""
    for path in paths:
        at = ROOT / path
        yield from sorted(at.rglob("test_*.py")) if at.is_dir() else [at]


def reach(paths: Iterable[str], pace: Pace, folder: Path, say: Callable[[str], None], keep: bool = False) -> Reach:
    """Measure, or take from the folder what was measured of the same texts; ``keep``: of older sources, too."""
    sources = "" if keep else digest(*sorted((ROOT / "ephs").rglob("*.py")))
    seconds: dict[str, float] = {}
    lines: dict[str, dict[int, set[str]]] = {}
    loading: dict[str, dict[int, set[str]]] = {}
    folder.mkdir(parents=True, exist_ok=True)
    for file in dict.fromkeys(files_at(paths)):
        name = str(file.relative_to(ROOT))
        stored = folder / (name.replace("/", ".") + ".json")
        known = json.loads(stored.read_text()) if stored.is_file() else {}
        allowed = [pace.each, pace.file]
        if [known.get("test"), known.get("pace")] != [digest(file), allowed] or (
            sources and known.get("sources") != sources
        ):
            known = {"test": digest(file), "pace": allowed, "sources": sources, **_measured(name, pace)}
            stored.write_text(json.dumps(known))
            say(f"{name}: {len(known['seconds'])} tests, left out {known['left out']}")
        seconds |= known["seconds"]
        names = known["names"]
        for source, at in known["lines"].items():
            into = lines.setdefault(source, {})
            for line, tests in at.items():
                into.setdefault(int(line), set()).update(names[i] for i in tests)
        for source, at in known.get("loading", {}).items():
            into = loading.setdefault(source, {})
            for line in at:
                into.setdefault(line, set()).update(names)
    return Reach(seconds, lines, loading)


def _measured(name: str, pace: Pace) -> dict[str, Any]:
    def work(tell: Callable[[Any], None]) -> int:
        import coverage

        watched = coverage.Coverage(data_file=None, source=[str(ROOT / "ephs")])
        watched.start()
        plugin = _Watch(watched, pace)
        pytest_run([name, "--maxfail=100000"], [plugin])
        watched.stop()
        tell(plugin.found())
        return 0

    _, told = forked(work, 2.0 * pace.file)
    return (
        told[0]
        if told
        else {"seconds": {}, "names": [], "lines": {}, "loading": {}, "left out": ["all: the file takes too long"]}
    )


class _Nothing:
    """A store that keeps nothing."""

    def read(self, name: str) -> None:
        """Find nothing."""

    def write(self, name: str, content: bytes) -> None:
        """Keep nothing."""


class _Watch:
    """A plug-in: a context and a time for each test; each begins with empty caches."""

    def __init__(self, watched: Any, pace: Pace) -> None:
        self.watched = watched
        self.pace = pace
        self.seconds: dict[str, float] = {}
        self.bad: set[str] = set()
        self.end = time.process_time() + pace.file

    def pytest_runtest_protocol(self, item: Any) -> None:
        if time.process_time() > self.end:
            item.session.shouldstop = "no time is left for this file"
        self.watched.switch_context(item.nodeid)
        if (known := sys.modules.get("ephs.semantics.stage.known")) is not None:
            known.STORE = _Nothing()  # what is taken from the disk is not traced
        for module in [m for n, m in sys.modules.items() if n.startswith("ephs") and m is not None]:
            for value in list(vars(module).values()):
                clear = getattr(value, "cache_clear", None)
                if callable(clear):
                    clear()

    def pytest_runtest_call(self, item: Any) -> Any:
        inner = item.runtest

        def limited() -> None:
            begin = time.process_time()
            with _limit(self.pace.each):
                inner()
            self.seconds[item.nodeid] = round(time.process_time() - begin, 4)

        item.runtest = limited

    def pytest_runtest_logreport(self, report: Any) -> None:
        if not report.passed:
            self.bad.add(report.nodeid)
        if report.when == "teardown":
            self.watched.switch_context("")

    def found(self) -> dict[str, Any]:
        data = self.watched.get_data()
        good = {name: s for name, s in self.seconds.items() if name not in self.bad}
        names = sorted(good)
        number = {name: i for i, name in enumerate(names)}
        lines: dict[str, dict[int, list[int]]] = {}
        loading: dict[str, list[int]] = {}
        for file in data.measured_files():
            at = data.contexts_by_lineno(file)
            name = str(Path(file).relative_to(ROOT))
            reached = {line: sorted(number[c] for c in contexts if c in number) for line, contexts in at.items()}
            lines[name] = {line: tests for line, tests in reached.items() if tests}
            loading[name] = sorted(line for line, contexts in at.items() if "" in contexts)
        return {"seconds": good, "names": names, "lines": lines, "loading": loading, "left out": sorted(self.bad)}


@contextmanager
def _limit(seconds: float) -> Iterator[None]:
    def over(_signal: int, frame: FrameType | None) -> None:
        while frame is not None:
            if (
                f"{os.sep}coverage{os.sep}" in frame.f_code.co_filename
            ):  # it may hold a lock, and would keep it for ever
                signal.setitimer(signal.ITIMER_PROF, 0.01)
                return
            frame = frame.f_back
        raise TooSlow

    before = signal.signal(signal.SIGPROF, over)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
