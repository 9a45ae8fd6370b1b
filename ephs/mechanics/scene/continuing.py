"""Elements of registered sections in the states of a solution."""

from collections.abc import Iterator, Mapping

import numpy as np

from ephs.mechanics.scene.build import component_path, initial_state, scene_system
from ephs.mechanics.scene.errors import Fault, fault
from ephs.mechanics.scene.model import Scene
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Storage

NEAR = 1e-6
"""Largest difference of an element's start from a state that it goes on from, relative to one plus its size."""


def inner_states(section: str, name: str, states: Mapping[Path, Array]) -> dict[str, Array]:
    """States of an element's boxes, by their paths below its own."""
    at = tuple(component_path(section, name))
    return {".".join(path[len(at) :]): value for path, value in states.items() if tuple(path[: len(at)]) == at}


def lost_states(scene: Scene, states: Mapping[Path, Array]) -> Iterator[Fault]:
    """Faults of elements that do not start in the states of a solution."""
    own = [*scene.all_elements(), *(("shells", name, of) for name, of in scene.all_shells())]
    if not own:
        return
    start, system = initial_state(scene), scene_system(scene)
    counted = {path for path, of in system.leaves() if isinstance(of, Storage) and of.environment}
    for section, name, _ in own:
        at = component_path(section, name)
        for inner, value in inner_states(section, name, states).items():
            path = Path([*at, *inner.split(".")])
            given = start[path]
            apart = _apart(given, value)
            if Path(path[:-1]) not in counted and apart > NEAR * (1.0 + float(np.abs(value).max(initial=0.0))):
                yield fault("not continued", f"{section}.{name}", f"the state {inner} = {value.tolist()}")


def _apart(given: Array, value: Array) -> float:
    """Largest difference; the quaternions q and −q are one rotation."""
    other = np.concatenate([-value[:4], value[4:]]) if value.size in (4, 7) else value
    return min(float(np.abs(given - each).max(initial=0.0)) for each in (value, other))
