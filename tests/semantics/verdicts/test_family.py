"""Of drawn parts, wrong ones are refused by what they break, and right ones are not: three draws of each kind."""

import random
import time

import numpy as np
import pytest

import ephs
from ephs import quantity as Q
from ephs.semantics import StructureError
from tests.semantics.verdicts.right_parts import PROVED, RIGHT, turn
from tests.semantics.verdicts.wrong_parts import WRONG

LONGEST = 2.0
"""Processor time in s that a verdict takes at most."""
draws = pytest.mark.parametrize("seed", range(3))


def named(kind):
    return kind.__name__.replace("_", " ")


def verdict(kind, seed):
    """``searched``, ``proved``, or the condition that is named, with its witness."""
    try:
        return str(kind(random.Random(f"{kind.__name__} {seed}"))().verdict), None
    except StructureError as error:
        assert str(error.witness) in str(error)
        return error.kind, error.witness


@draws
@pytest.mark.parametrize("kind", WRONG, ids=named)
def test_a_wrong_part_is_refused_by_what_it_breaks(kind, seed):
    found, witness = verdict(kind, seed)
    assert found in WRONG[kind]
    assert (witness is None) == (found == "searched")


@draws
@pytest.mark.parametrize("kind", RIGHT, ids=named)
def test_a_right_part_is_not_refused_and_mostly_proved(kind, seed):
    assert verdict(kind, seed) in [("proved", None), *([("searched", None)] if kind not in PROVED else [])]


def between_poses(along):
    """A damper between the origins of two poses."""

    def matrix(p, r, s, a, b):
        none = np.zeros((3, 3), dtype=object)
        rows = np.hstack([none, turn(a), none, -turn(b)])
        if along:
            line = b[4:] - a[4:]
            rows = ((line / np.sqrt(line @ line + 1e-6)) @ rows).reshape(1, 12)
        speed = rows @ np.concatenate([p, r])
        whole = np.zeros((13, 13), dtype=object)
        whole[:12, :12], whole[12, 12] = s * (rows.T @ rows), (speed @ speed) / s
        whole[:12, 12] = whole[12, :12] = -(rows.T @ speed)
        return whole

    ports = {"p": Q.body_momentum, "r": Q.body_momentum, "s": Q.entropy, "~a": Q.pose, "~b": Q.pose}
    return ephs.irreversible(ports, matrix)


def between_six():
    """Conduction between all pairs of six bodies."""

    def matrix(**s):
        names, whole = list(s), np.zeros((6, 6), dtype=object)
        for i, one in enumerate(names):
            for j, other in enumerate(names[:i]):
                v = np.zeros(6, dtype=object)
                v[i], v[j] = s[other], -s[one]
                whole = whole + np.outer(v, v) / (s[one] * s[other])
        return whole

    def called(a, b, c, d, e, f):
        return matrix(a=a, b=b, c=c, d=d, e=e, f=f)

    return ephs.irreversible(dict.fromkeys("abcdef", Q.entropy), called)


LARGE = {
    "two poses": lambda: between_poses(along=False),
    "the line between two poses": lambda: between_poses(along=True),
    "six bodies": between_six,
}


@pytest.mark.parametrize("name", LARGE)
def test_large_right_parts_have_their_verdict_in_two_seconds(name):
    """And rounding of many operations, some 1e5 times larger than what is left of them, refuses none."""
    start = time.process_time()
    assert LARGE[name]().verdict in ("searched", "proved")
    assert time.process_time() - start <= 2.0 * LONGEST  # processors that others share are slower


def test_an_energy_of_two_rotations_is_proved():
    """Turning a quaternion to its opposite changes no product of two of its entries."""

    def energy(a, b):
        return np.sum((turn(a).T @ turn(b)) * np.diag([1.0, 2.0, 3.0]))

    assert ephs.storage({"a": Q.pose, "b": Q.pose}, energy).verdict == "proved"
