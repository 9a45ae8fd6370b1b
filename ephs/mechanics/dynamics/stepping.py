"""One step of any method, from a state of the reduced form."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, final

import numpy as np
from numpy.typing import ArrayLike

from ephs.mechanics.dynamics.opening import HardContacts
from ephs.mechanics.dynamics.placing import ByJoint
from ephs.mechanics.methods.explicit import Tableau, tableau
from ephs.mechanics.methods.method import ReducedMethod
from ephs.mechanics.methods.registry import Setting, chosen
from ephs.mechanics.runs.pushes import sum_of
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.solve.methods.own import Method
from ephs.solve.posing.errors import OptionError, number_of
from ephs.solve.posing.problem import Problem, Signal
from ephs.solve.running.control import Control, Tolerance

if TYPE_CHECKING:
    from ephs.mechanics.methods.registry import MethodEntry

RTOL, ATOL = 1e-10, 1e-12
"""Tolerances of the equations of one implicit step: near rounding; its error depends on its length."""
EXPLICIT = ("rk54", "rk87")


@final
class Steps:
    """Single steps of one mechanism under the present inputs."""

    def __init__(self, problem: Problem, equations: ReducedEquations, hard: HardContacts) -> None:
        self._problem, self._equations, self._hard = problem, equations, hard

    def step(
        self, state: ReducedState, h: float, method: "str | Method | MethodEntry", forces: ByJoint | None
    ) -> ReducedState | Mapping[Path, Array]:
        """The state of the reduced form, or all states of the system where the method is not of that form.

        ``forces`` are in what drives the equations already.

        Raises
        ------
        OptionError
            There is no such method, it takes no constant steps, or h is no length of a step.
        SolveError
            The step has no solution.
        SimulationError
            A hard contact is closed before or after an explicit step, which has no impulses.
        """
        h = number_of("h", h)
        if not (np.isfinite(h) and h != 0.0):
            raise OptionError("h", h, "a number of seconds other than 0")
        if isinstance(method, Method) or (isinstance(method, str) and method in EXPLICIT):
            return self._explicit(state, h, tableau(method, chosen=False))
        of, _ = chosen(method, self._problem, step=abs(h))
        tolerance = Tolerance.of("rtol", RTOL, RTOL), Tolerance.of("atol", ATOL, ATOL)
        control = Control(*tolerance, abs(h), 0.0, np.inf, None)
        states = {**self._problem.initial, **self._equations.states(state)}
        setting = Setting(replace(self._problem, initial=states), 0.0, control, {}, self._equations)
        stepper, _ = of.make(setting)
        if isinstance(stepper, ReducedMethod):
            return stepper.step(state, h).end
        if forces is not None:
            driven = replace(self._driven(self._equations.layout.named("forces", forces)), initial=states)
            stepper, _ = of.make(replace(setting, problem=driven, equations=None))
        start = stepper.start(0.0, h)
        return self._problem.descriptor.unpack(stepper.row(stepper.step(start, h).end).x)

    def _driven(self, forces: Mapping[str, ArrayLike]) -> Problem:
        """The problem under further forces on joints.

        Raises
        ------
        OptionError
            A joint of a system has no outer port where a force could be given.
        """
        scene: Scene | None = self._problem.scene
        if scene is not None:
            implicit = dict(scene.implicit_joints())
            inputs = {f"{'bodies' if name in implicit else 'joints'}.{name}": force for name, force in forces.items()}
            return problem_of_scene(scene, None, inputs)
        signals = dict(self._problem.signals)
        for name, force in forces.items():
            values = np.atleast_1d(np.asarray(force, dtype=float))
            for _, edge in self._equations.layout.edges[name]:
                if edge.port is None or signals[edge.port].effort:
                    raise OptionError("forces", name, "joints with an outer port where a force is given")
                signals[edge.port] = sum_of(signals[edge.port], Signal(values[edge.freedoms]))
        return replace(self._problem, signals=signals)

    def _explicit(self, state: ReducedState, h: float, of: Tableau) -> ReducedState:
        """A step without error estimate, between states whose hard contacts are open."""
        eq = self._equations
        self._hard.check_open(state.q, state.r)
        y0, y1, k = eq.vector(state), np.empty(eq.size), np.zeros((len(of.arrays["a"]), eq.size))
        k[0] = eq.rates(state.t, state.q, y0)
        eq.stages(state, of.arrays, of.c, h, y0, k, y1)
        end = eq.closed(eq.state(state, y1, state.t + h))
        self._hard.check_open(end.q, end.r)
        return end
