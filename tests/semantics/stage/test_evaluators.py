"""One program, run every way: drawn programs give the same bits, bounds contain, expressions agree."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ephs.semantics.stage import Entry, Program, StageError, real, vector
from ephs.semantics.stage.evaluator import FUNCTIONS
from ephs.semantics.stage.llvm import Target, compile_text
from tests.semantics.stage.drawn import (
    BINARY,
    EXACT,
    INPUTS,
    TAME,
    UNARY,
    batch,
    bodies,
    bounds,
    exact,
    members,
    plain,
    unrolled,
)
from tests.staged import bits

POINTS = st.lists(st.integers(-300, 300).map(lambda n: n / 64 + 1 / 3), min_size=INPUTS, max_size=INPUTS)


@pytest.mark.parametrize("way", EXACT)
@settings(max_examples=25)
@given(body=bodies(), x=POINTS)
def test_every_way_gives_the_bits_of_the_float_run(way, body, x):
    assert bits(EXACT[way](body, x)) == bits(plain(body, x))


@settings(max_examples=25)
@given(body=bodies(functions=TAME), x=POINTS)
def test_unrolled_programs_give_the_bits_of_the_float_run(body, x):
    assert bits(unrolled(body, x) + 0.0) == bits(plain(body, x) + 0.0)


@settings(max_examples=25)
@given(body=bodies(branches=False), x=POINTS)
def test_members_side_by_side_have_the_bits_of_the_float_run(body, x):
    assert bits(members(body, x)) == bits(plain(body, x))


@settings(max_examples=25)
@given(body=bodies(functions=TAME, branches=False), x=POINTS)
def test_members_of_arrays_have_the_bits_of_the_float_run(body, x):
    assert bits(batch(body, x) + 0.0) == bits(plain(body, x) + 0.0)


@settings(max_examples=60)
@given(body=bodies(functions=("absolute", "floor", "minimum", "maximum", "/"), branches=False), x=POINTS)
def test_bounds_contain_the_exact_value(body, x):
    try:
        found, values = bounds(body, x), exact(body, x)
    except (StageError, TypeError):  # SymPy does not compare what is not a number.
        assume(False)
    for (low, high), number in zip(found, values, strict=True):
        assert not number.is_finite or low <= number <= high


def chain(on, x, y, z, out):
    out[0] = x * y + z
    out[1] = (x + y) + z


CHAIN = Program("chain", chain=Entry(chain, x=real(), y=real(), z=real(), out=vector()))


@pytest.mark.parametrize("flags", ["", "contract "])
def test_products_and_sums_are_not_contracted(flags):
    """The control: allowed to, LLVM contracts them, where the processor can."""
    text = CHAIN.text().replace("fmul ", f"fmul {flags}").replace("fadd ", f"fadd {flags}")
    with_fma, without = (
        compile_text(text, Target("x86_64-unknown-linux-gnu", "x86-64-v3", features)) for features in ("+fma", "-fma")
    )
    assert (with_fma == without) == (not flags)


def test_a_sum_in_another_order_has_other_bits():
    """The control of all comparisons above."""

    def other(on, x, y, z, out):
        out[1] = x + (y + z)

    def found(program):
        out = np.zeros(2)
        program.compiled()["chain"](0.1, 0.2, 0.3, out)
        return out[1:]

    assert bits(found(CHAIN)) != bits(found(Program("chain", chain=Entry(other, **CHAIN.entries["chain"].kinds))))


def test_every_function_is_drawn():
    assert set(FUNCTIONS) <= {*UNARY, *BINARY}
