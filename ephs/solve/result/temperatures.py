"""Temperatures of storages of heat over a run."""

from typing import TYPE_CHECKING

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import ComponentSlot, Descriptor
from ephs.semantics.primitives.primitives import Storage
from ephs.solve.posing.errors import nearest_of

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution


def heat_storages(descriptor: Descriptor, *, environments: bool) -> dict[Path, tuple[ComponentSlot, Storage]]:
    """Storages with one entropy among their states by path, with or without ``environments``."""
    return {
        slot.path: (slot, storage)
        for slot, storage in descriptor.storages
        if sum(s.quantity.kind == "entropy" for s in slot.reads) == 1 and (environments or not storage.environment)
    }


def temperature_at(solution: "Solution", path: Path) -> Array:
    """(n,) temperature in K of a storage, ∂E/∂s; see `Solution.temperature`."""
    problem = solution.problem
    if problem is None:
        raise TypeError(f"{solution.name} was read from a file without its system, from which temperatures follow")
    known = heat_storages(problem.descriptor, environments=True)
    found = known.get(path) or known.get(Path(tuple(path)[:-1]))
    if found is None or path not in {found[0].path, *(s.path for s in found[0].reads if s.quantity.kind == "entropy")}:
        names = list(map(str, known))
        listed = ", ".join(names) or "none"
        raise KeyError(f"{path}: no such storage with one entropy; known: {listed}{nearest_of(str(path), names)}")
    slot, storage = found
    if storage.environment:
        return np.full(len(solution), problem.reference.temperature)
    (at,) = (where.start for _, where, quantity in storage.bundle.items() if quantity.kind == "entropy")
    ports = list(zip(storage.bundle.ports, slot.reads, strict=True))
    values = {port: np.reshape(solution.states[s.path], (len(solution), -1)) for port, s in ports}
    points = ({port: s.element(values[port][i]) for port, s in ports} for i in range(len(solution)))
    return np.array([storage.energy_gradient(x)[at] for x in points], dtype=float)


def heated(solution: "Solution") -> dict[str, Array]:
    """(n,) temperature in K of each storage of heat but environments, by path."""
    known = [] if solution.problem is None else heat_storages(solution.problem.descriptor, environments=False)
    return {str(path): temperature_at(solution, path) for path in known}
