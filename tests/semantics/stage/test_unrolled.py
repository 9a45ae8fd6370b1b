"""Programs unrolled over what is given: the same results, less arithmetic."""

import re

import numpy as np
import pytest

from ephs.semantics.stage import Entry, Program, Record, StageError, indices, integer, real, reals, table, vector


class Part(Record):
    parent = integer()
    place = reals(2)
    gain = real()


def sums(on, parts, x, work, out):
    """Sums up a tree, with all kinds of control."""
    n = parts.size
    total, steps = on.variable(0.0), on.counter(0)

    def outward(i):
        part = parts[i]
        work[i] = part.place[0] * x[0] + part.place[1] * x[1]
        on.when(part.parent >= 0, lambda: work.__setitem__(i, work[i] + work[part.parent]))

        def large():
            total.value = total.value + work[i] * part.gain
            work[i] = 0.5

        def small():
            total.value = total.value - 1.0

        on.when(work[i] > 0.25, large, small)

    on.loop(n, outward)
    on.loop(n, lambda i: work.__setitem__(i, work[i] * 2.0), down=True)

    def halve():
        total.value = total.value / 2.0
        work[0] = work[0] + on.real(steps.value)
        steps.value = steps.value + 1
        return on.either(on.absolute(total.value) < 0.125, steps.value >= 20)

    on.repeat(halve)

    def again(k):
        total.value = total.value + work[0] / on.real(k + 1)
        on.when(x[1] < total.value, lambda: work.__setitem__(1, work[1] + total.value))

    on.loop(steps.value, again)
    for i in range(4):
        out[i] = work[i]
    out[4] = total.value
    return steps.value


def parts(flat):
    draw = np.random.default_rng(3)
    made = Part.table(4)
    made.reals.array[:] = draw.normal(size=12)
    for i in range(4):
        made[i].parent = i - 1
        if flat:
            made[i].place = [1.0, 0.0]
    return made


ENTRY = Entry(sums, parts=table(Part), x=vector(2), work=vector(), out=vector())


def test_what_is_known_to_be_zero_vanishes():
    def operations(flat):
        text = Program("one", one=ENTRY.given(parts=parts(flat), work=np.zeros(4))).text()
        return len(re.findall(r"f(add|sub|mul|div) ", text))

    assert operations(True) < operations(False)


def test_derivatives_and_unrolling_go_together():
    given = parts(False)
    program = Program(
        "together",
        one=ENTRY.tangent("x", "work", "out"),
        two=ENTRY.given(parts=given, work=np.zeros(4)).tangent("x", "out"),
        three=ENTRY.tangent("x", "work", "out").given(parts=given, work=(np.zeros(4), np.zeros(4))),
    )
    x, dx, found = np.array([0.3, -0.7]), np.array([1.0, 0.5]), []
    for calls in (program.compiled(), program.plain()):
        outs = [(np.zeros(5), np.zeros(5)) for _ in range(3)]
        calls["one"](given, (x, dx), (np.zeros(4), np.zeros(4)), outs[0])
        calls["two"]((x, dx), outs[1])
        calls["three"]((x, dx), outs[2])
        found += outs
    for values, slopes in found:
        assert np.array_equal(values, found[0][0])
        assert np.allclose(slopes, found[0][1], rtol=1e-15, atol=0)


def test_a_table_that_is_given_is_read_at_an_unknown_place():
    program = Program(
        "looked", up=Entry(lambda on, t, i, x: t[i] * x, t=vector(), i=integer(), x=real()).given(t=np.arange(5.0))
    )
    assert [calls["up"](3, 2.0) for calls in (program.compiled(), program.plain())] == [6.0, 6.0]


def test_memory_that_is_written_at_an_unknown_place_is_refused():
    def write(on, t, i):
        t[i] = 1.0

    with pytest.raises(StageError, match=r"write, test_unrolled.py:\d+: a place to store at is not known"):
        Program("not", write=Entry(write, t=vector(), i=integer()).given(t=np.zeros(3))).text()


def test_what_is_given_is_checked():
    with pytest.raises(StageError, match="sums: argument x is an array of float64 of shape"):
        ENTRY.given(x=np.zeros(3))
    with pytest.raises(StageError, match="sums: has no argument y"):
        ENTRY.given(y=1.0)


def test_a_loop_that_never_ends_is_seen():
    def forever(on, x):
        on.repeat(lambda: False)

    with pytest.raises(StageError, match=r"forever.*more than 100000 operations"):
        Program("not", forever=Entry(forever, x=indices()).given(x=np.zeros(1, dtype=np.int64))).text()


def test_a_known_zero_divides_as_ieee_says():
    def inverse(on, x):
        return 1.0 / on.variable(0.0).value - x

    entry = Entry(inverse, x=real())
    program = Program("zero", looped=entry, unrolled=entry.given())
    found = [calls[name](1.0) for calls in (program.plain(), program.compiled()) for name in calls]
    assert found == [np.inf] * 4
