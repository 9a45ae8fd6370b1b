"""What is compiled is said while it is."""

import numba

from ephs.mechanics.runs.compiling import compiling


def test_compilations_are_named_and_their_end_is_told():
    inner = numba.njit(lambda x: x + 1.0)

    @numba.njit
    def outer(x):
        return inner(x) * 2.0

    said = []
    with compiling(said.append):
        assert outer(1.5) == 5.0
        assert outer(2.5) == 7.0
    assert said == ["outer", "<lambda>", ""]
    assert outer(3) == 8.0
    assert said[3:] == []
