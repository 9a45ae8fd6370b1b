"""What cannot be staged is refused by name: the function, its line, what to write instead."""

import gc
import math
import pickle
import weakref

import numpy as np
import pytest

from ephs.semantics.stage import Entry, Program, Record, StageError, integer, real, reals, staged, table, vector
from ephs.semantics.stage.errors import TEXTS


class Pair(Record):
    place = reals(2)
    count = integer()


@staged
def endless(on, x):
    return endless(on, x)


def grow(on, x):
    while True:
        x = x * x


KINDS = {"x": real(), "i": integer(), "v": vector(), "t": table(Pair)}
FAULTS = {
    "if": (lambda on, x, i, v, t: 1.0 if x < 0.0 else 2.0, "a condition that is not known"),
    "and": (lambda on, x, i, v, t: x < 0.0 and x > 1.0, "on.both, on.either and on.negate"),
    "max": (lambda on, x, i, v, t: max(x, 1.0), "a condition that is not known"),
    "equality": (lambda on, x, i, v, t: x == 1.0, "not compared for equality"),
    "float": (lambda on, x, i, v, t: math.sin(x), "take on.sqrt, on.sin"),
    "int": (lambda on, x, i, v, t: int(x), "take on.integer"),
    "list": (lambda on, x, i, v, t: [1.0, 2.0][i], "take a Vector or Integers, and on.loop"),
    "range": (lambda on, x, i, v, t: list(range(i)), "take a Vector or Integers, and on.loop"),
    "power": (lambda on, x, i, v, t: x**2, "write products"),
    "abs": (lambda on, x, i, v, t: abs(x), "take on.absolute"),
    "mixed": (lambda on, x, i, v, t: x * i, "An integer becomes real by on.real"),
    "numpy": (lambda on, x, i, v, t: x + "1", "both sides are real numbers"),
    "field": (lambda on, x, i, v, t: t[i].palce, "Pair has no field palce; its fields are place, count"),
    "write": (lambda on, x, i, v, t: setattr(t[i], "palce", 1.0), "Pair has no field palce"),
    "shape": (lambda on, x, i, v, t: setattr(t[i], "place", [x]), "field place has shape (2,), found 1"),
    "keyword": (lambda on, x, i, v, t: endless(on, x=x), "arguments by position"),
    "recursion": (lambda on, x, i, v, t: endless(on, x), "calls itself"),
    "endless": (lambda on, x, i, v, t: grow(on, x), "more than 300000 operations"),
    "result": (lambda on, x, i, v, t: [x, x], "returns list, expected None"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_cannot_be_staged_says_so(fault):
    function, text = FAULTS[fault]
    with pytest.raises(StageError) as error:
        Program("fault", fault=Entry(function, **KINDS)).text()
    assert text in str(error.value)
    if fault != "result":
        assert "test_errors.py:" in str(error.value)


def test_a_number_of_another_function_is_refused():
    kept = []

    @staged
    def inner(on, x):
        kept.append(x)
        return x * 2.0

    def outer(on, x):
        return inner(on, x) + kept[0]

    with pytest.raises(StageError, match=r"a number of inner\.\d+ is used in one_outer; hand it over"):
        Program("one", outer=Entry(outer, x=real())).text()


@pytest.mark.parametrize("side_by_side", [True, False])
def test_members_do_not_branch(side_by_side):
    def branch(on, x, out):
        on.when(x[0] > 0.0, lambda: None)

    program = Program("members", branch=Entry(branch, x=vector(), out=vector()))
    with pytest.raises(StageError, match=r"on.when depends on a condition .* for all members; write on.select"):
        if side_by_side:
            program.compiled(members=4)
        else:
            program.arrays()["branch"](np.ones((1, 3)), np.ones((1, 3)))


@pytest.mark.parametrize("side_by_side", [True, False])
def test_members_do_not_write_to_what_they_share(side_by_side):
    program = Program("shares", copy=Entry(lambda on, x, out: out.__setitem__(0, x[0]), x=vector(), out=vector()))
    with pytest.raises(StageError, match="stored in memory that they share"):
        if side_by_side:
            program.compiled(members=2, shared=("out",))
        else:
            program.arrays()["copy"](np.ones((1, 3)), np.ones(1))


def test_memory_is_not_iterated():
    with pytest.raises(TypeError, match="not iterable"):
        Program("iterates", sum=Entry(lambda on, x: sum(x), x=vector())).text()


def test_kinds_have_the_names_of_the_arguments():
    with pytest.raises(StageError, match="takes x, y, found x"):
        Entry(lambda on, x, y: x, x=real())


def test_a_program_has_entries():
    with pytest.raises(StageError, match="program empty: found none"):
        Program("empty")


def test_an_error_survives_pickling():
    with pytest.raises(StageError) as error:
        Program("empty")
    assert str(pickle.loads(pickle.dumps(error.value))) == str(error.value)


def test_a_bound_call_keeps_its_arrays_and_refuses_other_numbers():
    calls = Program("bound", read=Entry(lambda on, x, k: x[0] * k, x=vector(), k=real())).compiled()
    array = np.full(3, 2.0)
    gone = weakref.ref(array)
    bound = calls["read"].bind(array, 5.0)
    del array
    gc.collect()
    assert gone() is not None
    assert bound() == 10.0 and bound(7.0) == 14.0
    with pytest.raises(StageError, match="takes 1 numbers, found 2"):
        bound(1.0, 2.0)
    del bound
    gc.collect()
    assert gone() is None


def test_calls_share_first_arguments_that_are_checked_once():
    kinds = {"x": vector(), "y": vector(), "k": real()}
    entries = {
        "once": Entry(lambda on, x, y, k: x[0] * y[0] * k, **kinds),
        "twice": Entry(lambda on, x, y, k: 2.0 * x[0] * y[0] * k, **kinds),
    }
    calls = Program("shares_first", **entries, other=Entry(lambda on, x: x[0], x=vector())).compiled()
    x, y = np.full(2, 3.0), np.full(2, 5.0)
    first = calls["once"].first(x)
    for name in ("once", "twice"):
        bound, whole = calls[name].bind(y, 7.0, first=first), calls[name].bind(x, y, 7.0)
        assert bound() == whole() and bound(2.0) == whole(2.0) == (1 + (name == "twice")) * 30.0
    with pytest.raises(StageError, match="first arguments of the same kinds"):
        calls["other"].bind(first=first)
    with pytest.raises(StageError, match="memory"):
        calls["once"].bind(x, 7.0, first=first)
    with pytest.raises(StageError, match=r"2 arguments \(y, k\)"):
        calls["once"].bind(y, first=first)


def test_every_text_is_one_line_with_a_place():
    assert all("{where}" in text and "\n" not in text for text in TEXTS.values())
