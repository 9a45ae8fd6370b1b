"""`sensitivity`: how a motion changes with the model's numbers and initial values."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from threading import Lock
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.runs.signals import times_of
from ephs.mechanics.runs.simulate import simulate
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.sensitivity.family import CENTRAL, Parameter, ParameterFamily, difference, differentiated
from ephs.mechanics.sensitivity.readings import reading_of
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.systems.system import System
from ephs.solve.methods.own import Method
from ephs.solve.posing.errors import OptionError, failing_at, nearest_of, number_of
from ephs.solve.result.replay import replay
from ephs.solve.result.solution import Solution
from ephs.solve.running.control import Tolerance
from ephs.solve.running.threads import in_one_thread

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

RTOL, ATOL = 1e-9, 1e-11
"""Tolerances of runs that are differentiated: of the values and of their derivatives."""
METHODS = ("rk54", "rk87", "natural")
NEAR = 2.0**-7
"""Step of readings along a tangent, as states move."""
FINE, KINK, NOISE = 2.0**-10, 1e-6, 1e-12
"""Part of this step for readings that have a kink within it; and the difference of both, relative to the largest
derivative and as rounding of values, by which a kink is told."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """A motion and its derivatives by parameters.

    Parameters
    ----------
    model
        The scene or the system.
    solution
        The motion.
    parameters
        What it is differentiated by: path and value of each.
    neighbour
        The motion beside it: from a parameter's number, an offset of the model and one of the states along their
        tangents, in its unit.
    offsets
        (p,) steps along the tangents.
    """

    model: System | Scene
    solution: Solution
    parameters: tuple[Parameter, ...]
    neighbour: Callable[[int, float, float], Solution]
    offsets: Array

    @property
    def t(self) -> Array:
        """(n,) times in s."""
        return self.solution.t

    @property
    def paths(self) -> tuple[str, ...]:
        """The parameters' paths, in the order of the last axis of every derivative."""
        return tuple(parameter.path for parameter in self.parameters)

    def __getitem__(self, name: str) -> Array:
        """(n, …, p) the derivative of a reading: a state's path, ``joints.pin.coordinate``, ``bodies.rod.position``,
        ``heat``; see `ephs.mechanics.sensitivity.readings`.

        Raises
        ------
        OptionError
            There is nothing of that name.
        """
        return self.of(reading_of(self.model, name))

    def __contains__(self, name: str) -> bool:
        """Whether there is a reading of this name."""
        try:
            reading_of(self.model, name)
        except OptionError:
            return False
        return True

    def of(self, function: "Callable[[Solution], ArrayLike]") -> Array:
        """(…, p) the derivative of anything that is read from a `Solution`: its final state, an integral over its
        times, heat or work; numbers, or an array.

        The function is differenced along the trajectory's tangents, to sixth order: of smooth ones rounding is left.
        Numbers with a kink near by, as energies where a contact begins, are differenced within a thousandth of that
        distance; at a kink the derivative is the mean of both sides.
        """
        columns: list[Array] = []
        for j, parameter in enumerate(self.parameters):
            step = float(self.offsets[j])

            def read(model: float, states: float = 0.0, j: int = j) -> Array:
                return np.asarray(function(self.neighbour(j, model, states)), dtype=float)

            wide, near = (difference(partial(read, 0.0), CENTRAL, e) for e in (step, FINE * step))
            noise = NOISE * np.abs(read(0.0)) / (FINE * step)
            along = np.where(np.abs(wide - near) > KINK * np.abs(near).max(initial=0.0) + noise, near, wide)
            own = difference(read, parameter.stencil, parameter.step)
            columns.append(along + own)
        return np.stack(columns, axis=-1)

    def __repr__(self) -> str:
        return f"Sensitivity of {self.solution.name} to {', '.join(self.paths)}: {len(self.solution)} instants"


