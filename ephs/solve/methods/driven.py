"""Methods that discretise component by component; one step with variable inputs."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.equations.model import Model, evaluate_at
from ephs.solve.methods.natural import Chunk, Natural, NaturalState
from ephs.solve.posing.errors import LARGEST, Outcome, SolveError
from ephs.solve.posing.problem import NO_STATE, Problem, State
from ephs.solve.result.record import joined

ROUNDED_INPUTS = 1e-13
"""Part of inputs that read the state by which they may change once more: rounding, times a condition of hundreds."""
ROUNDS = 12
CUTS = 6
"""Largest number of halvings of a step without solution."""
_CURABLE = (Outcome.DIVERGED, Outcome.SINGULAR, Outcome.CONTRADICTION)
_DOMAINS = (Outcome.TURN, Outcome.TEMPERATURE, Outcome.EXTENT, Outcome.DOMAIN, Outcome.DEPTH)


def advance_whole(
    method: Natural, state: NaturalState, h: float, steps: int, inputs: Array | None = None, cuts: int = CUTS
) -> tuple[NaturalState, Chunk]:
    """Up to so many steps of h seconds; one that has no solution is taken in halves, and these so on ``cuts`` times.

    A part keeps every balance and every joint as a whole step does. A step in which the motion itself leaves the domain
    of a component, as by half a turn, is not cut; one whose iteration does is.
    """
    chunks: list[Chunk] = []
    while steps:
        state, chunk = method.advance(state, h, steps, inputs)
        chunk = _finite(method.model, chunk)
        chunks.append(chunk)
        steps -= chunk.steps
        failure = chunk.failure
        if failure is None or not cuts or failure.outcome not in (*_CURABLE, *_DOMAINS):
            break
        after, parts = advance_whole(method, state, 0.5 * h, 2, inputs, cuts - 1)
        if failure.outcome in _DOMAINS:
            if _leaves(method.model, state.x, after.z if parts.failure is None else state.z, h):
                break
            if parts.failure is not None and failure.outcome in (Outcome.TURN, Outcome.DOMAIN, Outcome.DEPTH):
                chunks[-1] = replace(chunk, failure=failure.of_iteration())
        if parts.failure is not None:
            break
        last = parts.rows[-1:]
        last.ledgers[0, 4] = parts.rows.ledgers[:, 4].min()
        chunks[-1] = replace(chunk, failure=None)
        chunks.append(Chunk(last, parts.iterations, None, 1))
        state, steps = after, steps - 1
    rows = joined([chunk.rows for chunk in chunks])
    assert rows is not None
    rows = replace(rows, t=h * np.arange(1.0, rows.t.size + 1.0))
    iterations, cut = sum(chunk.iterations for chunk in chunks), sum(chunk.cut for chunk in chunks)
    return state, Chunk(rows, iterations, chunks[-1].failure, cut)


def _leaves(model: Model, x: Array, z: Array, h: float) -> bool:
    """Whether a step of h seconds from the states x leaves a component's domain by the unknowns z of another step.

    It counts as if it did where z holds no rates yet.
    """
    last = z.reshape(-1, model.unknowns)[-1]
    return not last[: int(model.tables.counts[0])].any() or bool(evaluate_at(model, x, last, h)[0])


def _finite(model: Model, chunk: Chunk) -> Chunk:
    """The chunk up to the first step whose states are beyond the range of numbers, and that as its failure."""
    sound = np.abs(chunk.rows.x).max(axis=1, initial=0.0) < LARGEST
    if sound.all():
        return chunk
    first = int(np.argmin(sound))
    path = model.state_path(int(np.argmin(np.abs(chunk.rows.x[first]) < LARGEST)))
    return replace(chunk, rows=chunk.rows[:first], failure=SolveError(Outcome.RANGE, path, ""))


def advance_driven(
    problem: Problem, method: Natural, state: NaturalState, t: float, h: float
) -> tuple[NaturalState, Chunk]:
    """One step with inputs at the method's nodes; of the state they are taken at the step's own, by iteration."""
    if problem.constant:
        return advance_whole(method, state, h, 1)
    d, model = problem.descriptor, method.model

    def given(states: Sequence[State]) -> Array:
        pairs = zip(method.nodes, states, strict=True)
        return np.array([model.input_values(problem.inputs(t + node * h, found)) for node, found in pairs])

    if problem.timed:
        return advance_whole(method, state, h, 1, given([NO_STATE] * len(method.nodes)))
    inputs = given([d.unpack(x) for x in method.points(state, h, state.x)])
    first, last = advance_whole(method, state, h, 1, inputs), np.inf
    found = first
    for _ in range(ROUNDS):
        if found[1].failure is not None:
            return found
        again = given([d.unpack(x) for x in method.stage_points(found[0], h, state.x)])
        change = float(np.max(np.abs(again - inputs), initial=0.0))
        if change <= ROUNDED_INPUTS * float(np.max(np.abs(again), initial=0.0)):
            return found
        if change >= 0.9 * last:  # a feedback too stiff for this step: the first guess remains
            return first
        last, inputs = change, again
        found = advance_whole(method, state, h, 1, inputs)
    return found
