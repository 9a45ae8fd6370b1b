"""Runs of chosen tests in forked processes that have loaded what is heavy, but nothing of the package."""

import contextlib
import hashlib
import importlib.abc
import importlib.machinery
import json
import math
import os
import resource
import signal
import sys
import time
import types
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from tests.mutate.mutants import ROOT, Mutant

HEAVY = (
    "coverage", "h5netcdf", "hypothesis.extra.numpy", "hypothesis.strategies", "mpmath", "networkx",
    "numpy", "pydantic", "pytest", "rich.console", "scipy.integrate", "scipy.optimize", "scipy.sparse.csgraph",
    "scipy.sparse.linalg", "scipy.spatial.transform", "sympy.printing.pycode", "xarray",
)  # fmt: skip
MEMORY = 12 << 30
"""Bytes that a process may use."""
EXAMPLES = 6
KNOWN, KNOWN_FILE = "ephs.semantics.stage.known", "ephs/semantics/stage/known.py"
SETTINGS = "_hypothesis_internal_use_settings"
"""Where Hypothesis keeps a test's own settings."""
WAITING = 6.0
"""How many times longer than its time on a processor a process may last."""


def preload() -> None:
    """Load what all tests use, once."""
    os.environ["HYPOTHESIS_NO_PLUGINS"] = "1"  # one of them is this package's
    for name in HEAVY:
        import_module(name)
    if loaded := [name for name in sys.modules if name == "ephs" or name.startswith("ephs.")]:
        raise RuntimeError(f"loaded before it is changed: {', '.join(loaded)}")


class Changed(importlib.abc.MetaPathFinder):
    """Finds one module, with other text; what is kept on disk by the digest of the sources is kept by this text."""

    def __init__(self, file: str, text: bytes) -> None:
        parts = Path(file).with_suffix("").parts
        self.module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        self.texts = {KNOWN: (str(ROOT / KNOWN_FILE), (ROOT / KNOWN_FILE).read_bytes())}
        self.texts[self.module] = (str(ROOT / file), text)
        digest = hashlib.sha256(file.encode() + text).hexdigest()
        path, known = self.texts[KNOWN]
        self.texts[KNOWN] = path, known + f"\n\ndef sources(root):\n    return {digest!r}\n".encode()

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> importlib.machinery.ModuleSpec | None:
        if fullname not in self.texts:
            return None
        file, text = self.texts[fullname]

        class Loader(importlib.machinery.SourceFileLoader):
            def get_code(self, fullname: str) -> types.CodeType:
                return compile(text, self.path, "exec", dont_inherit=True)

        found = importlib.machinery.ModuleSpec(
            fullname, Loader(fullname, file), origin=file, is_package=file.endswith("__init__.py")
        )
        found.has_location = True  # modules that look for files beside them know where they are
        return found


def forked(work: Callable[[Callable[[Any], None]], int], seconds: float) -> tuple[int | None, list[Any]]:
    """Run work(tell) in a process of its own, so many seconds of a processor at most.

    Returns the exit status, None where time was over, and what it told.
    """
    read, write = os.pipe()
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        os.close(read)
        os.setpgid(0, 0)
        status = 70
        try:
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(seconds), math.ceil(seconds)))
            with os.fdopen(write, "w") as pipe, open(os.devnull, "w") as null:
                os.dup2(null.fileno(), 1)
                if not os.environ.get("MUTATE_LOUD"):
                    os.dup2(null.fileno(), 2)

                def tell(value: Any) -> None:
                    pipe.write(json.dumps(value) + "\n")
                    pipe.flush()

                status = work(tell)
        finally:
            os._exit(status)
    os.close(write)
    told, status = _listen(read, child, time.monotonic() + WAITING * seconds)
    return None if status in (-signal.SIGXCPU, -signal.SIGKILL) else status, [
        json.loads(line) for line in told.splitlines()
    ]


def _listen(read: int, child: int, end: float) -> tuple[str, int | None]:
    import select

    pieces: list[bytes] = []
    over = False
    while True:
        left = end - time.monotonic()
        ready = select.select([read], [], [], max(left, 0.0))[0] if left > 0.0 else []
        if not ready:
            over = True
            break
        piece = os.read(read, 1 << 16)
        if not piece:
            break
        pieces.append(piece)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL) if over else None
    os.close(read)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    lines = b"".join(pieces).decode()
    return lines[: lines.rfind("\n") + 1], None if over else status


class Chosen:
    """A plug-in: keeps the tests with these names, in this order, and tells the first that fails, and why."""

    def __init__(self, names: Sequence[str], tell: Callable[[Any], None]) -> None:
        self.order = {name: i for i, name in enumerate(names)}
        self.tell = tell

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        items[:] = sorted((i for i in items if i.nodeid in self.order), key=lambda i: self.order[i.nodeid])

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed:
            crash = getattr(report.longrepr, "reprcrash", None)
            self.tell([report.nodeid, str(crash.message if crash else report.longrepr).split("\n")[0][:160]])

    def pytest_collectreport(self, report: Any) -> None:
        if report.failed:
            self.tell([report.nodeid, str(report.longrepr).strip().split("\n")[-1][:160]])


class Fewer:
    """A plug-in: of drawn examples only the first few, also where a test asks for more."""

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        from hypothesis import settings

        for item in items:
            function = getattr(item, "obj", None)
            if getattr(function, "is_hypothesis_test", False):
                asked = getattr(function, SETTINGS, None) or settings.default
                setattr(function, SETTINGS, settings(asked, max_examples=min(EXAMPLES, asked.max_examples)))


def pytest_run(arguments: Sequence[str], plugins: Sequence[Any]) -> int:
    """Pytest, with fewer examples."""
    import pytest

    import_module("ephs.plugin").register()
    return int(
        pytest.main(
            [
                "-q",
                "-x",
                "--tb=line",
                "--no-header",
                "--hypothesis-profile=mutate",
                *("-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:cov"),
                *("-W", "ignore::pytest.PytestAssertRewriteWarning"),
                *arguments,
            ],
            plugins=[Fewer(), *plugins],
        )
    )


def verdict(mutant: Mutant, tests: Sequence[str], seconds: float) -> dict[str, Any]:
    """Make the mutant, run the tests: killed by which and how, or survived."""
    begin = time.monotonic()
    text = mutant.text((ROOT / mutant.file).read_bytes())
    compile(text, mutant.file, "exec")  # fails where the file was edited since its mutants were listed

    def work(tell: Callable[[Any], None]) -> int:
        sys.meta_path.insert(0, Changed(mutant.file, text))
        files = list(dict.fromkeys(test.split("::")[0] for test in tests))
        return pytest_run(files, [Chosen(tests, tell)])

    status, told = forked(work, seconds) if tests else (0, [])
    spent = round(time.monotonic() - begin, 2)
    out: dict[str, Any] = {"name": mutant.name, "change": mutant.change, "tests": len(tests), "seconds": spent}
    if status == 0 or status == 5:  # pytest: all passed, nothing collected
        return out | {"killed": False}
    how = told[0] if told else ["", "time limit" if status is None else f"exit status {status}"]
    return out | {"killed": True, "by": how[0], "why": how[1]}
