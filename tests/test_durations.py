"""The list of long tests names tests."""

import ast

from tests.durations import FILE, function_of, long_tests

ROOT = FILE.parents[1]


def test_every_long_test_is_there():
    for name in long_tests():
        path, *_, function = name.split("::")
        tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
        assert function in {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}, name


def test_parameters_are_no_part_of_a_test():
    assert function_of("tests/test_a.py::test_b[one-[two]]") == "tests/test_a.py::test_b"
