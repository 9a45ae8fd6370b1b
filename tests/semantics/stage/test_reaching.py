"""Functions called by their address: the bits of the float run, and of the same functions written in place."""

import ctypes

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ephs.semantics.stage import (
    Entry,
    Integers,
    Program,
    Reached,
    Record,
    Signature,
    StageError,
    function,
    indices,
    integer,
    real,
    table,
    vector,
)
from tests.semantics.stage.drawn import INPUTS, OUTPUTS, bodies, run
from tests.semantics.stage.test_evaluators import POINTS
from tests.staged import bits


def drawn(body):
    """f(x, out, n, shift): a drawn program at x + shift; its status is n + 1."""

    def f(on, x, out, n, shift):
        point = on.scratch(INPUTS)
        for k in range(INPUTS):
            point[k] = x[k] + shift
        run(on, body, point, out)
        return n + 1

    return f


def entry(f):
    return Entry(f, x=vector(), out=vector(), n=integer(), shift=real())


SIGNATURE = entry(drawn([])).signature()


class Law(Record):
    first = integer()
    law = function(SIGNATURE)


def caller(call):
    """call(on, i, law, x, out, n, shift) of all laws of a table, with windows of both arrays."""

    def every(on, laws, x, out, found):
        def one(i):
            row = laws[i]
            window, n = out.part(i * OUTPUTS, OUTPUTS), on.real(i)
            found[i] = call(on, i, row.law, x.part(row.first, INPUTS), window, i, 0.25 * n)

        on.loop(laws.size, one)

    return Entry(every, laws=table(Law), x=vector(), out=vector(), found=indices())


def results(call, addresses, x):
    laws = Law.table(len(addresses))
    for i, address in enumerate(addresses):
        laws[i].law, laws[i].first = address, i
    out, found = np.zeros(len(addresses) * OUTPUTS), np.zeros(len(addresses), dtype=np.int64)
    call(laws, np.array(x), out, found)
    return bits(out), found.tolist()


@settings(max_examples=15)
@given(one=bodies(), other=bodies(), x=POINTS, more=POINTS)
def test_functions_at_addresses_are_those_written_in_place(one, other, x, more):
    functions = [drawn(one), drawn(other)]
    program = Program("laws", one=entry(functions[0]), other=entry(functions[1]))
    calls = program.compiled()
    addresses = [calls["one"].address, calls["other"].address]
    reach = Program("caller", run=caller(lambda on, i, law, *arguments: on.reach(law, *arguments)))

    def in_place(on, i, law, *arguments):
        status = on.counter(0)

        def choose(k):
            def here():
                status.value = functions[k](on, *arguments)

            on.when(on.same(i, k), here)

        choose(0)
        choose(1)
        return status.value

    expected = results(Program("placed", run=caller(in_place)).plain()["run"], addresses, [*x, *more])
    for way in (reach.compiled()["run"], reach.plain()["run"]):
        assert results(way, addresses, [*x, *more]) == expected
    assert expected[1] == [1, 2]
    same, _ = results(reach.compiled()["run"], addresses[:1] * 2, [*x, *more])
    assert same[:OUTPUTS] == expected[0][:OUTPUTS]
    others, _ = results(reach.compiled()["run"], addresses[1:] * 2, [*x, *more])
    assert others[OUTPUTS:] == expected[0][OUTPUTS:]


BARE = Signature((("reals",), ("integers",)), returns=False)
PYTHON = ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int64))


def with_memory_of_its_own(on, address, x, out):
    numbers, counts = on.scratch(4), on.counter(0)
    for k in range(3):
        numbers[k + 1] = x[k]
    on.loop(2, lambda _: on.reach(Reached(BARE, address), numbers.part(1, 3), Integers(counts.cells, 0, 1)))
    for k in range(4):
        out[k] = numbers[k]


def double(numbers, counts):
    for k in range(3):
        numbers[k] = 2.0 * numbers[k] + counts[0]
    counts[0] += 1


@pytest.mark.parametrize("way", ["plain", "compiled", "unrolled"])
@given(x=st.lists(st.integers(-100, 100).map(float), min_size=3, max_size=3))
@settings(max_examples=5)
def test_a_function_of_python_changes_memory_of_the_program(way, x):
    called = PYTHON(double)
    address = ctypes.cast(called, ctypes.c_void_p).value
    one = Entry(with_memory_of_its_own, address=integer(), x=vector(3), out=vector(4))
    program = Program("own", run=one.given() if way == "unrolled" else one)
    out = np.zeros(4)
    (program.plain() if way == "plain" else program.compiled())["run"](address, np.array(x), out)
    assert out.tolist() == [0.0, *(4.0 * value + 1.0 for value in x)]


FAULTS = {
    "too few": (lambda on, address, x: on.reach(Reached(BARE, address), x), "takes 2 arguments, found 1"),
    "another kind": (lambda on, address, x: on.reach(Reached(BARE, address), x, x), "integers as argument 2, found"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_does_not_fit_is_refused(fault):
    wrong, text = FAULTS[fault]
    program = Program("wrong", run=Entry(wrong, address=integer(), x=vector()))
    with pytest.raises(StageError, match=text):
        program.compiled()
    with pytest.raises(StageError, match=text):
        program.plain()["run"](0, np.zeros(1))


def test_several_members_are_refused():
    program = Program(
        "wide", run=Entry(lambda on, address: on.reach(Reached(Signature(()), address)), address=integer())
    )
    with pytest.raises(StageError, match="with several members"):
        program.compiled(members=2)
