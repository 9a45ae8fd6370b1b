"""How far roundings may move what a record says: its operations run with random errors.

Comparing two evaluations of one formula needs it: cosh x − 1 has no right digit at x = 1e-9, and x⁴ has all of them.
"""

import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.semantics.derive.charts import moved
from ephs.semantics.derive.recording import Recording
from ephs.semantics.derive.relating import StatePort, spans_of
from ephs.semantics.derive.tape import OPERATIONS, Tape
from ephs.semantics.stage.duals import Duals
from ephs.semantics.stage.evaluator import Evaluator
from ephs.semantics.stage.numbers import Real
from ephs.semantics.stage.plain import PLAIN

ROUNDED = 64.0 * float(np.finfo(float).eps)
"""Relative error of an operation: functions are good to a few roundings, and sums may be taken in another order."""
NORMAL = float(np.finfo(float).tiny)
"""Below it numbers are rounded by as much as there."""
SPREAD = 8.0
"""Largest error that roundings add up to, relative to what random ones do in `RUNS` runs."""
RUNS = 4

Factor = Callable[[], float]


def exactly() -> float:
    """The factor of an operation without an error."""
    return 1.0


def rounding(of: Callable[[Factor], Array], found: Array) -> Array:
    """Bound of the error of what is found by operations, each of which is multiplied by a factor."""
    worst = np.zeros(found.shape)
    for factor in _errors():
        with np.errstate(all="ignore"):
            worst = np.fmax(worst, np.abs(of(factor) - found))
    return SPREAD * worst


def steps_of(recording: Recording, numbers: Sequence[float], factor: Factor = exactly) -> Array:
    """The results of all operations of a record, each times a factor; NaN where one has no value."""
    tape = recording.tape
    whole = replace(tape, outputs=tuple(range(len(tape.operations))), shape=(len(tape.operations),))
    return np.array(_run(PLAIN, whole, [np.float64(x) for x in numbers], recording.parameters, factor), dtype=float)


def slopes_of(
    tape: Tape, ports: Sequence[StatePort], x: Sequence[float], parameters: Sequence[float], factor: Factor = exactly
) -> Array:
    """dE (n,), left-trivialised, of a recorded energy; exact up to rounding, NaN where it has no value."""
    n = sum(port.dim for port in ports)
    duals = Duals(PLAIN, n)
    states: list[Real] = []
    with np.errstate(all="ignore"):
        for port, own, by in spans_of(ports):
            point = [duals.dual(np.float64(each)) for each in x[own]]
            states += moved(duals, port.code, point, [duals.along(np.float64(0.0), i) for i in range(n)[by]])
    (found,) = _run(duals, tape, states, parameters, factor)
    return np.array(duals.dual(found).slopes, dtype=float) * np.ones(n)


def _run(on: Evaluator, tape: Tape, inputs: Sequence[Real], parameters: Sequence[float], factor: Factor) -> list[Real]:
    def scaled(operation: Callable[..., Any]) -> Callable[..., Any]:
        def rounded(*arguments: Any) -> Any:
            share, found = factor(), operation(on, *arguments)
            return found * share + (share - 1.0) * NORMAL

        return rounded

    names = {name for name, _, _ in tape.operations if name in OPERATIONS}
    table: Mapping[str, Callable[..., Any]] = {name: scaled(OPERATIONS[name]) for name in names}
    with np.errstate(all="ignore"):
        try:
            return tape.run(table, lambda number: number, inputs, [np.float64(value) for value in parameters])
        except ArithmeticError:  # of two numbers of the formula, as 1/0
            return [np.float64(np.nan)] * len(tape.outputs)


def _errors() -> Iterator[Factor]:
    source = random.Random(22)
    for _ in range(RUNS):
        yield lambda: 1.0 + source.uniform(-ROUNDED, ROUNDED)
