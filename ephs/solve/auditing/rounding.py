"""Rounding of a run's energies, in J: of stored energies, and of motion by rounding of positions."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

__all__ = ["rounded", "trembling"]

SOLVED = 100.0 * float(np.finfo(float).eps)
"""Relative rounding of solved unknowns, times the root of the number of steps: 10 κ ε with a condition κ of 10."""


def rounded(solution: "Solution") -> float:
    """Rounding of an energy balance."""
    ledgers = solution.ledgers
    stored = sum(float(np.abs(ledgers.storages[path]).max()) for path, held in ledgers.exergies.items() if held.any())
    return _part(solution) * stored + trembling(solution)


def trembling(solution: "Solution") -> float:
    """Energy of bodies that move by the rounding of their positions in the longest step, and of their weight along
    it: an upper bound for bodies at rest."""
    problem, stats = solution.problem, solution.stats
    if problem is None or problem.scene is None:
        return 0.0
    h = abs(float(stats.get("longest_step", stats.get("step", 0.0)) or 0.0))
    places = [values[:, 4:] for values in solution.states.values() if values.ndim == 2 and values.shape[1] == 7]
    far = max((float(np.abs(place).max(initial=0.0)) for place in places), default=0.0)
    mass = sum(float(body.mass) for _, body in problem.scene.all_bodies())
    away = _part(solution) * max(far, problem.length)
    weight = mass * float(np.linalg.norm(problem.scene.world.gravity))
    return 0.5 * mass * (away / h) ** 2 + weight * away if h else 0.0


def _part(solution: "Solution") -> float:
    return SOLVED * float(solution.stats["steps"] or 1) ** 0.5
