"""A spanning forest of the bodies, from the ground outwards, preferring the joints that someone named."""

from collections import deque
from collections.abc import Container, Sequence
from dataclasses import dataclass
from typing import final

from ephs.mechanics.scene.kinematics import AssemblyJoint
from ephs.operad.disjoint import DisjointSets


@final
@dataclass(frozen=True, slots=True)
class Hop:
    """One step outwards: through link number ``link`` (of this name) to ``body``."""

    link: int
    name: str
    body: int


def spanning_hops(links: Sequence[AssemblyJoint], count: int, preferred: Container[str]) -> list[Hop]:
    """The steps that reach each of ``count`` bodies once, each from a body reached before.

    Named links come into the tree before others, then those in front. A group of bodies without a way to
    the ground is reached from its first body, which no step leads to.
    """
    sets = DisjointSets[int]()
    neighbours: dict[int, list[int]] = {body: [] for body in range(-1, count)}
    for number in sorted(range(len(links)), key=lambda i: links[i].name not in preferred):
        if sets.join(links[number].body1, links[number].body2):
            neighbours[links[number].body1].append(number)
            neighbours[links[number].body2].append(number)

    hops: list[Hop] = []
    reached: set[int] = set()
    for root in range(-1, count):
        if root in reached:
            continue
        reached.add(root)
        queue = deque([root])
        while queue:
            here = queue.popleft()
            for number in neighbours[here]:
                link = links[number]
                there = link.other(here)
                if there not in reached:
                    reached.add(there)
                    queue.append(there)
                    hops.append(Hop(number, link.name, there))
    return hops
