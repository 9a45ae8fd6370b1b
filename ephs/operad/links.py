"""State links: the equivalence relation "same state" on junctions."""

from collections.abc import Iterable, Mapping

from ephs.operad.names import Path

__all__ = ["closure"]


def closure(junctions: Iterable[Path], groups: Iterable[Iterable[Path]]) -> Mapping[Path, frozenset[Path]]:
    """The class of each junction under the least equivalence that joins the members of each group."""
    parent = {path: path for path in junctions}

    def find(path: Path) -> Path:
        while parent[path] != path:
            parent[path] = parent[parent[path]]
            path = parent[path]
        return path

    for group in groups:
        first, *others = group
        for other in others:
            parent[find(other)] = find(first)
    members: dict[Path, list[Path]] = {}
    for path in parent:
        members.setdefault(find(path), []).append(path)
    classes = {root: frozenset(paths) for root, paths in members.items()}
    return {path: classes[find(path)] for path in parent}
