"""Whether constant steps resolve a motion: a step against two of half its length, at some instants of a run.

Methods of Gauss type and others that damp nothing at infinity keep their balances whatever a step leaves out: a stiff
brake then stops in a thousand steps instead of one. What shows it is what a step moves from storage to storage. Where
a step and its halves differ in that by a part d, the error of a method of order p is d / (2ᵖ − 1) of it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.mechanics.solve.driven import ComponentMethod, advance_driven
from ephs.mechanics.solve.errors import SolveError
from ephs.mechanics.solve.model import Model, compile_model
from ephs.mechanics.solve.problem import Problem
from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.primitives import Irreversible, Storage

if TYPE_CHECKING:
    from ephs.mechanics.solve.solution import Solution

__all__ = ["StepError", "step_error", "sufficient"]

EACH, MOST = 150, 6
"""One instant is looked at in so many steps, at most so many in all: three steps each."""
STILL = 1e-6
"""Part of the gross energies below which a run of such steps moves nothing."""
SHORTER = 16
"""Number of divisions of a step by four in the search for one that resolves the motion."""
ROUNDED = 1e4 * float(np.finfo(float).eps)
"""Part of the energies that differences of solved steps have lost to rounding."""


@final
@dataclass(frozen=True, slots=True)
class StepError:
    """The estimated error of a step.

    Parameters
    ----------
    size
        Relative to what steps move between storages.
    instant
        Index of the instant where it is largest.
    path
        The component whose share is largest there.
    """

    size: float
    instant: int
    path: Path


def step_error(solution: "Solution", make: Callable[[Model], ComponentMethod], h: float) -> StepError | None:
    """The estimated error of constant steps of h s; None where nothing moves, or no instant can be looked at."""
    problem = solution.problem
    if problem is None or len(solution) < 2:
        return None
    count = int(np.clip(int(solution.stats["steps"]) // EACH, 1, MOST))
    instants = np.unique(np.linspace(0, len(solution) - 1, count, endpoint=False).astype(int)).tolist()
    trials = _Trials(problem, make, float(solution.t[0]))
    found = {i: trials.at(solution, i, h) for i in instants}
    missed = sum(float(np.sum(trial.missed)) for trial in found.values())
    moved, stored = (sum(getattr(trial, name) for trial in found.values()) for name in ("moved", "stored"))
    gross = solution.ledgers.scale * len(instants)
    if moved * solution.stats["steps"] < STILL * gross or missed < ROUNDED * stored:
        return None
    worst = max(instants, key=lambda i: float(np.sum(found[i].missed)))
    path = problem.descriptor.components[int(np.argmax(found[worst].missed))].path
    return StepError(missed / moved / (2.0**trials.method.order - 1.0), worst, path)


def sufficient(
    solution: "Solution", make: Callable[[Model], ComponentMethod], h: float, instant: int, allowed: float
) -> float:
    """A step in s, some h / 4ᵏ, that would resolve what moves at an instant."""
    problem = solution.problem
    assert problem is not None
    trials = _Trials(problem, make, float(solution.t[0]))
    for _ in range(SHORTER):
        h *= 0.25
        trial = trials.at(solution, instant, h)
        if float(np.sum(trial.missed)) <= allowed * (2.0**trials.method.order - 1.0) * trial.moved:
            break
    return h


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """A step and its halves: (components,) by how many J they differ; what they moved, and what is stored, in J."""

    missed: Array
    moved: float
    stored: float


@final
class _Trials:
    """Steps and their halves at instants of a solution, by a method of their own."""

    def __init__(self, problem: Problem, make: Callable[[Model], ComponentMethod], t0: float) -> None:
        d = problem.descriptor
        self.problem = problem
        self.method = make(compile_model(d, problem.reference, problem.inputs(t0, problem.initial)))
        theta = problem.reference.temperature
        kinds = [slot.primitive for slot in d.components]
        self._stores = np.array([float(isinstance(kind, Storage)) for kind in kinds])
        self._joules = self._stores + np.array([theta * isinstance(kind, Irreversible) for kind in kinds])

    def at(self, solution: "Solution", instant: int, h: float) -> _Trial:
        """At one instant; nothing of steps that have no solution."""
        x, t = self.problem.descriptor.pack(solution.state_at(instant)), float(solution.t[instant])
        try:
            coarse, fine = self._after(x, t, h, 1), self._after(x, t, h, 2)
        except SolveError:
            return _Trial(np.zeros_like(self._joules), 0.0, 0.0)
        start = self._stores * self.method.energies(x)
        moved = float(np.sum(np.abs(self._joules * fine - start)))
        return _Trial(np.abs(self._joules * (fine - coarse)), moved, float(np.sum(np.abs(start))))

    def _after(self, x: Array, t: float, h: float, parts: int) -> Array:
        """(components,) energies, and the entropy made since, after h seconds in so many steps.

        Raises
        ------
        SolveError
            A step has no solution.
        """
        state, energies = self.method.init(x), np.zeros(0)
        for k in range(parts):
            state, chunk = advance_driven(self.problem, self.method, state, t + k * h / parts, h / parts)
            if chunk.failure is not None:
                raise chunk.failure
            energies = chunk.energies[-1]
        return energies
