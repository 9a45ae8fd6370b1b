"""Gradients by a tape are those of forward tangents, by all arguments at once, in machine code and with floats."""

import numpy as np
import pytest
from hypothesis import given, settings

from ephs.semantics.stage import Entry, Program, Record, indices, integer, real, table, vector
from ephs.semantics.stage.gradients import Gradients
from ephs.semantics.stage.taped import COUNT
from tests.numerics import largest, seeds
from tests.semantics.stage.test_duals import Reaching, law, squared

NEAR = 1e-13
"""Part of the largest derivative: some hundred terms of either way round."""


class Spring(Record):
    """A spring that hardens."""

    stiffness = real()
    hardening = real()


def windings(on, springs, x, out, count):
    """Loops, branches, memory that is written again, long sums and functions."""
    total = on.variable(0.0)

    def one(i):
        s = springs[i]
        stretch = x[i + 1] - x[i]
        pull = (s.stiffness + s.hardening * stretch * stretch) * stretch
        total.value = total.value + on.sin(pull) * on.exp(0.1 * x[i])
        on.when(stretch > 0.3, lambda: _put(x, i, x[i] + 0.5 * x[i + 1] * x[i + 1]))
        x[i + 1] = on.select(stretch > 0.0, x[i + 1] * x[i], on.sqrt(x[i + 1] * x[i + 1] + 1.0))

    on.loop(count, one)
    rounds = on.counter(0)

    def again():
        total.value = total.value / (1.0 + total.value * total.value)
        rounds.value = rounds.value + 1
        return rounds.value >= 3

    on.repeat(again)
    out[0] = total.value
    out[1] = sum((x[i] * x[j] for i in range(4) for j in range(4)), 0.0) + on.atan2(x[0], x[1])


def _put(x, i, value):
    x[i] = value


WINDINGS = Entry(windings, springs=table(Spring), x=vector(), out=vector(2), count=integer())


def drawn(seed):
    rng = np.random.default_rng(seed)
    springs = Spring.table(3)
    springs.arrays[1][:] = rng.uniform(0.5, 2.0, 6)
    return {"springs": springs, "x": rng.standard_normal(4), "out": np.zeros(2), "count": 3}


def columns(seed):
    """(2, 10) derivatives of both results by the springs and x, by forward tangents."""
    program = Program("forward", run=WINDINGS.tangent("springs", "x", "out"))
    found = []
    for k in range(10):
        made = drawn(seed)
        unit = np.eye(10)[k]
        out = made["out"], np.zeros(2)
        program.compiled()["run"]((made["springs"], unit[:6].copy()), (made["x"], unit[6:].copy()), out, 3)
        found.append(out[1])
    return np.array(found).T


@pytest.mark.parametrize("compiled", [True, False])
@settings(max_examples=5)
@given(seed=seeds)
def test_a_tape_says_what_tangents_say(compiled, seed):
    expected = columns(seed)
    made = Gradients(WINDINGS, compiled=compiled, **drawn(seed))
    made.run()
    for row, share in zip(expected, np.eye(2), strict=True):
        found = made.pull({"out": share})
        mine = np.concatenate([found["springs"], found["x"]])
        assert largest(mine - row) <= NEAR * max(1.0, largest(expected))


def test_a_tape_that_is_too_short_grows():
    """A long loop: (((x·a)·a)·…): the derivative by a is n x a^(n−1)."""

    def power(on, x, a, count):
        def one(_):
            x[0] = x[0] * a[0]

        on.loop(count, one)

    made = Gradients(
        Entry(power, x=vector(1), a=vector(1), count=integer()), x=np.ones(1), a=np.array([1.0001]), count=20_000
    )
    made.run()
    assert made.pull({"x": [1.0]})["a"][0] == pytest.approx(20_000 * 1.0001**19_999, rel=1e-10)


def test_what_a_choice_leaves_out_is_left_out():
    """The root's slope at zero is infinite, and it is not taken: |x| near zero, as a smoothed friction has it."""

    def chosen(on, x, out):
        out[0] = on.select(x[0] > 0.0, on.sqrt(x[0]), 3.0 * x[0])

    made = Gradients(Entry(chosen, x=vector(1), out=vector(1)), x=np.zeros(1), out=np.zeros(1))
    made.run()
    assert made.pull({"out": [1.0]})["x"][0] == 3.0


def test_a_second_run_starts_with_what_the_first_found():
    """Integers, too: the tape of the first run is too short."""

    def counted(on, x, count, rounds):
        def one(_):
            count[0] = count[0] + 1
            x[0] = x[0] * x[0]

        on.loop(rounds, one)

    count = np.array([5])
    entry = Entry(counted, x=vector(1), count=indices(1), rounds=integer())
    Gradients(entry, x=np.ones(1), count=count, rounds=10_000).run()
    assert count[0] == 10_005


def test_tapes_go_through_functions_that_are_called_by_address():
    inside = Program("inside", law=Entry(law, x=vector(2), out=vector(1)).taped())
    rows = Reaching.table(1)
    rows[0].law = inside.compiled()["law"].address
    entry = Entry(squared, table=table(Reaching), x=vector(2), out=vector(1))
    made = Gradients(entry, table=rows, x=np.array([1.5, 0.4]), out=np.zeros(1))
    made.run()
    s, c = np.sin(0.4), np.cos(0.4)
    assert made.pull({"out": [1.0]})["x"] == pytest.approx([2.0 * 1.5 * s * s, 2.0 * 1.5 * s * 1.5 * c], rel=1e-14)
    assert COUNT == 3
