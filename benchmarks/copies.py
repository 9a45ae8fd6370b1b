"""Copies of subsystems of one shape, by the numbers that their contents have in the flattened system.

Fillings of one shape are systems with the same pattern and fillings of the same shapes, and components with the same
ports, whatever their parameters.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.operad import Path
from ephs.semantics.descriptor.numbering import Index, bearing_junctions
from ephs.semantics.primitives.primitives import Storage
from ephs.semantics.systems.system import Filling, System


@final
@dataclass(frozen=True, slots=True, eq=False)
class Copies:
    """Copies of one subsystem of several components.

    Parameters
    ----------
    states, junctions, components
        (copies, …) copy by copy in the same order.
    """

    states: Index
    junctions: Index
    components: Index


def copies_of(system: System) -> tuple[Copies, ...]:
    """All subsystems of several components by their shapes, those inside others before them."""
    finder = _Finder(system)
    for box, part in system.fillings.items():
        finder.visit(part, box)
    return tuple(
        Copies(*(np.array(numbers, dtype=np.int64) for numbers in zip(*found, strict=True)))
        for found in finder.found.values()
    )


@final
class _Finder:
    """The contents of copies by shape; fillings are visited in the order of the flattened system's."""

    def __init__(self, system: System) -> None:
        self.found: dict[int, list[tuple[list[int], list[int], list[int]]]] = {}
        self._junctions = {path: i for i, path in enumerate(bearing_junctions(system.flatten()))}
        self._shapes: dict[Hashable, int] = {}
        self._states = self._components = 0

    def visit(self, filling: Filling, path: Path) -> tuple[int, list[int]]:
        """The shape of a filling, and the numbers of its junctions."""
        content: Hashable
        state, component, junctions = self._states, self._components, list[int]()
        if isinstance(filling, System):
            pattern = filling.pattern
            if not pattern.is_identity:  # its ports are those of what fills it
                own = (path / name for name, each in pattern.junctions.items() if not (each.exposed and each.power))
                junctions += [self._junctions[name] for name in own if name in self._junctions]
            shapes: list[tuple[Path, int]] = []
            for box, part in filling.fillings.items():
                shape, inside = self.visit(part, path / box)
                shapes.append((box, shape))
                junctions += inside
            content = id(pattern), tuple(shapes)
        else:
            storing = isinstance(filling, Storage)
            content = id(filling.interface), None if storing else filling.reads
            self._components += 1
            self._states += len(filling.bundle.ports) if storing else 0
        shape = self._shapes.setdefault(content, len(self._shapes))
        if self._components > component + 1:
            numbers = list(range(state, self._states)), sorted(junctions), list(range(component, self._components))
            self.found.setdefault(shape, []).append(numbers)
        return shape, junctions
