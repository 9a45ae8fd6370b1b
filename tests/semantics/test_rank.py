"""Thresholds of rank come from one module: no call decides rank by a number of its own."""

import ast
import itertools
from pathlib import Path

import pytest

from ephs.semantics.spaces import rank

ROOT = Path(rank.__file__).parents[2]


def strays(source):
    """Lines that give `rank_of` or ``rcond`` anything but a name, or None for what has full rank."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
        given = [keyword.value for keyword in node.keywords if keyword.arg in {"rcond", "tol"} and name != "solve"]
        given += node.args[1:2] if name == "rank_of" else []
        found += [
            each.lineno
            for each in given
            if not (isinstance(each, ast.Name) or (isinstance(each, ast.Constant) and each.value is None))
        ]
        found += [node.lineno] if name == "matrix_rank" else []
    return found


def test_rank_is_decided_by_named_thresholds():
    found = {file.relative_to(ROOT): strays(file.read_text(encoding="utf-8")) for file in sorted(ROOT.rglob("*.py"))}
    assert not {file: lines for file, lines in found.items() if lines}


@pytest.mark.parametrize("line", ["rank_of(s, 1e-9)", "np.linalg.pinv(a, rcond=1e-8)", "np.linalg.matrix_rank(a)"])
def test_a_number_of_its_own_is_found(line):
    assert strays(line) == [1]


def test_each_threshold_has_its_reason():
    body = ast.parse(Path(rank.__file__).read_text(encoding="utf-8")).body
    for node, after in itertools.pairwise(body):
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant):
            assert isinstance(after, ast.Expr), ast.unparse(node)
