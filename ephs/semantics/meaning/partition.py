"""Partitions: which ports show one state. They glue as relations do, whose equations are all x = y."""

from collections.abc import Iterable, Mapping
from typing import TypeAlias, TypeVar

from ephs.operad import Path, Pattern
from ephs.operad.links import closure

T = TypeVar("T")
Shown: TypeAlias = Iterable[tuple[Iterable[Path], T]]
"""States of a part, each by the outer ports that show it, and what it is."""


def pushout(pattern: Pattern, parts: Mapping[Path, Shown[T]]) -> list[tuple[tuple[Path, ...], list[tuple[Path, T]]]]:
    """The states of a composite: those on one junction, or on linked ones, are one.

    So a part that shows one state at two ports identifies the states of the junctions that they are on.

    Returns
    -------
    list of (outer ports, [(box, state)])
        Sorted ports of the whole that show the state, and the states of parts that it is; each of these is in one.
    """
    groups: list[Iterable[Path]] = list(pattern.links)
    hidden: list[tuple[tuple[Path, ...], list[tuple[Path, T]]]] = []
    placed: list[tuple[Path, tuple[Path, T]]] = []
    for box, states in parts.items():
        wires = pattern.boxes[box].ports
        for shown, state in states:
            junctions = [wires[port].junction for port in shown]
            if junctions:
                groups.append(junctions)
                placed.append((junctions[0], (box, state)))
            else:
                hidden.append(((), [(box, state)]))
    joined = closure(groups)
    classes: dict[frozenset[Path], list[tuple[Path, T]]] = {}
    for junction in pattern.junctions:
        classes.setdefault(joined.get(junction) or frozenset((junction,)), [])
    for junction, state in placed:
        classes[joined.get(junction) or frozenset((junction,))].append(state)
    outer = pattern.interface.keys()
    return hidden + [(tuple(sorted(outer & members)), found) for members, found in classes.items()]
