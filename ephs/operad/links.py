"""State links: the equivalence relation "same state" on junctions."""

from collections.abc import Iterable, Mapping

from ephs.operad.names import Path

__all__ = ["closure"]


def closure(groups: Iterable[Iterable[Path]]) -> Mapping[Path, frozenset[Path]]:
    """The least equivalence that joins the members of each group: the classes of two members or more, by member."""
    parent: dict[Path, Path] = {}

    def find(path: Path) -> Path:
        while parent.setdefault(path, path) != path:
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
    classes = {root: frozenset(paths) for root, paths in members.items() if len(paths) > 1}
    return {path: classes[root] for path in parent if (root := find(path)) in classes}
