"""A bound call repeated over members is each member's own call."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.semantics.stage import Entry, Program, Record, integer, real, table, vector
from ephs.semantics.stage.repeating import Repeated


class Scale(Record):
    """A factor, and a count of calls."""

    factor = real()
    calls = integer()


def scaled(on, scale, x, out, shift):
    def one(k):
        out[k] = scale[0].factor * x[k] + shift

    on.loop(x.size, one)
    scale[0].calls = scale[0].calls + 1


def told(on, scale, x, out, shift):
    scaled(on, scale, x, out, shift)
    return scale[0].calls * x.size


KINDS = {"scale": table(Scale), "x": vector(), "out": vector(), "shift": real()}
CALLS = Program("repeated_scales", scaled=Entry(scaled, **KINDS), told=Entry(told, **KINDS)).compiled()
NUMBER = st.floats(-1e3, 1e3)


@pytest.mark.parametrize("name", ["scaled", "told"])
@given(
    factors=st.lists(NUMBER, min_size=1, max_size=5), size=st.integers(1, 4), own=st.booleans(), shift=NUMBER,
    data=st.data(),
)  # fmt: skip
def test_each_member_has_its_own_arrays_and_shares_the_rest(name, factors, size, own, shift, data):
    """With and without results, twice, for the first few members; numbers are those of the last call."""
    count = data.draw(st.integers(0, len(factors)))
    scale, x, out = Scale.table(1), np.arange(1.0, size + 1.0), np.full(size, np.nan)
    integers, reals = scale.arrays
    reals[0] = 0.5
    xs = np.outer(np.arange(len(factors)), x)
    stacks = [(x, xs), (out, outs := np.full((len(factors), size), np.nan)), (np.zeros(3), np.zeros((9, 3)))]
    if own:
        stacks += [(reals, np.array(factors)[:, None]), (integers, np.zeros((len(factors), 1), dtype=np.int64))]
    repeated = Repeated(CALLS[name].bind(scale, x, out, 0.0), stacks)
    for calls in (1, 2):
        results = repeated(count, shift)
        alone = np.array(factors if own else [0.5] * len(factors))[:, None] * xs + shift
        assert np.array_equal(outs[:count], alone[:count])
        assert np.isnan(outs[count:]).all() and np.isnan(out).all()
        made = [calls] * count if own else list(range((calls - 1) * count + 1, calls * count + 1))
        assert results.tolist() == [size * many * (name == "told") for many in made]
