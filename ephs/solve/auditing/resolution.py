"""Resolution of a motion by constant steps: two steps against four of half the length, at some times of a run.

Methods of Gauss type and others that damp nothing at infinity keep their balances whatever a step leaves out: a stiff
brake then stops in a thousand steps instead of one. What shows it is what steps move from storage to storage. Where
steps and their halves differ in that by a part d, and d falls with the step by the method's order p, the error is
d / (2ᵖ − 1) of it; where d does not fall, steps leave something out, and the error is d or more. Velocities that follow
from prescribed positions err by turns, one step up and one down: after two such an error is gone.

An even motion moves no energy, and has no such scale. Where d falls, a run with halves of the steps says how far
energies are off.

Natural methods try steps from the states of the solution; methods whose steps are taken one by one try their own, from
states that they were in.

What steps err by in the poses of bodies adds up, too: its sum over all steps, as if errors neither grew nor cancelled,
estimates how far bodies are off at the end, and how much coarser a second run may be that says how they grew
(`growth`).
"""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Generic, TypeVar, final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.primitives.primitives import Irreversible, Storage
from ephs.solve.auditing.growth import Again, apart
from ephs.solve.auditing.retaken import MOST, Retaken, Spread, evenly_spread
from ephs.solve.equations.model import Model, model_of
from ephs.solve.methods.driven import advance_driven
from ephs.solve.methods.natural import Natural
from ephs.solve.methods.paced import Paced
from ephs.solve.posing.breakpoints import Breakpoints
from ephs.solve.posing.problem import Problem
from ephs.solve.result.record import RowBlocks, RunRecord
from ephs.solve.running.control import SLIVER
from ephs.solve.running.snapshot import Snapshot, like, parts
from ephs.solve.running.stepping import Instant, Instants, Stepper

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution

S = TypeVar("S")
Tried = tuple[Array, Array]
"""States and energies."""
EACH, LEAST = 600, 4
"""One time is looked at in so many steps, at least and at most so many in all: nine steps each."""
PAIR = 2
"""Number of steps whose energies are held against those of their halves."""
STILL = 1e-6
"""Fraction of the gross energies below which a run counts as at rest."""
SHORTER = 16
"""Largest number of divisions by four in the search of a sufficient step."""
ROUNDED = 1e4 * float(np.finfo(float).eps)
"""Rounding of differences of solved steps, as a fraction of the energies."""


@final
@dataclass(frozen=True, slots=True)
class StepError:
    """The estimated error of a step.

    Parameters
    ----------
    size
        Relative to what steps move between storages, of poses in lengths of the mechanism or rad.
    trial
        The number of the trial where it is largest.
    path
        The component whose share is largest there.
    """

    size: float
    trial: int
    path: Path


