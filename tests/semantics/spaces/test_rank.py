"""Rank and zero are decided by named thresholds, which lie in one module and each have a reason."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest

import ephs
from ephs.semantics.spaces import rank
from ephs.semantics.spaces.rank import rank_of

PACKAGE = Path(ephs.__file__).parent
LITERAL = re.compile(
    r"rcond=[\d.]|rank_of\(\w+, [\d.]|> [\d.]+e-\d+ \* (sigma|sizes|singular)|^(RANK|SINGULAR|NULL)\w* = ",
    re.MULTILINE,
)
THRESHOLDS = [name for name in vars(rank) if name.isupper()]


@pytest.mark.parametrize("name", THRESHOLDS)
def test_a_threshold_has_a_reason(name: str) -> None:
    body = ast.parse(Path(rank.__file__).read_text()).body
    at = next(i for i, s in enumerate(body) if isinstance(s, ast.Assign) and ast.unparse(s.targets[0]) == name)
    said = body[at + 1]
    assert isinstance(said, ast.Expr) and isinstance(said.value, ast.Constant) and len(str(said.value.value)) > 60
    assert 0.0 < getattr(rank, name) < 1e-3


@pytest.mark.parametrize("room", ["semantics", "mechanics"])
def test_no_other_file_decides_a_rank_by_a_number_of_its_own(room: str) -> None:
    files = sorted((PACKAGE / room).rglob("*.py"))
    assert not [str(f.relative_to(PACKAGE)) for f in files if LITERAL.search(f.read_text())]


def test_the_pattern_of_such_numbers_finds_them() -> None:
    for line in ("lstsq(a, b, rcond=1e-9)", "rank_of(s, 1e-9)", "np.sum(sigma > 1e-12 * sigma[0])", "RANK = 1e-9"):
        assert LITERAL.search(line)


def test_the_sparse_elimination_leaves_every_rank_to_the_dense_one() -> None:
    assert rank.EXPLICIT**2 < 1e-2 * rank.SPARSE


def test_rank_knows_no_unit() -> None:
    sizes = np.array([3.0, 1.0, 1e-5, 1e-12])
    for scale in 2.0 ** np.arange(-60, 61, 20):
        assert [rank_of(scale * sizes, part) for part in (rank.IMPLICIT, rank.EXPLICIT)] == [3, 2]
    assert rank_of(np.zeros(3), rank.IMPLICIT) == rank_of(np.zeros(0), rank.IMPLICIT) == 0