@in_one_thread
def sensitivity(
    model: System | Scene,
    parameters: Sequence[str],
    until: float,
    *,
    t0: float = 0.0,
    initial: "Mapping[str, ArrayLike] | None" = None,
    method: str | Method = "auto",
    rtol: float = RTOL,
    atol: float = ATOL,
    step: float | None = None,
    save_at: "ArrayLike | None" = None,
    inputs: Mapping[str, Any] | None = None,
    reference: Reference | None = None,
) -> Sensitivity:
    """The motion of a model with its derivatives by parameters: derivatives of the discrete steps.

    A run of `simulate` chooses the step sizes, which are then kept. The computed motion is then a smooth function of
    the parameters, and the result is its derivative, to rounding.

    Parameters
    ----------
    parameters
        Paths of numbers: ``bodies.crank.mass``, ``bodies.crank.inertia[0]``, ``joints.pin.friction``,
        ``joints.pin.coordinate`` (initial values of joints), ``joints.pin.frame1.position[0]``, ``osc.pe.k``, and of a
        system initial values by the paths of its states, ``osc.pe.q``. See `ephs.mechanics.scene.parameters`.
    method
        ``"rk54"``, ``"rk87"`` or an `ephs.Method`, with or without ``step``; ``"natural"`` with ``step``. ``"auto"``:
        natural with a step, else rk87.
    inputs
        As for `simulate`: functions of time alone, constant ones for natural.

    Raises
    ------
    OptionError
        The method has no tangent, a path does not exist, or derivatives are too long to be compiled.
    SimulationError
        The run failed.
    """
    name = _method(method, step)
    run: dict[str, Any] = {"t0": t0, "initial": initial, "method": name, "inputs": inputs, "reference": reference}
    family = ParameterFamily(model, parameters, initial, inputs, reference, joints=name != "natural")
    control = steps_of(step, rtol, atol)
    times = times_of(save_at, number_of("t0", t0), number_of("until", until))
    if times is not None and not times.size:
        raise OptionError("save_at", save_at, "at least one time in s")
    grid = simulate(model, until, **run, **control).t
    with differentiated(parameters, float(grid[0])):
        return _along(family, name, grid, times, chosen=step is None)


def steps_of(step: float | None, rtol: float, atol: float) -> dict[str, Any]:
    """Options of the run whose steps are kept; tolerances have no part in constant ones, but are checked."""
    for name, given in (("rtol", rtol), ("atol", atol)):
        Tolerance.of(name, given, 0.0)
    return {"rtol": rtol, "atol": atol} if step is None else {"step": step}


def _method(method: str | Method, step: float | None) -> str | Method:
    if isinstance(method, Method):
        return method
    found = method
    if method == "auto":
        found = "natural" if step is not None else "rk87"
    if found not in METHODS:
        raise OptionError(
            "method", method, f"one of auto, {', '.join(METHODS)}, which have tangents{nearest_of(method, METHODS)}"
        )
    if found == "natural" and step is None:
        raise OptionError("step", step, "a number of seconds: the tangent of natural is that of constant steps")
    return found


def _along(
    family: ParameterFamily, method: str | Method, grid: Array, times: Array | None, *, chosen: bool
) -> Sensitivity:
    """The tangent along the steps of a grid; kept at its times, or at others, by shortened steps."""
    t0, name = float(grid[0]), method.name if isinstance(method, Method) else method
    if method == "natural":
        from ephs.mechanics.sensitivity.implicit import NaturalTangent

        stepper: Any = NaturalTangent(family, t0)
    else:
        from ephs.mechanics.methods.explicit import tableau
        from ephs.mechanics.sensitivity.explicit import ExplicitTangent

        stepper = ExplicitTangent(family, t0, tableau(method, chosen=chosen))
    point = stepper.start()
    wanted = grid if times is None else times
    kept: list[Any] = [point] if wanted[0] == t0 else []
    for before, after in zip(grid[:-1].tolist(), grid[1:].tolist(), strict=True):
        with failing_at(before):
            for when in wanted[(wanted - before) * (wanted - after) < 0.0].tolist():
                kept.append(stepper.step(point, when - before))
            point = stepper.step(point, after - before)
        if after in wanted:
            kept.append(point)
    alone = Lock()  # neighbours are evaluated in memory of their own problem
    solution = replay(family.problem, wanted, stepper.rows(kept), name)

    def neighbour(number: int, model: float, states: float) -> Solution:
        with alone:
            problem, rows = stepper.beside(number, model, states, kept)
        return replay(problem, wanted, rows, name)

    sizes = [max((stepper.size(p, j) for p in kept), default=0.0) for j in range(len(family.parameters))]
    offsets = np.array([NEAR / size if size else 1.0 for size in sizes])
    return Sensitivity(family.model, solution, family.parameters, neighbour, offsets)
