"""Which tests are long: `python -m tests.durations` measures the short tests anew and writes down those that are not.

A long test is run by `make laws`, all others by `make test`. Time is the processor's, of child processes too, and that
of all parameters of a test together, so that what else the machine does counts little. Programs that several tests
share are compiled by the first of them: an item during which something is compiled is not measured, so that a second
run measures all. `python -m tests.durations --all` measures the long tests too, and drops those that have become short.
"""

import json
import os
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any, Final, final

import pytest

from ephs.semantics.stage.store import folder_of

__all__ = ["ALLOWED", "FILE", "LONG", "Durations", "function_of", "long_tests"]

FILE: Final = Path(__file__).with_name("long.txt")
LONG: Final = 1.5
"""Processor time in s from which on a test is long."""
ALLOWED: Final = 8 * LONG
"""Processor time in s from which a session names a short test: what tests share falls on the first."""


def function_of(nodeid: str) -> str:
    """A test without its parameters."""
    return nodeid.partition("[")[0]


def long_tests() -> frozenset[str]:
    """The tests that were long when they were measured."""
    return frozenset(FILE.read_text(encoding="utf-8").splitlines())


@final
class Durations:
    """Adds up the processor time of tests, also where workers run them, and names the short ones that are slow.

    It fails none: what is measured hangs on the machine, and on what else runs there.
    """

    def __init__(self, allowed: float = ALLOWED) -> None:
        self.allowed = allowed
        self.seconds: dict[str, float] = defaultdict(float)
        self.compiling = 0
        self._last, self._kept = 0.0, 0

    def pytest_runtest_logstart(self) -> None:
        """Start the clock of one item."""
        self._last, self._kept = sum(os.times()[:4]), _kept()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Any:
        """Write the time of one phase into its report, which workers send on."""
        report = yield
        now = sum(os.times()[:4])
        report.processor, self._last = (now - self._last if _kept() == self._kept else -1.0), now
        return report

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Add the time of one phase."""
        self.seconds[function_of(report.nodeid)] += max(report.processor, 0.0)
        self.compiling += report.processor < 0.0

    def slow(self, limit: float) -> dict[str, float]:
        """The short tests that took more than a limit."""
        long = long_tests()
        return {name: time for name, time in sorted(self.seconds.items()) if time > limit and name not in long}

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Name the slow ones."""
        for name, time in self.slow(self.allowed).items():
            terminalreporter.line(
                f"{name} took {time:.1f} s of processor time, more than {self.allowed}: "
                "make it cheaper, or measure anew by python -m tests.durations",
                yellow=True,
            )


def _kept() -> int:
    """When a compiled program was last kept on disk, in ns."""
    folder = folder_of()
    return folder.stat().st_mtime_ns if folder is not None and folder.is_dir() else 0


def main(arguments: list[str]) -> int:
    """Measure, and write the file where all tests pass and all were measured."""
    found = Durations(allowed=float("inf"))
    kept = "" if "--all" in arguments else " and not long"
    rest = [one for one in arguments if one != "--all"]
    os.environ["EPHS_LLVM_LEVEL"] = "0"
    code = pytest.main(["-q", "-n", "0", "-m", "not optimised" + kept, *rest], plugins=[found])
    print(json.dumps(dict(sorted(found.seconds.items(), key=lambda item: -item[1])[:200]), indent=1))
    if found.compiling:
        print(f"{found.compiling} parts of tests compiled programs, and were not measured: run this again")
    elif code == 0:
        longer = {name for name, time in found.seconds.items() if time > LONG}
        named = longer | {name for name in long_tests() if name not in found.seconds}
        FILE.write_text("\n".join(sorted(named)) + "\n", encoding="utf-8")
        print(f"{FILE}: {len(named)} tests take more than {LONG} s; {sum(found.seconds.values()):.0f} s in all")
    return int(code)


if __name__ == "__main__":
    from tests import durations  # the module whose class tests/conftest.py knows

    sys.exit(durations.main(sys.argv[1:]))
