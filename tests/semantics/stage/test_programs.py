"""One function, run with floats and as machine code: the same bits."""

import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from threading import Barrier
from typing import Annotated, Any

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
from tests.numerics import EPS


def solve(on: Evaluator, a: Matrix, x: Vector, pivots: Integers) -> Integer:
    """LU with partial pivoting; the number of exchanges."""
    n, exchanges = x.size, on.counter(0)

    def eliminate(k: Integer) -> None:
        best, at = on.variable(on.absolute(a[k, k])), on.counter(k)

        def search(i: Integer) -> None:
            size = on.absolute(a[i, k])

            def take() -> None:
                best.value, at.value = size, i

            on.when(size > best.value, take)

        on.loop(n, search, start=k + 1)
        pivot = pivots[k] = at.value

        def exchange() -> None:
            exchanges.value = exchanges.value + 1

            def column(j: Integer) -> None:
                upper, lower = a[k, j], a[pivot, j]
                a[k, j], a[pivot, j] = lower, upper

            on.loop(n, column)
            upper, lower = x[k], x[pivot]
            x[k], x[pivot] = lower, upper

        on.when(on.negate(on.same(pivot, k)), exchange)

        def below(i: Integer) -> None:
            factor = a[i, k] / a[k, k]

            def column(j: Integer) -> None:
                a[i, j] = a[i, j] - factor * a[k, j]

            on.loop(n, column, start=k + 1)
            x[i] = x[i] - factor * x[k]

        on.loop(n, below, start=k + 1)

    def back(i: Integer) -> None:
        total, row = on.variable(x[i]), a.row(i)

        def column(j: Integer) -> None:
            total.value = total.value - row[j] * x[j]

        on.loop(n, column, start=i + 1)
        x[i] = total.value / row[i]

    on.loop(n, eliminate)
    on.loop(n, back, down=True)
    return exchanges.value


def newton(on: Evaluator, x: Real) -> Real:
    """The square root by iteration."""
    root, steps = on.variable(x), on.counter(0)

    def step() -> Any:
        root.value = (root.value + x / root.value) / 2.0
        steps.value = steps.value + 1
        return on.either(on.absolute(root.value * root.value - x) <= 1e-14 * x, steps.value >= 60)

    on.repeat(step)
    return root.value


def whole(on: Evaluator, i: Integer, j: Integer) -> Integer:
    return (i // j) * 1000 + i % j


PROGRAM = Program(
    "tried",
    solve=Entry(solve, a=matrix(), x=vector(), pivots=indices()),
    newton=Entry(newton, x=real()),
    whole=Entry(whole, i=integer(), j=integer()),
)


@pytest.fixture(params=["compiled", "plain"])
def run(request):
    return PROGRAM.compiled() if request.param == "compiled" else PROGRAM.plain()


@pytest.mark.parametrize("n", [1, 2, 7, 20])
def test_equations_are_solved_with_the_same_bits(n):
    draw = np.random.default_rng(n)
    matrix, right = draw.normal(size=(n, n)), draw.normal(size=n)
    found = []
    for calls in (PROGRAM.compiled(), PROGRAM.plain()):
        a, x, pivots = matrix.copy(), right.copy(), np.zeros(n, dtype=np.int64)
        found.append((calls["solve"](a, x, pivots), a, x, pivots))
    for one, other in zip(*found, strict=True):
        assert np.array_equal(one, other)
    scale = np.abs(matrix) @ np.abs(found[0][2])
    assert np.all(np.abs(matrix @ found[0][2] - right) <= 10 * np.linalg.cond(matrix) * EPS * scale)


@pytest.mark.parametrize("x", [2.0, 1e-8, 3e9])
def test_a_loop_ends_when_its_condition_holds(run, x):
    assert abs(run["newton"](x) - x**0.5) <= 4 * EPS * x**0.5


@pytest.mark.parametrize("i", [-7, -6, 0, 6, 7])
@pytest.mark.parametrize("j", [-3, 2, 3])
def test_integers_divide_as_in_python(run, i, j):
    assert run["whole"](i, j) == (i // j) * 1000 + i % j


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((np.eye(2), np.ones(2)), "solve: takes 3 arguments"),
        ((np.eye(2, dtype=np.float32), np.ones(2), np.zeros(2, int)), "argument a is an array of float32"),
        ((np.eye(4)[:, ::2], np.ones(2), np.zeros(2, int)), "argument a is a non-contiguous"),
        ((np.eye(2), np.ones((2, 1)), np.zeros(2, int)), "argument x is an array of float64 of shape (2, 1)"),
        ((np.eye(2), np.ones(2), np.zeros(2)), "argument pivots"),
        ((shared := np.eye(2), shared[1], np.zeros(2, int)), "arguments a and x share memory"),
    ],
)
def test_wrong_arguments_are_named(run, arguments, text):
    with pytest.raises(StageError, match=re.escape(text)):
        run["solve"](*arguments)


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