@final
@dataclass(frozen=True, slots=True, eq=False)
class Trials:
    """Steps and their halves from some times of a run.

    Parameters
    ----------
    problem
        Whose components the energies are of.
    order
        Of the method.
    times
        In s.
    tried
        Of the number of a time, a step in s and a number of steps, at the start, after them, and after their halves:
        (point_size,) states; (components,) energies of the storages, and entropies that the others made.
    own
        Those by the method's own steps, where these are by another's.
    again
        Further runs of the problem, where this one reached its end.
    """

    problem: Problem
    order: int
    times: tuple[float, ...]
    tried: Callable[[int, float, int], tuple[Tried, Tried, Tried]]
    own: "Trials | None" = None
    again: Again | None = None

    def error(self, h: float, steps: int, gross: float) -> StepError | None:
        """By which part constant steps of h s and their halves differ; None at rest, or without possible trials.

        Parameters
        ----------
        steps, gross
            How many there were, and the gross energies of the run in J.
        """
        found = [self._trial(k, h) for k in range(len(self.times))]
        missed, moved = sum(float(trial[0].sum()) for trial in found), sum(trial[1] for trial in found)
        stored = sum(trial[2] for trial in found)
        if not found or moved * steps / PAIR < STILL * gross * len(found) or missed < ROUNDED * stored:
            return None
        worst = max(range(len(found)), key=lambda k: float(np.sum(found[k][0])))
        path = self.problem.descriptor.components[int(np.argmax(found[worst][0]))].path
        return StepError(missed / moved, worst, path)

    def motion(self, h: float, steps: int) -> StepError | None:
        """The error of bodies after so many constant steps of h s, in lengths of the mechanism or rad.

        None where there are no bodies, or nothing can be tried.
        """
        bodies = [slot for slot in self.problem.descriptor.states if slot.quantity.kind == "pose"]
        found: list[tuple[float, int, Path]] = []
        for k in range(len(self.times)) if bodies else ():
            try:
                _, coarse, fine = (x for x, _ in self.tried(k, h, 1))
            except Exception:  # no solution, or an input that fails beyond the end of the run
                continue
            off = [float(apart(coarse[slot.point], fine[slot.point], self.problem.length)) for slot in bodies]
            worst = int(np.argmax(off))
            found.append((off[worst], k, bodies[worst].path))
        if not found:
            return None
        times = 2.0**self.order / (2.0**self.order - 1.0)
        size = times * steps * sum(off for off, _, _ in found) / len(found)
        _, k, path = max(found, key=lambda each: each[0])
        return StepError(size, k, path)

    def converges(self, h: float, allowed: float) -> bool:
        """Whether halves of steps of h s differ less than these by the method's order, wherever these differ much.

        Parameters
        ----------
        allowed
            The error that is allowed, relative to what steps move between storages.
        """
        found, shorter = ([self._trial(k, each) for k in range(len(self.times))] for each in (h, 0.5 * h))
        missed, halves = (np.sum([trial[0] for trial in each], axis=0) for each in (found, shorter))
        moved, stored = (sum(trial[i] for trial in found) for i in (1, 2))
        much = missed > max(allowed * moved / len(missed), ROUNDED * stored)
        return bool(np.all(halves[much] <= missed[much] / 2.0 ** (self.order - 1)))

    def sufficient(self, k: int, h: float, allowed: float) -> float | None:
        """A step in s, some h / 4ᵏ, that resolves the motion at a time."""
        for _ in range(SHORTER):
            h *= 0.25
            missed, moved, _ = self._trial(k, h)
            if float(np.sum(missed)) <= allowed * moved:
                return h
        return None

    def _trial(self, k: int, h: float) -> tuple[Array, float, float]:
        """(components,) by how many J steps and their halves differ; what they moved, and what is stored, in J.

        Nothing of steps that have no solution.
        """
        kinds = [slot.primitive for slot in self.problem.descriptor.components]
        stores = np.array([float(isinstance(kind, Storage)) for kind in kinds])
        theta = self.problem.reference.temperature
        joules = stores + np.array([theta * isinstance(kind, Irreversible) for kind in kinds])
        try:
            start, coarse, fine = (energies for _, energies in self.tried(k, h, PAIR))
        except Exception:  # no solution, or an input that fails beyond the end of the run
            return np.zeros_like(joules), 0.0, 0.0
        moved = float(np.sum(np.abs(joules * (fine - start))))
        return np.abs(joules * (fine - coarse)), moved, float(np.sum(np.abs(stores * start)))


def _clear(t: float, h: float, until: float, jumps: Sequence[float]) -> bool:
    """Whether a step from t ends within the run and meets no jump but at its ends."""
    first, last = min(t, t + h), max(t, t + h)
    k = bisect_right(jumps, first)
    return min(t, until) <= first and last <= max(t, until) and (k == len(jumps) or jumps[k] >= last)


