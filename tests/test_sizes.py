"""Sizes by room, and names: what the package and its tests may grow to is written down, and lowered with each step."""

import ast
from collections import Counter, defaultdict

import pytest

from tests.rooms import ROOT, SOURCES, size_of

CEILINGS = {
    "ephs": 1_500,
    "ephs/cli": 12_700,
    "ephs/exporting": 14_200,
    "ephs/mechanics": 428_800,
    "ephs/modelica": 11_400,
    "ephs/operad": 30_600,
    "ephs/semantics": 196_700,
    "ephs/show": 64_900,
    "ephs/solve": 129_300,
    "ephs/templates": 200,
    "ephs/testing": 14_000,
    "tests": 554_900,
}
"""Room -> the most tokens, without comments, docstrings and layout."""
SLACK = 1_000
"""Tokens below its ceiling from which on a room's is to be lowered."""
SILENT = {"one", "of", "at", "put", "found", "look", "settle", "go", "do", "said", "led", "held", "way", "thing"}
"""Names of functions that do not say what comes out."""
MOST_SILENT = 109
"""Functions of such names, most of them constructors (`of`) and values at a place or time (`at`)."""


@pytest.fixture(scope="module")
def sources():
    return {file: file.read_text(encoding="utf-8") for file in SOURCES}


@pytest.mark.parametrize("top", ["ephs", "tests"])
def test_rooms_stay_below_their_ceilings(top):
    sizes = Counter()
    for file in sorted((ROOT / top).rglob("*.py")):
        parts = file.relative_to(ROOT).parts
        room = "/".join(parts[:2]) if top == "ephs" and len(parts) > 2 else top
        sizes[room] += size_of(file.read_text(encoding="utf-8"))
    ceilings = {room: most for room, most in CEILINGS.items() if room.split("/")[0] == top}
    assert set(sizes) == set(ceilings)
    above = {room: size for room, size in sizes.items() if size > ceilings[room]}
    assert not above, f"above their ceilings: {above}"
    loose = {room: size for room, size in sizes.items() if size < ceilings[room] - SLACK}
    assert not loose, f"ceilings to lower to these tokens: {loose}"


def test_comments_docstrings_and_layout_do_not_count():
    assert size_of("x = 1\n") == 3
    assert size_of('"""Text."""\n\n\ndef f():\n    """Text."""\n    return "text"  # why\n') == 7


def test_a_name_stands_for_one_class(sources):
    places = defaultdict(set)
    for file, source in sources.items():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.ClassDef):
                places[node.name.lstrip("_")].add(f"{file.relative_to(ROOT)}:{node.lineno}")
    assert not {name: found for name, found in places.items() if len(found) > 1}


def test_functions_say_what_comes_out(sources):
    found = [
        f"{file.relative_to(ROOT)}:{node.lineno}"
        for file, source in sources.items()
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef) and node.name.lstrip("_") in SILENT
    ]
    assert len(found) <= MOST_SILENT, found
