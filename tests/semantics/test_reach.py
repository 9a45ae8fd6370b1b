"""What the strategies for systems reach, counted, so that the laws are tested where they could fail."""

import functools

import pytest
from hypothesis import HealthCheck, Phase, find, given, settings

from ephs.semantics import AssemblyError, Storage, System
from ephs.testing import fillings, nestings, systems
from ephs.testing.systems import PULL, STRETCH

DRAWN = 120


def depth(system):
    return 1 + max((depth(each) for each in system.fillings.values() if isinstance(each, System)), default=0)


def level(system, path):
    """How many levels down the component of this path is."""
    box = next(box for box in system.fillings if box.is_prefix_of(path))
    inner = system.fillings[box]
    return 1 + level(inner, path.relative_to(box)) if isinstance(inner, System) else 1


def carried(system):
    """By how many levels each state that a component reads lies above its storage; negative for below."""
    return [
        level(system, store) - level(system, reader)
        for each in system.relation().classes
        for store in each.stores
        for reader in each.readers
    ]


def assembles(system):
    try:
        return bool(system.descriptor())
    except AssemblyError:
        return False


def states(system):
    return system.states.values()


FACTS = {
    "three levels": lambda s: depth(s) == 3,
    "outer ports": lambda s: bool(s.interface),
    "links of the flat pattern": lambda s: bool(s.flatten().pattern.links),
    "a component reads": lambda s: any(p.reads and not isinstance(p, Storage) for _, p in s.leaves()),
    "friction reads": lambda s: any(p.kind == "irreversible" and p.reads for _, p in s.leaves()),
    "read below its storage": lambda s: any(found < 0 for found in carried(s)),
    "read two levels below": lambda s: any(found < -1 for found in carried(s)),
    "read above its storage": lambda s: any(found > 0 for found in carried(s)),
    "read two levels above": lambda s: any(found > 1 for found in carried(s)),
    "stored twice": lambda s: any(len(each.stores) > 1 for each in s.relation().classes),
    "stored by nobody": lambda s: any(each.free for each in s.relation().classes),
    "stored outside": lambda s: any(each.ports and each.readers and not each.stores for each in s.relation().classes),
    "a component of one's own": lambda s: any(p.name == "quartic" for _, p in s.leaves()),
    "a quantity of one's own": lambda s: any(each in (STRETCH, PULL) for each in states(s)),
    "a relative pose": lambda s: any(each.kind == "relative_pose" for each in states(s)),
    "equations": assembles,
}
REACH = {
    "systems": {
        "three levels": 40, "outer ports": 20, "links of the flat pattern": 15, "a component reads": 40,
        "friction reads": 20, "read below its storage": 20, "read two levels below": 5, "read above its storage": 5,
        "a component of one's own": 15, "a quantity of one's own": 8, "a relative pose": 3,
        "equations": DRAWN,
    },
    "systems in two levels": {
        "links of the flat pattern": 15, "read below its storage": 10, "read above its storage": 5, "equations": DRAWN,
    },
    "systems that are not posed": {"stored twice": 25, "stored by nobody": 15},
    "fillings": {
        "links of the flat pattern": 20, "a component reads": 20, "stored twice": 5, "stored by nobody": 12,
        "stored outside": 12,
    },
}  # fmt: skip
STRATEGIES = {
    "systems": systems(),
    "systems in two levels": systems(max_depth=2, max_junctions=2),
    "systems that are not posed": systems(posed=False),
    "fillings": nestings().flatmap(fillings),
}


RARE = {"systems": "read two levels above"}
"""Facts of so few of those drawn that a search has to find one."""


@functools.cache
def drawn(strategy):
    found = []

    @settings(
        max_examples=DRAWN, derandomize=True, database=None, deadline=None,
        suppress_health_check=list(HealthCheck), phases=[Phase.generate],
    )  # fmt: skip
    @given(STRATEGIES[strategy])
    def collect(system):
        found.append(system)

    collect()
    return found


@pytest.mark.parametrize("strategy", REACH)
def test_so_many_of_those_drawn_have_it(strategy):
    assert len(drawn(strategy)) == DRAWN
    counts = {fact: sum(bool(FACTS[fact](system)) for system in drawn(strategy)) for fact in REACH[strategy]}
    assert not {fact: count for fact, count in counts.items() if count < REACH[strategy][fact]}, counts


@pytest.mark.parametrize("strategy", RARE)
def test_a_search_finds_what_is_rare(strategy):
    limits = settings(max_examples=20 * DRAWN, database=None, deadline=None, phases=[Phase.generate])
    assert find(STRATEGIES[strategy], FACTS[RARE[strategy]], settings=limits) is not None
