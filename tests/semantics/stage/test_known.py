"""Results of staging on disk: the same as those that are made, gone with any change of what they were made of."""

import functools
import shutil
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

import numpy as np
import pytest

from ephs.mechanics.road.pack import TURN, Class
from ephs.mechanics.road.programs import Sweeps
from ephs.semantics.stage import Entry, Program, known, programs, vector
from ephs.semantics.stage.duals import Duals
from ephs.semantics.stage.elementary import cos, sin
from ephs.semantics.stage.kinds import matrix
from ephs.shipped import programs as shipped_programs

SHIPPED = {program.name: program for program in shipped_programs()}


def emitted(program, monkeypatch) -> tuple[object, int]:
    """What a process finds that has not staged the program, and how often it stages it."""
    count = []
    make = programs._emitted

    def counted(*arguments):
        count.append(1)
        return make(*arguments)

    with monkeypatch.context() as change:
        change.setattr(programs, "_emitted", counted)
        programs._staged.cache_clear()
        found = programs._staged(program, 1, ())
        programs._staged.cache_clear()
    return found, len(count)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_second_process_does_not_stage_and_finds_the_same(name, folder, monkeypatch):
    first, staged = emitted(SHIPPED[name], monkeypatch)
    second, again = emitted(SHIPPED[name], monkeypatch)
    assert (staged, again) == (1, 0)
    assert first == second


@pytest.mark.parametrize("edit", ["change", "add", "rename", "remove"])
def test_an_edited_source_ends_what_is_kept(edit, tmp_path, folder, monkeypatch):
    root = tmp_path / "sources"
    shutil.copytree(known.ROOT / "semantics" / "stage", root, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(known, "ROOT", root)
    known.sources.cache_clear()
    made = [known.known("of", lambda: "before") for _ in range(2)]
    match edit:
        case "change":
            file = root / "duals.py"
            file.write_bytes(file.read_bytes().replace(b"+", b"-", 1))
        case "add":
            (root / "more.py").touch()
        case "rename":
            (root / "duals.py").rename(root / "pairs.py")
        case _:
            (root / "duals.py").unlink()
    assert known.known("of", lambda: "after") == "before"  # a process goes on with what it has loaded
    known.sources.cache_clear()
    found = known.known("of", lambda: "after")
    known.sources.cache_clear()
    assert (made, found) == (["before", "before"], "after")


def test_a_foreign_function_is_staged_each_time(folder, monkeypatch):
    own = Program("own", entry=Entry(lambda on, x: x.__setitem__(0, on.sin(x[0])), x=vector(1)))
    assert [emitted(own, monkeypatch)[1] for _ in range(2)] == [1, 1]
    assert [emitted(own.tangent(), monkeypatch)[1] for _ in range(2)] == [1, 1]
    assert not folder.exists()
    library = Program("own", entry=Entry(sin, x=SHIPPED["ephs"].entries["sin"].kinds["x"]))  # the control
    assert [emitted(library, monkeypatch)[1] for _ in range(2)] == [1, 0]


def test_a_spoilt_file_is_made_anew(folder):
    assert known.known("of", lambda: [1.5]) == [1.5]
    (file,) = folder.iterdir()
    file.write_bytes(file.read_bytes()[:-1])
    assert [known.known("of", lambda: [2.5]) for _ in range(2)] == [[2.5], [2.5]]


class Colour(Enum):
    RED = 1
    BLUE = 2


@dataclass(frozen=True)
class Named:
    value: object
    note: str = field(default="", compare=False)


Colour.__module__ = Named.__module__ = known.__name__  # as if they were of the package


def bound(value):
    def function(on, x):
        return value

    function.__module__ = known.__name__
    return function


def of_package(function):
    function.__module__ = known.__name__
    return function


TWO = [of_package(one) for one in (lambda x: x + 1, lambda x: x - 1, lambda x: lambda: 1, lambda x: lambda: 2)]
DIFFERENT = [
    None, True, 1, 1.0, -0.0, 0.0, "1", b"1", (), [], {}, (1,), [1], (1, (2,)), ((1, 2),), (1, 2), ("1,2",), {1: 2},
    {2: 1}, float("inf"), np.nextafter(1.0, 2.0).item(), Colour.RED, Colour.BLUE, Named(1), Named((1,)), int, Class,
    Sweeps, sin, cos, bound(1), bound(2), bound(sin), bound(cos), *TWO, functools.partial(sin, 1),
    functools.partial(sin, 2), functools.partial(cos, 1), Entry(sin, x=vector()), Entry(sin, x=vector(1)),
    Entry(sin, x=vector(2)), Entry(sin, x=matrix(1)), Entry(sin, x=matrix(2)), Entry(cos, x=vector(1)),
    Entry(sin, x=vector()).tangent(), Entry(sin, x=vector()).tangent(directions=2), Entry(sin, x=vector()).taped(),
    Duals.__init__, np.zeros(2), np.zeros((2, 1)), np.zeros(2, int), np.array([0.0, -0.0]),
]  # fmt: skip


def test_what_differs_is_told_differently():
    told = [known._Teller().tell(value) for value in DIFFERENT]
    assert len(set(told)) == len(DIFFERENT)
    assert told == [known._Teller().tell(value) for value in DIFFERENT]


def test_what_is_equal_is_told_alike():
    pairs = [(Named(1, "one"), Named(1, "other")), (bound((1, 2.0)), bound((1, 2.0))), ([1, (2,)], [1, (2,)])]
    assert all(known._Teller().tell(one) == known._Teller().tell(other) for one, other in pairs)


@pytest.mark.parametrize("value", [object(), np.array([object()]), Path(), Named(object()), bound(object()), len, Path])
def test_what_the_sources_do_not_determine_is_not_told(value):
    with pytest.raises(known._Foreign):
        known._Teller().tell(value)


def test_sweeps_of_a_class_find_their_memory_without_a_survey(folder, monkeypatch):
    kinds = [Class((TURN,), planar) for planar in (True, False)]
    first = [Sweeps(kind, general=general) for kind in kinds for general in (True, False)]
    monkeypatch.setattr(Sweeps, "_survey", None)
    again = [Sweeps(kind, general=general) for kind in kinds for general in (True, False)]
    assert [sweeps._layout for sweeps in again] == [sweeps._layout for sweeps in first]
    assert len({sweeps.width for sweeps in first}) > 1
    assert [sweeps.program.text() for sweeps in again] == [sweeps.program.text() for sweeps in first]
    assert len({sweeps.program.text() for sweeps in first}) == len(first)
