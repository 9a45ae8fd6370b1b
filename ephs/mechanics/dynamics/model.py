"""A mechanism in joint coordinates as functions of its state."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, final, overload

import numpy as np
from numpy.typing import ArrayLike

from ephs.mechanics.dynamics import differentiating
from ephs.mechanics.dynamics.control import Task, computed_torque, task_of
from ephs.mechanics.dynamics.keeping import following
from ephs.mechanics.dynamics.links import PlacedLinks
from ephs.mechanics.dynamics.loading import Loading
from ephs.mechanics.dynamics.placing import ByJoint, Placing
from ephs.mechanics.dynamics.results import Constraints, Derivatives, Energies, VelocityDerivatives
from ephs.mechanics.dynamics.state import State
from ephs.mechanics.dynamics.stepping import Steps
from ephs.mechanics.motion.views import BodyState
from ephs.mechanics.runs.scene_problem import problem_of_scene
from ephs.mechanics.scene.following import has_stretches
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.mechanics.tree.equations.paper import PaperStates
from ephs.mechanics.tree.equations.tangent import Linearised
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.solve.equations.sparse import Index
from ephs.solve.posing.errors import OptionError, failing_at
from ephs.solve.posing.problem import Problem
from ephs.solve.posing.problem import State as States

if TYPE_CHECKING:
    from ephs.mechanics.methods.registry import MethodEntry
    from ephs.solve.methods.own import Method


@final
class Dynamics:
    """A mechanism as pure functions of its state.

    Vectors and matrices count the n degrees of freedom of the spanning tree's joints, as ``freedoms`` says; at a joint
    that closes a loop (``cut``) the loop is closed by constraints. It keeps scratch memory: use one for each thread.

    Attributes
    ----------
    problem
        The problem whose bodies and joints these are.
    state0
        The initial state, its loops closed.
    weights
        Body -> its weight in N.
    loading
        Loads of a scene, which act in full unless ``loading.share`` is less.
    """

    def __init__(self, problem: Problem) -> None:
        self.scene: Any = problem.scene
        self.problem, self.name = problem, problem.name
        self._equations = ReducedEquations(problem, 0.0, pushed=True)
        if self._equations.prescribed.changing:
            raise OptionError("motion", "one that changes with time", "constant rates: dynamics have no time")
        self._linear = Linearised(self._equations)
        self.layout = self._equations.layout
        self._links = PlacedLinks(self._equations)
        self.weights = self._links.weights()
        self.loading = Loading(self._equations, self._links)
        self.placing, self._steps = Placing(self._equations), Steps(self.problem, self._equations, self.loading.hard)
        with failing_at(0.0):
            self.state0 = self._state(self._equations.start(0.0, determined=False))

    def __repr__(self) -> str:
        cut = f", {', '.join(self.cut)} cut" if self.cut else ""
        return f"Dynamics({self.name!r}: {self.layout.n} degrees of freedom of {len(self.joints)} joints{cut})"

    def _repr_html_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        from ephs.show.notebook import dynamics_html

        return dynamics_html(self)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of all joints, in the order of the vectors."""
        return self.layout.joints

    @property
    def cut(self) -> tuple[str, ...]:
        """Names of the joints at which loops are closed by constraints."""
        return tuple(edge.name for edge in self._equations.reduced.cut)

    @property
    def free(self) -> bool:
        """Whether all degrees of freedom of the tree are independent: no loops, gears or prescribed motions."""
        return self.placing.free

    @property
    def freedoms(self) -> dict[str, Index]:
        """Joint of the tree -> places of its degrees of freedom in vectors (n,) and matrices."""
        kept = {name: where[where < self.layout.n] for name, where in self.layout.freedoms.items()}
        return {name: where for name, where in kept.items() if where.size or name not in self.cut}

    def state(self, coordinates: ByJoint | None = None, rates: ByJoint | None = None, *, adjust: bool = False) -> State:
        """The initial state with other joint coordinates; geared joints and stretches follow, see `Scene.with_state`.

        Of a tree all joints' may be given as arrays (n,). Of a system loops close, and gears hold, by what is not
        given; where they do not, it is the nearest state in which they do.

        Raises
        ------
        SceneError
            A name is unknown, a value has the wrong length, or a loop does not close.
        """
        stretched = self.scene is not None and has_stretches(self.scene)  # belts and tendons follow coordinates
        if not (adjust or stretched) and (made := self.placing.state(self.state0, coordinates, rates)) is not None:
            return made
        by_name = [self.layout.named("state", given) for given in (coordinates, rates)]
        if self.scene is None:
            moved = self._reduced(self.placing.moved(self.state0, *by_name))
            return self.closed(self._state(following(self._equations, moved, *map(self.placing.places, by_name))))
        scene = self.scene.with_state(*by_name, adjust=adjust)
        return self._of_states(problem_of_scene(scene).initial)

    def unpack(self, array: ArrayLike) -> State:
        """The state of an array in the layout of `State.array`; loops are not closed.

        Raises
        ------
        OptionError
            The array has another shape, or is not finite.
        """
        given = np.asarray(array, dtype=float)
        if given.shape != self.state0.array.shape or not np.isfinite(given).all():
            raise OptionError("array", given.shape, f"{self.state0.array.shape}, finite")
        return self._state(self._counted(*self.layout.split(given)))

    def moved(self, state: State, increments: ArrayLike) -> State:
        """The state with the tree's joints at q·exp(v), v (n,) in rad and m; cut joints follow, rates stay."""
        q, r, s = self.layout.split(state.array)
        v = np.asarray(increments, dtype=float)
        if v.shape != (self.layout.n,):
            raise OptionError("increments", v.shape, f"({self.layout.n},)")
        return self._state(self._counted(self._equations.fitted(self._equations.moved(q, v), r), r, s))

    def difference(self, state: State, wanted: State) -> Array:
        """(n,) increments of the tree's joints that lead from a state to another: ``moved`` undone; rad, m."""
        return self.placing.difference(state.q, wanted.q)

    def closed(self, state: State) -> State:
        """The nearest state in the mass metric with closed loops and consistent rates.

        Raises
        ------
        SimulationError
            The loops do not close near by.
        """
        with failing_at(0.0):
            return self._state(self._equations.closed(self._reduced(state)))

    def bodies(self, state: State) -> dict[str, BodyState]:
        """Body -> its pose and motion."""
        self._at(state)
        return self._links.bodies()

    def view(self, state: State) -> Any:
        """The state by names, as functions of inputs read it: ``view.joints.pin.rate``."""
        return self.problem.view(self._equations.states(self._reduced(state)))

    def states(self, state: State) -> dict[Path, Array]:
        """All states of the scene's system by path, as `simulate` takes them for ``initial``."""
        return {**self.problem.initial, **self._equations.states(self._reduced(state))}

    # ---- accelerations and forces ------------------------------------------------------------------------------

    @overload
    def acceleration(self, state: State, forces: Mapping[str, ArrayLike] | None = None) -> dict[str, Array]: ...

    @overload
    def acceleration(self, state: State, forces: ArrayLike) -> Array: ...

    def acceleration(self, state: State, forces: ByJoint | None = None) -> dict[str, Array] | Array:
        """Joint -> (d,) time derivative of its twist u_r, in rad/s² and m/s²; cut joints included.

        Parameters
        ----------
        forces
            Joint -> (d,) generalised forces on u_r in N m and N, beside the scene's own. Of an array (n,) the result
            is one.

        Raises
        ------
        SimulationError
            The motion is not determined there, or a component cannot be evaluated.
        """
        q, r, s = self.layout.split(state.array)
        self.loading.place(q, r)
        with self._pushed(forces):
            if self.cut or self.loading:
                found = self._linear.forward(q, r, s)
            else:
                found = self._equations.accelerations(self._reduced(state))
        by_name = forces is None or isinstance(forces, Mapping)
        return self.layout.by_joint(found) if by_name else found[: self.layout.n]

    @overload
    def inverse_dynamics(self, state: State, accelerations: Mapping[str, ArrayLike]) -> dict[str, Array]: ...

    @overload
    def inverse_dynamics(self, state: State, accelerations: ArrayLike) -> Array: ...

    def inverse_dynamics(self, state: State, accelerations: ByJoint) -> dict[str, Array] | Array:
        """Joint -> (d,) the forces, beside the scene's own, that make the tree's accelerations.

        With loops they are the generalised forces on the tree's degrees of freedom that do so with nothing from the
        joints that close them: zero at cut joints, whose accelerations follow and are not asked for. Forces that differ
        by rowsᵀ·λ of `constraints` make the same motion. At prescribed joints it is what the motion takes.

        Parameters
        ----------
        accelerations
            Joint -> (d,) time derivative of u_r; zero where not named. Of an array (n,) the result is one.

        Raises
        ------
        SimulationError
            A component cannot be evaluated there.
        """
        q, r, s = self.layout.split(state.array)
        a = self.layout.vector("accelerations", accelerations)[: self.layout.n]
        self.loading.place(q, r)
        with failing_at(0.0):
            found = self._linear.inverse(q, r, s, a)
        return self.layout.by_joint(found) if isinstance(accelerations, Mapping) else found

    def computed_torque(
        self, state: State, wanted: State, accelerations: ArrayLike = 0.0, *, stiffness: ArrayLike, damping: ArrayLike
    ) -> Array:
        """(n,) forces that lead to a wanted state; see `ephs.mechanics.dynamics.control.computed_torque`."""
        return computed_torque(self, state, wanted, accelerations, stiffness, damping)

    def task(
        self, state: State, body: str, point: ArrayLike | None = None, *, directions: ArrayLike | None = None
    ) -> Task:
        """The dynamics of a body or a point of it; see `ephs.mechanics.dynamics.control.task_of`."""
        return task_of(self, state, body, point, directions)

    def mass_matrix(self, state: State) -> Array:
        """(n, n) M: kinetic energy is ½ rᵀM r. A `SimulationError` where a degree of freedom moves no mass."""
        with failing_at(0.0):
            return self._equations.mass(state.q, state.r)

    def bias(self, state: State, *, gravity: bool = True) -> Array:
        """(n,) forces at constant rates: C(q, r) r of inertia, and g(q) of gravity."""
        self._at(state)
        return self._links.bias() + (self._links.gravity() if gravity else 0.0)

    def gravity(self, state: State) -> Array:
        """(n,) g(q), the derivative of gravity's potential: the forces that hold the mechanism at rest."""
        self._at(state)
        return self._links.gravity()

    def applied(self, state: State) -> Array:
        """(n,) the generalised forces of the scene's drives, loads, springs and friction on the tree's freedoms."""
        return self.bias(state) - self.inverse_dynamics(state, np.zeros(self.layout.n))

    def jacobian(self, state: State, body: str, point: ArrayLike | None = None) -> Array:
        """Jacobian from the tree's rates to a body's twist.

        Parameters
        ----------
        point
            (3,) in the body's frame, m.

        Returns
        -------
        Array
            (6, n) its twist in the body's frame; with ``point`` (3, n) that point's velocity in the world.

        Raises
        ------
        OptionError
            There is no such body.
        """
        self._at(state)
        return self._links.jacobian(body, None if point is None else np.asarray(point, dtype=float))

    def constraints(self, state: State) -> Constraints:
        """The equations of prescribed joints and closed loops on the tree's accelerations.

        Raises
        ------
        SimulationError
            A component cannot be evaluated there.
        """
        with failing_at(0.0):
            return differentiating.constraints_of(self._linear, *self.layout.split(state.array))

    def energies(self, state: State) -> Energies:
        """Kinetic, potential and thermal energy."""
        eq = self._equations
        taken = state.entropies[eq.reduced.tables.node == -1]  # by the environment: energy of no component
        return Energies.of(eq.model, eq.row(self._reduced(state)).energies, float(taken.sum()))

    def derivatives(
        self, state: State, forces: ByJoint | None = None, accelerations: ByJoint | None = None
    ) -> Derivatives:
        """Exact derivatives of accelerations and of inverse dynamics: by tangents, not by differences.

        Parameters
        ----------
        forces
            Under which accelerations are differentiated, beside the scene's own.
        accelerations
            At which inverse dynamics is differentiated; those under ``forces`` where None.

        Raises
        ------
        SimulationError
            The motion is not determined there, or a component cannot be evaluated.
        """
        given = None if accelerations is None else self.layout.vector("accelerations", accelerations)[: self.layout.n]
        q, r, s = self.layout.split(state.array)
        self.loading.place(q, r)
        with self._pushed(forces):
            under = differentiating.forward_slopes(self._linear, q, r, s)
        with failing_at(0.0):
            return self.loading.stiffened(differentiating.derivatives_of(self._linear, under, q, r, s, given), q, r)

    def stiffness(self, state: State, following: Sequence[int] = ()) -> Array:
        """(n, n) derivatives of forces at rest; see `ephs.mechanics.dynamics.differentiating.stiffness_of`."""
        return differentiating.stiffness_of(self._linear, self.loading, *self.layout.split(state.array), following)

    def velocity_derivatives(self, state: State) -> VelocityDerivatives:
        """Exact derivatives by the configuration of velocities: constraints' rows, cut joints, bodies."""
        return differentiating.velocity_derivatives_of(self._linear, self._links, state.q, state.r)

    def state_derivatives(self, state: State) -> dict[Path, tuple[Array, Array]]:
        """Derivatives of the system's states; see `ephs.mechanics.dynamics.differentiating.state_derivatives_of`."""
        return differentiating.state_derivatives_of(self._linear, self._links, state.q, state.r)

    def step(
        self, state: State, h: float, method: "str | Method | MethodEntry" = "rk54", *, forces: ByJoint | None = None
    ) -> State:
        """The state h seconds later, by one step of a method with constant steps.

        Each step is a start of its own: what a method remembers from step to step (alpha: accelerations) begins anew.

        Parameters
        ----------
        forces
            Joint -> (d,), or (n,), generalised forces on u_r beside the scene's own, constant over the step.

        Raises
        ------
        OptionError
            There is no such method, or it takes no constant steps.
        SimulationError
            The step has no solution.
        """
        with self._pushed(forces):
            found = self._steps.step(self._reduced(state), h, method, forces)
            return self._state(found) if isinstance(found, ReducedState) else self._of_states(found)

    def _counted(self, q: Array, r: Array, s: Array) -> ReducedState:
        return ReducedState(0.0, q, r, self._equations.heats.energies(s), np.zeros(self._equations.summed))

    def _reduced(self, state: State) -> ReducedState:
        return self._counted(*self.layout.split(state.array))

    def _at(self, state: State) -> None:
        self._links.place(state.q, state.r)

    def _state(self, at: ReducedState) -> State:
        cut_rates = np.zeros(0)
        if self.layout.total > self.layout.n:
            self._links.place(at.q, at.r)
            cut_rates = self._linear.cut_rates
        array = np.concatenate([at.q, at.r, self._equations.heats.entropies(at.heats)])
        return State(array, self.layout, cut_rates)

    def _of_states(self, states: States) -> State:
        eq = self._equations
        q, r, s = PaperStates(eq.reduced, replace(self.problem, initial=states)).initial()
        with failing_at(0.0):  # momenta off the joints, as some methods leave them: the nearest in the mass metric
            r = np.asarray(np.linalg.solve(eq.mass(q, r), self._links.momenta(states)), dtype=float)
            return self._state(eq.closed(self._counted(q, r, s)))

    @contextmanager
    def _pushed(self, forces: ByJoint | None) -> Generator[None, None, None]:
        """Additional forces on the joints within the context."""
        drive, before = self._equations.drive, self._equations.drive.copy()
        if forces is not None:
            drive += self.layout.vector("forces", forces)
        try:
            with failing_at(0.0):
                yield
        finally:
            drive[:] = before
