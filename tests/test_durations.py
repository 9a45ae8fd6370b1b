"""The list of long tests names tests, and short ones that are slow are named."""

import ast
from types import SimpleNamespace

from tests.durations import FILE, Durations, function_of, long_tests

ROOT = FILE.parents[1]


def test_every_long_test_is_there():
    for name in long_tests():
        path, *_, function = name.split("::")
        tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
        assert function in {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}, name


def test_parameters_are_no_part_of_a_test():
    assert function_of("tests/test_a.py::test_b[one-[two]]") == "tests/test_a.py::test_b"


def test_a_short_test_that_is_slow_is_named():
    """All parameters count together; what compiled programs was not measured; long tests may take long."""
    found = Durations(allowed=1.0)
    long = min(long_tests())
    for nodeid, time in (("a.py::b[1]", 0.7), ("a.py::b[2]", 0.7), ("a.py::c", -1.0), ("a.py::d", 0.9), (long, 9.0)):
        found.pytest_runtest_logreport(SimpleNamespace(nodeid=nodeid, processor=time))
    assert found.slow(1.0) == {"a.py::b": 1.4} and found.compiling == 1
    told = []
    found.pytest_terminal_summary(SimpleNamespace(line=lambda text, **_: told.append(text)))
    assert [text.partition(" ")[0] for text in told] == ["a.py::b"]
