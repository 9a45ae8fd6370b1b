"""Results kept with a value: found once for all threads, and left behind by copies."""

import copy
import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs import Pattern, library
from ephs.semantics.systems.kept import MOST, Kept

PATTERN, MASS = Pattern.from_text("p: momentum; mass(p)"), library.point_mass(m=2.0)


@given(st.lists(st.integers(0, 2 * MOST), max_size=60))
def test_a_result_is_the_same_until_others_took_its_place(keys: list[int]) -> None:
    kept, order = Kept(), list[int]()
    for key in keys:
        made = kept.result(key, lambda: object())
        if key in order:
            assert made is kept.result(key, lambda: object())
        else:
            order = [*order, key][-MOST:]
        assert all(kept.result(other, pytest.fail) is not None for other in order)


def test_what_raises_is_not_kept() -> None:
    kept = Kept()
    with pytest.raises(ZeroDivisionError):
        kept.result("key", lambda: 1 / 0)
    assert kept.result("key", lambda: 2) == 2


def test_threads_share_one_result() -> None:
    kept, threads = Kept(), 8
    barrier = Barrier(threads)

    def asked(_: int) -> object:
        barrier.wait()
        return kept.result("key", lambda: object())

    with ThreadPoolExecutor(threads) as pool:
        assert len({id(found) for found in pool.map(asked, range(threads))}) == 1


@pytest.mark.parametrize("made", [copy.deepcopy, lambda of: pickle.loads(pickle.dumps(of))])
def test_copies_start_with_nothing(made: Callable[[Kept], Kept]) -> None:
    kept = Kept()
    kept.result("key", lambda: 1)
    assert made(kept).result("key", lambda: 2) == 2
    assert kept.result("key", lambda: 3) == 1


def test_a_system_keeps_its_descriptor_form_and_is_equal_without() -> None:
    one, other = (PATTERN(mass=MASS) for _ in range(2))
    assert one.descriptor() is one.descriptor()
    assert one == other
    assert hash(one) == hash(other)
    assert other.descriptor() is not one.descriptor()