def natural_trials(
    solution: "Solution",
    make: Callable[[Model], Natural],
    h: float,
    own: Natural | None = None,
    jumps: Sequence[float] = (),
) -> Trials | None:
    """Steps of h s by a natural method from states of a solution; None where there are none.

    Parameters
    ----------
    own
        The method of the run, which serves where its model is that of the solution; ``make`` makes one else.
    jumps
        Times in s that no step goes over.
    """
    problem = solution.problem
    if problem is None or len(solution) < 2:
        return None
    t, d = solution.t, problem.descriptor
    count = int(np.clip(int(solution.stats["steps"]) // EACH, LEAST, MOST))
    spread = evenly_spread(len(solution) - 1, count)
    end = np.inf if int(solution.stats["steps"]) < PAIR else float(t.max()) + SLIVER * h
    instants = [i for i in spread if _clear(float(t[i]), PAIR * h, end, jumps)]
    if own is None or own.model.descriptor is not d:
        own = make(model_of(problem, float(t[0])))
    method, makers = own, np.array([isinstance(slot.primitive, Irreversible) for slot in d.components])

    @lru_cache(2 * len(instants))
    def tried(k: int, h: float, count: int) -> tuple[Tried, Tried, Tried]:
        x, when = d.pack(solution.state_at(instants[k])), float(t[instants[k]])
        coarse, fine = (_after(problem, method, x, when, count * h, steps) for steps in (count, 2 * count))
        return (x, np.where(makers, 0.0, method.energies(x))), coarse, fine

    return Trials(problem, method.order, tuple(float(t[i]) for i in instants), tried)


def _after(problem: Problem, method: Natural, x: Array, t: float, h: float, count: int) -> Tried:
    """States, (components,) energies, and the entropy made since, after h seconds in so many steps.

    Raises
    ------
    SolveError
        A step has no solution.
    """
    state, energies = method.init(x), np.zeros(0)
    for k in range(count):
        state, chunk = advance_driven(problem, method, state, t + k * h / count, h / count)
        if chunk.failure is not None:
            raise chunk.failure
        energies = chunk.rows.energies[-1]
    return state.x, energies


@final
class Samples(Generic[S]):
    """States of a run at even intervals, see `Spread`; none if not ``wanted``.

    Besides some of its steps where these are to be ``retaken``.
    """

    def __init__(self, *, wanted: bool, retaken: bool = False) -> None:
        self._wanted = wanted
        self.retaken: Retaken[S] = Retaken(wanted=retaken)
        self._spread = Spread[Instant[S]]()

    @property
    def states(self) -> list[Instant[S]]:
        """Those that are kept."""
        return self._spread.kept

    def add(self, rows: Instants[S]) -> None:
        """Times and states in order, with what a step made at least."""
        if self._wanted:
            self._spread.add(rows)

    def snapshot(self) -> Snapshot:
        """Snapshot for `restore`."""
        states, counts = [parts(instant) for instant in self.states], [self._spread.count, self._spread.stride]
        return {"states": states, "counts": counts, "retaken": self.retaken.snapshot()}

    def restore(self, snapshot: Snapshot, template: S) -> None:
        """Go on from a snapshot of states like the template."""
        states = [(t, like(template, found), least) for t, found, least in snapshot["states"]]
        self._spread.resume(states, snapshot["counts"])
        self.retaken.restore(snapshot["retaken"], template)


def trials_of(
    solution: "Solution",
    make: Callable[[Model], Natural] | None,
    problem: Problem,
    stepper: Stepper[Any],
    order: int,
    samples: Sequence[Instant[Any]],
    h: float,
    until: float,
    breakpoints: Breakpoints,
) -> Trials | None:
    """Constant steps of a method with an order, from its own states; of a natural method by ``make``.

    A natural method's own are tried from states of the solution.

    Parameters
    ----------
    problem
        As it is solved; in its unit of time are the samples, the step h, negative backward, the present time ``until``,
        beyond which inputs are not asked unless there was one step, and the jumps.
    """
    jumps = breakpoints.times
    seconds, steps = problem.seconds, int(solution.stats["steps"])
    natural, paced = None, stepper if isinstance(stepper, Paced) else None
    if make is not None:
        own = paced.method if paced is not None else None
        natural = natural_trials(solution, make, abs(h) * seconds, own, [seconds * t for t in jumps])
    if paced is not None:
        return natural
    end = until + (h if steps < PAIR else SLIVER * h)
    clear = [(t, state) for t, state, _ in samples if _clear(t, PAIR * h, end, jumps)]
    if not clear:
        return natural
    count = int(np.clip(steps // EACH, LEAST, MOST))
    chosen = [clear[i] for i in evenly_spread(len(clear), count)]
    sign = float(np.sign(h))

    @lru_cache(2 * len(chosen))
    def tried(k: int, h: float, count: int) -> tuple[Tried, Tried, Tried]:
        h = sign * h / seconds
        breakpoints.stand(chosen[k][0])
        start = stepper.anew(chosen[k][1])
        states = [start]
        for length, number in ((h, count), (0.5 * h, 2 * count)):
            states.append(stepper.anew(start))
            for _ in range(number):
                states[-1] = stepper.step(states[-1], length).end
        _, shown = _shown(problem, stepper.record([(start.t, state, 0.0) for state in states]))
        first, second, third = zip(shown.x, shown.energies, strict=True)
        return first, second, third

    none = RowBlocks().whole(problem.descriptor)
    own = Trials(_shown(problem, none)[0], order, tuple(t * seconds for t, _ in chosen), tried)
    return own if natural is None else replace(natural, own=own)


def _shown(problem: Problem, record: RunRecord) -> tuple[Problem, RunRecord]:
    """Problem and rows as a solution shows them."""
    while problem.shown is not None:
        problem, record, _ = problem.shown(record, {})
    return problem, record
