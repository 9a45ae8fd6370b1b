"""Of drawn parts, wrong ones are refused and right ones are not: counts, with a table by kind.

``python -m tests.semantics.verdicts.test_family 10`` prints the table of ten draws of each kind.
"""

import random
import sys
import time
from collections import Counter

import numpy as np
import pytest

import ephs
from ephs import quantity as Q
from ephs.semantics import StructureError
from tests.semantics.verdicts.right_parts import RIGHT
from tests.semantics.verdicts.wrong_parts import WRONG

DRAWS = 3
"""Of each kind: 120 wrong parts, and 57 right ones."""
REFUSED = 72 / 76
"""Least part of wrong ones that is refused."""
LONGEST = 2.0
"""Processor time in s that a verdict takes at most."""


def outcome(kind, seed):
    """``refused``, ``searched`` or ``proved``, and the processor time that it took."""
    make = kind(random.Random(f"{kind.__name__} {seed}"))
    start = time.process_time()
    try:
        found = str(make().verdict)
    except StructureError as error:
        found = "refused" if error.witness is not None else f"refused without a witness: {error}"
    return found, time.process_time() - start


def counted(kinds, draws):
    """Kind -> how many outcomes of each sort, and the longest time."""
    table = {}
    for kind in kinds:
        outcomes = [outcome(kind, seed) for seed in range(draws)]
        table[kind.__name__.replace("_", " ")] = Counter(o for o, _ in outcomes), max(t for _, t in outcomes)
    return table


def text(table):
    """The table for reading."""
    words = ("refused", "searched", "proved")
    lines = [f"{'':36}" + "".join(f"{word:>10}" for word in words) + f"{'longest s':>12}"]
    lines += [
        f"{name:36}" + "".join(f"{found[word]:10d}" for word in words) + f"{longest:12.2f}"
        for name, (found, longest) in table.items()
    ]
    total = sum((found for found, _ in table.values()), Counter())
    lines.append(f"{'all':36}" + "".join(f"{total[word]:10d}" for word in words))
    return "\n".join(lines)


def test_wrong_parts_are_refused_and_none_is_proved():
    table = counted(WRONG, DRAWS)
    total = sum((found for found, _ in table.values()), Counter())
    print(text(table))
    assert total["proved"] == 0, text(table)
    assert set(total) <= {"refused", "searched"}, text(table)
    assert total["refused"] >= REFUSED * len(WRONG) * DRAWS, text(table)


def test_right_parts_are_not_refused_and_most_are_proved():
    table = counted(RIGHT, DRAWS)
    total = sum((found for found, _ in table.values()), Counter())
    print(text(table))
    assert set(total) <= {"searched", "proved"}, text(table)
    assert total["proved"] >= 0.7 * len(RIGHT) * DRAWS, text(table)


def turn(q):
    w, x, y, z = q[0], q[1], q[2], q[3]
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


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


@pytest.mark.parametrize("hide", [float, lambda x: x], ids=["hidden", "recorded"])
@pytest.mark.parametrize("kind", ["isotropy", "conservation", "parity"])
def test_functions_of_states_leak_nothing_beside_other_units(kind, hide):
    """A part of 1e-13 of the largest number; without it the same function is not refused."""
    block = {"isotropy": [[0.0, 1e-4], [1e-4, 0.0]]}.get(kind, [[0.0, -1e-4], [1e-4, 0.0]])
    others = {
        "isotropy": {"c": Q.charge, "b": Q.flux_linkage},
        "conservation": {"b": Q.flux_linkage, "s": Q.entropy},
        "parity": {"b": Q.flux_linkage, "i": Q.magnetic_flux},
    }[kind]

    def made(size):
        whole = np.zeros((4, 4))
        whole[0, 1], whole[1, 0] = -1e9, 1e9
        whole[2:, 2:] = size * np.array(block)
        ports = {"q": Q.displacement, "p": Q.momentum, **others, "~x": Q.displacement}
        return ephs.gyrator(ports, lambda x: (1.0 + hide(x) ** 2) * whole)

    with pytest.raises(StructureError) as caught:
        made(1.0)
    assert caught.value.kind == kind
    assert made(0.0).verdict == ("searched" if hide is float else "proved")


def test_an_energy_of_two_rotations_is_proved():
    """Turning a quaternion to its opposite changes no product of two of its entries."""

    def energy(a, b):
        return np.sum((turn(a).T @ turn(b)) * np.diag([1.0, 2.0, 3.0]))

    assert ephs.storage({"a": Q.pose, "b": Q.pose}, energy).verdict == "proved"


if __name__ == "__main__":
    for group in (WRONG, RIGHT):
        print(text(counted(group, int(sys.argv[1]))), end="\n\n")
