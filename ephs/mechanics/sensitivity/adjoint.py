"""`gradient`: derivatives of a sum of readings by many parameters at once, by reverse accumulation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.methods.explicit import tableau
from ephs.mechanics.runs.signals import numbers_of
from ephs.mechanics.runs.simulate import simulate
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.sensitivity.explicit import ExplicitTangent
from ephs.mechanics.sensitivity.family import ParameterFamily, differentiated, relation_of
from ephs.mechanics.sensitivity.sensitivity import ATOL, RTOL, steps_of
from ephs.mechanics.tree.engine.adjoints import StepAdjoint
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.codes import VECTOR
from ephs.semantics.systems.system import System
from ephs.solve.equations.sparse import Index
from ephs.solve.methods.own import Method
from ephs.solve.posing.errors import OptionError, failing_at, number_of
from ephs.solve.running.threads import in_one_thread

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@final
@dataclass(frozen=True, slots=True, eq=False)
class Gradient:
    """A weighted sum of readings of a motion, and its derivatives.

    Parameters
    ----------
    value
        The sum.
    derivatives
        Path of a parameter -> derivative by it.
    tables
        Table of the mechanism's equations -> derivative by each of its numbers.
    """

    value: float
    derivatives: Mapping[str, float]
    tables: Mapping[str, Array]


@in_one_thread
def gradient(
    model: System | Scene,
    parameters: Sequence[str],
    times: "ArrayLike",
    weights: "Mapping[str, ArrayLike]",
    *,
    t0: float = 0.0,
    initial: "Mapping[str, ArrayLike] | None" = None,
    method: str | Method = "rk87",
    rtol: float = RTOL,
    atol: float = ATOL,
    step: float | None = None,
    inputs: Mapping[str, Any] | None = None,
) -> Gradient:
    """Σ weights · readings of a motion, by all parameters at once: reverse accumulation through its steps.

    A run of `simulate` chooses the steps, which also end at the times; then they are kept. The state before each step
    is stored; in the backward pass, the step is recorded on a tape and differentiated completely, with the closing of
    loops and the correction of the energy balance. The time of the steps does not depend on the number of parameters;
    the model's tables are built again for each. For few parameters and many signals use `sensitivity`. For the
    gradient of a sum of squares, the weights are twice the residuals.

    Parameters
    ----------
    parameters
        Paths, as for `ephs.sensitivity`.
    times
        (n,) ascending, in s, after the start.
    weights
        ``joints.pin.coordinate`` or ``joints.pin.rate`` -> (n,) or (n, d), for the degrees of freedom of a joint of the
        tree whose elements are its coordinates; of a system the joint's path, ``linkage.joints.pin.rate``.
    method
        ``"rk54"``, ``"rk87"`` or an `ephs.Method`.

    Raises
    ------
    OptionError
        A model, a signal or a method has no such gradient, or inputs are functions.
    SimulationError
        The run failed.
    """
    t0 = number_of("t0", t0)
    if not isinstance(method, Method) and method not in ("rk54", "rk87"):
        raise OptionError("method", method, "rk54, rk87 or an ephs.Method")
    family = ParameterFamily(model, parameters, initial, inputs, None, joints=True)
    forward = ExplicitTangent(family, t0, tableau(method, chosen=step is None))
    if not family.problem.constant:
        raise OptionError("inputs", "a function", "constants; ephs.sensitivity takes functions of time")
    wanted = numbers_of(times)
    if wanted is None or not (wanted.ndim == 1 and wanted.size and np.all(np.diff(wanted) > 0.0) and wanted[0] > t0):
        raise OptionError("times", times, f"ascending times after {t0:g} s")
    if not isinstance(weights, Mapping) or not weights:
        raise OptionError("weights", weights, "a joint's reading and its weights at least")
    control = steps_of(step, rtol, atol)
    run: dict[str, Any] = {"t0": t0, "initial": initial, "method": method, "inputs": inputs}
    grid = np.union1d(simulate(model, float(wanted[-1]), **run, **control).t, wanted)
    with differentiated(parameters, t0):
        return _taken_back(family, forward, grid, wanted, weights)


def _taken_back(
    family: ParameterFamily, forward: ExplicitTangent, grid: Array, wanted: Array, weights: "Mapping[str, ArrayLike]"
) -> Gradient:
    """The gradient along the steps of a grid, which end at the wanted times too."""
    point, eq = forward.begin(), forward.equations
    seeds = [_seed(eq, name, numbers_of(given), wanted.size) for name, given in weights.items()]
    steps = StepAdjoint(eq.engine, partial(relation_of, family.problem.descriptor), forward.tangents[0][1])
    q, y = point.state.q, eq.vector(point.state)
    states, value = list[tuple[Array, Array]](), 0.0
    for before, after in zip(grid[:-1].tolist(), grid[1:].tolist(), strict=True):
        states.append((q, y))
        with failing_at(before):
            status, q, y = steps.step(q, y, after - before)
            eq.refuse(status, eq.engine.failed)
        y[: eq.nv] = 0.0
        for place in np.flatnonzero(wanted == after):
            value += sum(float(w[place] @ (q if of_q else y)[where]) for where, of_q, w in seeds)
    by_q, by_y = np.zeros(q.size), np.zeros(y.size)
    for k in range(len(states) - 1, -1, -1):
        for place in np.flatnonzero(wanted == grid[k + 1]):
            for where, of_q, w in seeds:
                (by_q if of_q else by_y)[where] += w[place]
        by_q, by_y = steps.back(*states[k], float(grid[k + 1] - grid[k]), by_q, by_y)
        by_y[: eq.nv] = 0.0
    by_q, by_y = steps.begin(point.state.q, eq.vector(point.state), by_q, by_y)
    found = point.q @ by_q + point.y @ by_y[eq.nv :]
    for which, tangent in forward.tangents:
        for name, slopes in tangent.slopes.items():
            count = which.stop - which.start
            found[which] += steps.tables[name].ravel() @ slopes.reshape(-1, slopes.shape[-1])[:, :count]
    names = [parameter.path for parameter in family.parameters]
    return Gradient(value, dict(zip(names, found.tolist(), strict=True)), steps.tables)


def _seed(eq: ReducedEquations, name: str, weights: Array | None, count: int) -> tuple[Index, bool, Array]:
    """Places of a reading in q or y, which of both, and its weights (n, d)."""
    path, _, key = str(name).rpartition(".")
    joint = path if path in eq.layout.freedoms else path.removeprefix("joints.")
    freedoms = eq.layout.freedoms.get(joint)
    parts = eq.layout.edges.get(joint, ())
    flat = freedoms is not None and all(edge.pair.code == VECTOR for _, edge in parts) and freedoms.max() < eq.n
    if freedoms is None or not flat or key not in ("coordinate", "rate"):
        raise OptionError("weights", name, "joints.….coordinate or joints.….rate of a joint of the tree, not a ball's")
    if weights is None or weights.size != count * freedoms.size:
        found = "no numbers" if weights is None else weights.shape
        raise OptionError(f"weights[{name!r}]", found, f"({count}, {freedoms.size})")
    if not np.all(np.isfinite(weights)):
        raise OptionError(f"weights[{name!r}]", weights.tolist(), "finite numbers")
    where = eq.layout.elements[joint] if key == "coordinate" else eq.nv + freedoms
    return where, key == "coordinate", weights.reshape(count, freedoms.size)
