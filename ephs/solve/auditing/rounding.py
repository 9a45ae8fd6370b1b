"""Rounding of a run's energies, in J: of stored energies, and of motion by rounding of positions."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ephs.operad import Quantity, quantity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.descriptor.descriptor import Descriptor
from ephs.semantics.descriptor.numbering import Index
from ephs.semantics.spaces.pairs import Pair
from ephs.semantics.systems.kept import once
from ephs.solve.equations.model import model_of
from ephs.solve.methods.stored import StoredEnergies
from ephs.solve.result.states import RecordedStates

if TYPE_CHECKING:
    from ephs.solve.posing.problem import Problem
    from ephs.solve.result.solution import Solution

SOLVED = 100.0 * float(np.finfo(float).eps)
"""Relative rounding of solved unknowns, times the root of the number of steps: 10 κ ε with a condition κ of 10."""
ROUNDING = 8.0 * float(np.finfo(float).eps)
"""Rounding of a difference of stored amounts, relative to them."""
LINEAR = 3
"""Number of the first linear entry of a twist, (angular, linear)."""
UNIT = np.eye(6)[LINEAR]
POSE = np.eye(6)
"""Twists of a pose's coordinates: (angular, linear)."""
PLACES = {"displacement": POSE[:, 3:4], "angle": POSE[:, :1]}
"""The same of scalars that are places."""


def rounded(solution: "Solution") -> float:
    """Rounding of an energy balance."""
    ledgers = solution.ledgers
    stored = sum(float(np.abs(ledgers.storages[path]).max()) for path, held in ledgers.exergies.items() if held.any())
    return _part(solution) * stored + trembling(solution)


def exchanged(solution: "Solution", kind: str) -> tuple[float, Callable[[], float]]:
    """The largest produced and exchanged amount of a kind, and the relative rounding of the stored amount."""
    ledgers = solution.ledgers
    held = ledgers.entropies if kind == "entropy" else ledgers.volumes
    moved = [np.abs(values - values[0]) for values in held.values()]
    if kind == "entropy":
        moved.append(np.abs(ledgers.made - ledgers.made[0]))
    scale = float(np.max(np.sum(moved, axis=0))) if moved else 0.0

    def rounding() -> float:
        own = ROUNDING * sum(float(np.abs(values).max()) for values in held.values())
        heat = rounded(solution) / ledgers.temperature if kind == "entropy" else 0.0  # of bodies at rest it is rounding
        return (own + heat) / scale

    return scale, rounding


def isolated(solution: "Solution", kind: str) -> bool:
    """Whether no outer power port carries a kind."""
    problem = solution.problem
    return problem is not None and all(slot.quantity.kind != kind for slot in problem.descriptor.outer)


def trembling(solution: "Solution") -> float:
    """Energy of bodies that move by the rounding of their positions in the longest step, and of the forces of storages
    (springs, weight, warm rods) along it: an upper bound for bodies at rest."""
    problem, stats = solution.problem, solution.stats
    if problem is None or not len(solution):
        return 0.0
    h = abs(float(stats.get("longest_step", stats.get("step", 0.0)) or 0.0))
    d, states = problem.descriptor, solution.states
    places = [states[slot.path][:, 4:] for slot in d.states if slot.quantity.kind == "pose"]
    far = max((float(np.abs(place).max(initial=0.0)) for place in places), default=0.0)
    away = _part(solution) * max(far, problem.length)
    x = states.x[-1] if isinstance(states, RecordedStates) else d.pack(solution.state_at(len(solution) - 1))
    mass, turned, pushed = _storage_sizes(problem, float(solution.t[0]), x)
    return 0.5 * mass * (away / h) ** 2 + pushed * away + turned * _part(solution) if h else 0.0


def _storage_sizes(problem: "Problem", t: float, x: Array) -> tuple[float, float, float]:
    """Mass of all bodies in kg; sums of the sizes of torques in N m and forces in N of storages at the states x."""
    d = problem.descriptor
    turning, moving, momenta, velocities = once(d, "places of storages", lambda: _places(d))
    if not (turning.size or moving.size or velocities.size):
        return 0.0, 0.0, 0.0
    stored = StoredEnergies(model_of(problem, t))
    sizes = np.abs(stored.efforts(x)[d.rate_size :])
    unit = x.copy()  # momenta of 1 N s along x: velocities are inverse masses
    unit[momenta] = UNIT
    inverse = stored.efforts(unit)[d.rate_size :][velocities]
    mass = float(np.sum(1.0 / inverse[inverse > 0.0]))
    return mass, float(sizes[turning].sum()), float(sizes[moving].sum())


def _places(d: Descriptor) -> tuple[Index, Index, Index, Index]:
    """Numbers of the efforts of storages that are torques on places, and of those that are forces; (bodies, 6) numbers
    of the momenta of bodies, and those of their velocities along x."""
    turning: list[int] = []
    moving: list[int] = []
    momenta: list[list[int]] = []
    velocities: list[int] = []
    for slot, storage in d.storages:
        for (_, where, carried), state in zip(storage.bundle.items(), slot.reads, strict=True):
            twists = _twists(carried)
            if twists is not None:
                for turns, effort in zip(np.any(twists[:3], axis=0).tolist(), slot.efforts[where], strict=True):
                    (turning if turns else moving).append(effort)
            if carried == quantity.body_momentum:
                momenta.append(list(range(state.point.start, state.point.stop)))
                velocities.append(slot.efforts[where][LINEAR])
    whole = np.array(momenta, dtype=np.int64).reshape(-1, 6)
    one, two, three = (np.array(each, dtype=np.int64) for each in (turning, moving, velocities))
    return one, two, whole, three


def _twists(carried: Quantity) -> Array | None:
    """(6, d) twists of a place's coordinates; None of what is no place."""
    if carried.kind == "pose":
        return POSE
    return Pair.from_space(carried.space).basis if carried.kind == "relative_pose" else PLACES.get(carried.kind)


def _part(solution: "Solution") -> float:
    return SOLVED * float(solution.stats["steps"] or 1) ** 0.5
