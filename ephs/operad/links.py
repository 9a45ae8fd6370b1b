"""State links: the equivalence relation "same state" on junctions."""

from collections.abc import Iterable, Mapping

from ephs.operad.disjoint import DisjointSets
from ephs.operad.names import Path


def closure(groups: Iterable[Iterable[Path]]) -> Mapping[Path, frozenset[Path]]:
    """The least equivalence that joins the members of each group: the classes of two members or more, by member."""
    sets = DisjointSets[Path]()
    for group in groups:
        first, *others = group
        for other in others:
            sets.join(first, other)
    members: dict[Path, list[Path]] = {}
    for path in sets:
        members.setdefault(sets.leader(path), []).append(path)
    classes = [frozenset(paths) for paths in members.values() if len(paths) > 1]
    found = {path: each for each in classes for path in each}
    return {path: found[path] for path in sets if path in found}
