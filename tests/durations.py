"""Which tests are long: `python -m tests.durations` runs them all in one process and writes down those.

What is written there is run by `make laws`, the rest by `make test`. Time is the processor's, of child processes too,
and that of all parameters of a test together, so that what else the machine does counts little.
"""

import os
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any, final

import pytest

__all__ = ["FILE", "LONG", "function_of", "long_tests"]

FILE = Path(__file__).with_name("long.txt")
LONG = 1.5
"""Processor time in s from which on a test is long."""


def function_of(nodeid: str) -> str:
    """A test without its parameters."""
    return nodeid.partition("[")[0]


def long_tests() -> frozenset[str]:
    """The tests that were long when they were measured."""
    return frozenset(FILE.read_text(encoding="utf-8").splitlines())


@final
class Durations:
    """Adds up the processor time of tests."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Any:
        """Add one."""
        before = sum(os.times()[:4])
        try:
            return (yield)
        finally:
            self.seconds[function_of(item.nodeid)] += sum(os.times()[:4]) - before


def main() -> int:
    """Measure, and write the file where all tests pass."""
    found = Durations()
    code = pytest.main(["-q", "-n", "0", "-m", "", *sys.argv[1:]], plugins=[found])
    if code == 0:
        named = sorted(name for name, seconds in found.seconds.items() if seconds > LONG)
        FILE.write_text("\n".join(named) + "\n", encoding="utf-8")
        print(f"{FILE}: {len(named)} of {len(found.seconds)} tests take more than {LONG} s")
    return int(code)


if __name__ == "__main__":
    sys.exit(main())
