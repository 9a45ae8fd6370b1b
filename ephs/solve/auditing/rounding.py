"""Rounding of a run's energies, in J: of stored energies, and of motion by rounding of positions."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ephs.operad import Quantity
from ephs.semantics.bundle import Array
from ephs.semantics.primitives import Storage
from ephs.semantics.spaces.pairs import Pair

if TYPE_CHECKING:
    from ephs.solve.problem import Problem
    from ephs.solve.result.solution import Solution

SOLVED = 100.0 * float(np.finfo(float).eps)
"""Relative rounding of solved unknowns, times the root of the number of steps: 10 κ ε with a condition κ of 10."""
ROUNDING = 8.0 * float(np.finfo(float).eps)
"""Rounding of a difference of stored amounts, relative to them."""
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
    places = [values[:, 4:] for values in solution.states.values() if values.ndim == 2 and values.shape[1] == 7]
    far = max((float(np.abs(place).max(initial=0.0)) for place in places), default=0.0)
    mass = 0.0 if problem.scene is None else sum(float(body.mass) for _, body in problem.scene.all_bodies())
    away = _part(solution) * max(far, problem.length)
    turned, pushed = _pushes(problem, problem.descriptor.pack(solution.state_at(len(solution) - 1)))
    return 0.5 * mass * (away / h) ** 2 + pushed * away + turned * _part(solution) if h else 0.0


def _pushes(problem: "Problem", x: Array) -> tuple[float, float]:
    """Sums of the sizes of torques in N m and forces in N of storages at the states x."""
    turned, pushed = 0.0, 0.0
    for slot in problem.descriptor.components:
        of = slot.primitive
        if isinstance(of, Storage) and any(_twists(port.quantity) is not None for port in of.interface.values()):
            effort = np.abs(of.effort(problem.descriptor.point(slot, x), problem.reference))
            for _, where, quantity in of.bundle.items():
                twists = _twists(quantity)
                if twists is not None:
                    turns = np.abs(twists[:3]).max(axis=0) > 0.0
                    turned += float(effort[where][turns].sum())
                    pushed += float(effort[where][~turns].sum())
    return turned, pushed


def _twists(quantity: Quantity) -> Array | None:
    """(6, d) twists of a place's coordinates; None of what is no place."""
    if quantity.kind == "pose":
        return POSE
    return Pair.from_space(quantity.space).basis if quantity.kind == "relative_pose" else PLACES.get(quantity.kind)


def _part(solution: "Solution") -> float:
    return SOLVED * float(solution.stats["steps"] or 1) ** 0.5
