"""When an iteration is over: by laws of sequences of corrections that fall by a rate, of floats and as machine code."""

import math

import numpy as np
import pytest

from ephs.semantics.stage import Entry, Program, real, vector
from ephs.solve.march.iteration import ITERATIONS, iterate
from tests.staged import run_both

ENOUGH, ROUGH, FAST = 1e-3, 1e-1, 0.3


def _ended(on, sizes, out, enough, rough):
    found = iterate(on, lambda tries: sizes[tries - 1], enough, rough, FAST)
    out[0] = on.real(found.tries)
    out[1], out[2] = on.select(found.solved, 1.0, 0.0), on.select(found.fast, 1.0, 0.0)
    return 0


PROGRAM = Program("iterated", ended=Entry(_ended, sizes=vector(), out=vector(3), enough=real(), rough=real()))


def ended(sizes, enough=ENOUGH, rough=ROUGH):
    """Corrections taken, whether they solve, whether the matrix served well."""
    sizes = np.array([*sizes, *[math.nan] * ITERATIONS])[:ITERATIONS]
    tries, solved, fast = run_both(PROGRAM, "ended", sizes, np.zeros(3), enough, rough)[2]
    return int(tries), bool(solved), bool(fast)


@pytest.mark.parametrize("first", [1e4, 1.0, 3e-2])
@pytest.mark.parametrize("rate", [1e-3, 0.1, 0.29, 0.31, 0.45])
def test_what_is_left_of_a_geometric_sequence_is_less_than_enough(rate, first):
    """What is left after n corrections is their sum from there on; one correction less would leave too much."""
    sizes = first * rate ** np.arange(ITERATIONS)
    tries, solved, fast = ended(sizes)
    left = sizes * rate / (1.0 - rate)
    if solved:
        assert left[tries - 1] <= ENOUGH * (1.0 + 1e-12) or (sizes[tries - 1] <= ROUGH and tries == ITERATIONS)
        assert tries <= 2 or left[tries - 2] > ENOUGH
        assert fast == (left[tries - 1] <= ENOUGH and (tries <= 2 or rate < FAST))
    else:
        assert tries == ITERATIONS and sizes[-1] > ROUGH


@pytest.mark.parametrize(
    ("sizes", "end"),
    [
        ([0.0], (1, True, True)),
        ([5e-4], (1, True, True)),
        ([0.05], (2, False, False)),  # nothing is known of a rate: what follows is not a number
        ([1.0, math.nan], (2, False, False)),
        ([math.inf], (1, False, False)),
        ([1e-2, 1.0, 1e-6], (3, True, True)),  # a correction that is too large is none yet, as heat is quadratic
        ([1.0, 0.08, 0.07], (3, True, False)),  # it gets no further, and is good enough
        ([1.0, 0.8, 0.9], (3, False, False)),  # it goes away
        ([1.0, 0.2, 0.15, 0.12, 0.09], (5, True, False)),
        ([1.0] + [0.99**k for k in range(9)], (ITERATIONS, False, False)),
    ],
)
def test_corrections_that_do_not_converge_are_good_enough_or_end(sizes, end):
    assert ended(sizes) == end
