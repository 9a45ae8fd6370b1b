"""One function, run with floats and as machine code: the same bits."""

import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from threading import Barrier
from typing import Annotated

import numpy as np
import pytest

from ephs.semantics.stage import (
    Entry,
    Evaluator,
    Integer,
    Integers,
    Matrix,
    Program,
    Real,
    Record,
    StageError,
    Table,
    Vector,
    group,
    indices,
    integer,
    matrix,
    real,
    table,
    vector,
)


def whole(on: Evaluator, i: Integer, j: Integer) -> Integer:
    return (i // j) * 1000 + i % j


PROGRAM = Program(
    "tried",
    taken=Entry(lambda on, a, x, pivots: 0, a=matrix(), x=vector(), pivots=indices()),
    whole=Entry(whole, i=integer(), j=integer()),
)


@pytest.fixture(params=["compiled", "plain"])
def run(request):
    return PROGRAM.compiled() if request.param == "compiled" else PROGRAM.plain()


@pytest.mark.parametrize("i", [-7, -6, 0, 6, 7])
@pytest.mark.parametrize("j", [-3, 2, 3])
def test_integers_divide_as_in_python(run, i, j):
    assert run["whole"](i, j) == (i // j) * 1000 + i % j


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((np.eye(2), np.ones(2)), "<lambda>: takes 3 arguments"),
        ((np.eye(2, dtype=np.float32), np.ones(2), np.zeros(2, int)), "argument a is an array of float32"),
        ((np.eye(4)[:, ::2], np.ones(2), np.zeros(2, int)), "argument a is a non-contiguous"),
        ((np.eye(2), np.ones((2, 1)), np.zeros(2, int)), "argument x is an array of float64 of shape (2, 1)"),
        ((np.eye(2), np.ones(2), np.zeros(2)), "argument pivots"),
        ((shared := np.eye(2), shared[1], np.zeros(2, int)), "arguments a and x share memory"),
    ],
)
def test_wrong_arguments_are_named(run, arguments, text):
    with pytest.raises(StageError, match=re.escape(text)):
        run["taken"](*arguments)


def test_an_index_outside_is_seen_in_plain_evaluation():
    with pytest.raises(StageError, match="index 9 of a vector, expected 0 … 2"):
        Program("outside", read=Entry(lambda on, x: x[9], x=vector())).plain()["read"](np.ones(3))


def test_threads_that_compile_a_program_at_once_get_the_same_code():
    """Else that of all but one would be freed, and its addresses with it."""

    def shifted(on, x, out):
        out[0] = on.sin(x[0]) + on.exp(x[0])

    program = Program("shifted", shifted=Entry(shifted, x=vector(), out=vector()))
    together = Barrier(4)

    def compiled(_):
        together.wait()
        return program.compiled()["shifted"].address

    with ThreadPoolExecutor(4) as threads:
        assert len(set(threads.map(compiled, range(4)))) == 1


@dataclass(frozen=True, slots=True)
class Weighed:
    """Numbers with weights, two columns."""

    weights: Vector
    numbers: Annotated[Matrix, 2]


class Heavy(Record):
    """A row with a mass."""

    mass = real()


def test_annotations_say_the_kinds_of_arguments():
    """The text is that of the function whose kinds are written out; a size that is given counts."""

    def plain(on: Evaluator, whole: Weighed, k: Integer, scale: Real, found: Table[Heavy], out: Vector) -> None:
        out[k] = scale * whole.weights[k] * whole.numbers[k, 1] + found[k].mass

    kinds = {"whole": group(Weighed, weights=vector(), numbers=matrix(2)), "k": integer(), "scale": real()}
    kinds |= {"found": table(Heavy), "out": vector()}
    texts = [Program("one", run=entry).text() for entry in (Entry(plain), Entry(plain, **kinds))]
    assert texts[0] == texts[1]
    kinds["whole"] = group(Weighed, weights=vector(), numbers=matrix())
    assert Program("one", run=Entry(plain, **kinds)).text() != texts[0]


def test_arguments_are_bundled_into_one_thing():
    """What is made of arguments comes first, the others in their order; the text is that of the plain function."""
    kinds = {"x": vector(), "scale": real(), "parts": indices(), "out": vector()}

    def bundled(on: Evaluator, made: tuple[Integers, Vector], x: Vector, scale: Real) -> None:
        parts, out = made
        out[0] = scale * x[parts[0]]

    def plain(on: Evaluator, x: Vector, scale: Real, parts: Integers, out: Vector) -> None:
        out[0] = scale * x[parts[0]]

    one = Program("one", run=Entry.bundled(bundled, kinds, (("parts", "out"), lambda parts, out: (parts, out))))
    two = Program("one", run=Entry(plain, **kinds))
    assert one.text() == two.text()
    out = np.zeros(1)
    one.compiled()["run"](np.array([2.0, 3.0]), 5.0, np.array([1]), out)
    assert out[0] == 15.0
