"""What the strategies for systems reach, counted, so that the laws are tested where they could fail."""

import functools

import pytest
from hypothesis import HealthCheck, Phase, find, given, settings

from ephs.semantics import AssemblyError, Reversible, Storage, System
from ephs.testing import fillings, nestings, systems
from ephs.testing.systems import PULL, STRETCH
from tests.semantics.scales import scaled, sizes
from tests.semantics.stacked import levels_of

DRAWN = 120


def counted(system):
    """Whether it is a level that counts: identities are none."""
    return int(not system.pattern.is_identity)


def depth(system):
    return counted(system) + max(
        (depth(each) for each in system.fillings.values() if isinstance(each, System)), default=0
    )


def level(system, path):
    """How many levels down the component of this path is."""
    box = next(box for box in system.fillings if box.is_prefix_of(path))
    inner = system.fillings[box]
    return counted(system) + (level(inner, path.relative_to(box)) if isinstance(inner, System) else 0)


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


def identities(system):
    """How many identities follow one another from this level on."""
    if counted(system):
        return 0
    (inner,) = system.fillings.values()
    return 1 + (identities(inner) if isinstance(inner, System) else 0)


def chain(system):
    """The longest chain of identities."""
    return max(identities(level) for _, level in levels_of(system))


def inside(system):
    """The levels below the outermost one."""
    return [level for at, level in levels_of(system) if at]


def open_ports(level):
    """Outer power ports over junctions on which no inner power port lies."""
    ports = [port for content in level.pattern.boxes.values() for port in content.ports.values()]
    return {port for port, of in level.interface.items() if of.power} - {p.junction for p in ports if p.power}


def wide(system, ratio):
    """Whether the equations at the identity have coefficients so far apart."""
    found = sizes(system.relation().at())
    return max(found, default=1.0) >= ratio * min(found, default=1.0)


FACTS = {
    "links of three": lambda s: any(len(group) > 2 for _, each in levels_of(s) for group in each.pattern.links),
    "identities in identities": lambda s: chain(s) > 1,
    "three identities": lambda s: chain(s) > 2,
    "open power ports inside": lambda s: any(map(open_ports, inside(s))),
    "one state at three ports": lambda s: any(len(group) > 2 for each in inside(s) for group in each.shared_ports),
    "a constraint reads": lambda s: any(isinstance(p, Reversible) and p.reads and p.multipliers for _, p in s.leaves()),
    "frames": lambda s: any(of.quantity.frame for _, each in levels_of(s) for of in each.pattern.junctions.values()),
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
    "numbers of 1e9 and 1e-9": lambda s: wide(s, 1e16),
    "numbers a million apart": lambda s: wide(s, 1e6),
}
REACH = {
    "systems": {
        "three levels": 40, "outer ports": 20, "links of the flat pattern": 15, "a component reads": 40,
        "friction reads": 20, "read below its storage": 20, "read two levels below": 5, "read above its storage": 5,
        "a component of one's own": 15, "a quantity of one's own": 8, "a relative pose": 3,
        "links of three": 40, "identities in identities": 20, "three identities": 10, "open power ports inside": 8,
        "one state at three ports": 10, "a constraint reads": 4, "frames": 30,
        "equations": DRAWN,
    },
    "systems in two levels": {
        "links of the flat pattern": 15, "read below its storage": 10, "read above its storage": 5, "equations": DRAWN,
    },
    "systems that are not posed": {"stored twice": 25, "stored by nobody": 15},
    "rescaled systems": {"numbers of 1e9 and 1e-9": 20, "numbers a million apart": 60},
    "fillings": {
        "links of the flat pattern": 20, "a component reads": 20, "stored by nobody": 12,
        "stored outside": 12,
        "links of three": 8, "identities in identities": 20, "three identities": 10, "open power ports inside": 20,
        "one state at three ports": 3, "frames": 40,
    },
}  # fmt: skip
STRATEGIES = {
    "systems": systems(),
    "systems in two levels": systems(max_depth=2, max_junctions=2),
    "systems that are not posed": systems(posed=False),
    "rescaled systems": scaled(systems()),
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
