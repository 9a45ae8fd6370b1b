"""`dynamics`: a scene compiled to functions of its state."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, final

import numpy as np
from numpy.typing import ArrayLike

from ephs.mechanics.dynamics.links import Links
from ephs.mechanics.dynamics.results import Constraints, Derivatives, Energies
from ephs.mechanics.dynamics.state import State
from ephs.mechanics.dynamics.stepping import one_step
from ephs.mechanics.reduced.equations import Equations, ReducedState
from ephs.mechanics.reduced.paper import PaperStates
from ephs.mechanics.reduced.tables import CUT
from ephs.mechanics.reduced.tangent import Linearised
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.simulate import problem_of_scene
from ephs.mechanics.solve.errors import OptionError, failing_at
from ephs.mechanics.solve.problem import State as States
from ephs.mechanics.solve.sparse import Index
from ephs.mechanics.views import BodyState, Names, StateView
from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.primitives import Storage

if TYPE_CHECKING:
    from ephs.mechanics.methods import Method

__all__ = ["Dynamics", "dynamics"]


def dynamics(scene: Scene) -> "Dynamics":
    """A scene compiled to functions of its state.

    Parameters
    ----------
    scene
        With its drives, springs, friction and prescribed motions; its initial state is ``state0``.

    Raises
    ------
    OptionError
        The reduced form cannot have the scene: a loop of prescribed joints.
    SimulationError
        The initial state contradicts the joints.
    """
    return Dynamics(scene)


@final
class Dynamics:
    """A scene as functions of its state. No call changes a state, or what a later call gives.

    Vectors and matrices count the n freedoms of the spanning tree's joints, as ``freedoms`` says; at a joint that
    closes a loop (``cut``) the loop is closed by constraints. It keeps scratch memory: use one for each thread.

    Attributes
    ----------
    state0
        The scene's initial state, its loops closed.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._problem = problem_of_scene(scene)
        self._equations = Equations(scene, self._problem, 0.0, pushed=True)
        self._linear = Linearised(self._equations)
        self.layout = self._equations.layout
        self._links, self._names = Links(scene, self._equations), Names(scene)
        with failing_at(0.0):
            start = self._equations.start(0.0)
        self.state0 = self._state(start)

    def __repr__(self) -> str:
        cut = f", {', '.join(self.cut)} cut" if self.cut else ""
        return f"Dynamics({self.scene.name!r}: {self.layout.n} freedoms of {len(self.joints)} joints{cut})"

    # ---- what there is -----------------------------------------------------------------------------------------

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of all joints, in the order of the vectors."""
        return self.layout.joints

    @property
    def cut(self) -> tuple[str, ...]:
        """Names of the joints at which loops are closed by constraints."""
        return tuple(edge.name for edge in self._equations.reduced.cut)

    @property
    def freedoms(self) -> dict[str, Index]:
        """Joint of the tree -> places of its freedoms in vectors (n,) and matrices."""
        n = self.layout.n
        kept = {name: where[where < n] for name, where in self.layout.freedoms.items()}
        return {name: where for name, where in kept.items() if where.size or name not in self.cut}

    # ---- states ------------------------------------------------------------------------------------------------

    def state(
        self,
        coordinates: Mapping[str, ArrayLike] | None = None,
        rates: Mapping[str, ArrayLike] | None = None,
        *,
        adjust: bool = False,
    ) -> State:
        """The initial state with some joints elsewhere, as `Scene.with_state` has it.

        Raises
        ------
        SceneError
            A name is unknown, a value has the wrong length, or a loop does not close.
        """
        scene = self.scene.with_state(coordinates, rates, adjust=adjust)
        return self._of_states(problem_of_scene(scene).initial)

    def unpack(self, array: ArrayLike) -> State:
        """The state of an array as `State.array` has it; loops are left as they are.

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

    def closed(self, state: State) -> State:
        """The nearest state in the mass metric whose loops are closed and whose rates are on the constraints.

        Raises
        ------
        SimulationError
            The loops do not close near by.
        """
        with failing_at(0.0):
            return self._state(self._equations.closed(self._reduced(state)))

    def bodies(self, state: State) -> dict[str, BodyState]:
        """Body -> where it is and how it moves."""
        self._at(state)
        return self._links.bodies()

    def view(self, state: State) -> StateView:
        """The state by names, as functions of inputs read it: ``view.joints.pin.rate``."""
        return self._names.view(self._equations.states(self._reduced(state)))

    def states(self, state: State) -> dict[Path, Array]:
        """All states of the scene's system by path, as `simulate` takes them for ``initial``."""
        return {**self._problem.initial, **self._equations.states(self._reduced(state))}

    # ---- accelerations and forces ------------------------------------------------------------------------------

    def acceleration(self, state: State, forces: Mapping[str, ArrayLike] | None = None) -> dict[str, Array]:
        """Joint -> (d,) time derivative of its twist u_r, in rad/s² and m/s²; cut joints included.

        Parameters
        ----------
        forces
            Joint -> (d,) generalised forces on u_r in N m and N, beside the scene's own.

        Raises
        ------
        SimulationError
            The motion is not determined there, or a component cannot be evaluated.
        """
        q, r, s = self.layout.split(state.array)
        with self._pushed(forces):
            if self.cut:
                return self.layout.by_joint(self._linear.forward(q, r, s))
            eq = self._equations
            found = eq.rates(0.0, q, eq.vector(self._reduced(state)))
            return self.layout.by_joint(found[eq.nv : eq.nv + eq.n])

    def inverse_dynamics(self, state: State, accelerations: Mapping[str, ArrayLike]) -> dict[str, Array]:
        """Joint -> (d,) the forces, beside the scene's own, that make the tree's accelerations.

        With loops they are the generalised forces on the tree's freedoms that do so with nothing from the joints that
        close them: zero at cut joints, whose accelerations follow and are not asked for. Forces that differ by
        rowsᵀ·λ of `constraints` make the same motion. At prescribed joints it is what the motion takes.

        Parameters
        ----------
        accelerations
            Joint -> (d,) time derivative of u_r; zero where not named.

        Raises
        ------
        SimulationError
            A component cannot be evaluated there.
        """
        q, r, s = self.layout.split(state.array)
        a = self.layout.vector("accelerations", accelerations)[: self.layout.n]
        with failing_at(0.0):
            return self.layout.by_joint(self._linear.inverse(q, r, s, a))

    def mass_matrix(self, state: State) -> Array:
        """(n, n) M: kinetic energy is ½ rᵀM r.

        Raises
        ------
        SimulationError
            A freedom moves no mass.
        """
        q, r, _ = self.layout.split(state.array)
        with failing_at(0.0):
            return self._equations.mass(q, r)

    def bias(self, state: State, *, gravity: bool = True) -> Array:
        """(n,) forces that keep the rates as they are against inertia, C(q, r) r, and gravity, g(q)."""
        self._at(state)
        return self._links.bias() + (self._links.gravity() if gravity else 0.0)

    def gravity(self, state: State) -> Array:
        """(n,) g(q), the derivative of gravity's potential: the forces that hold the mechanism at rest."""
        self._at(state)
        return self._links.gravity()

    def applied(self, state: State) -> Array:
        """(n,) the generalised forces of the scene's drives, springs and friction on the tree's freedoms."""
        q, r, s = self.layout.split(state.array)
        with failing_at(0.0):
            return self.bias(state) - self._linear.inverse(q, r, s, np.zeros(self.layout.n))

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
        eq, t = self._equations, self._equations.reduced.tables
        q, r, s = self.layout.split(state.array)
        with failing_at(0.0):
            target, rank = self._linear.targets(q, r, s)
            gaps, rows = eq.gaps(q, r)
        edges = eq.reduced.edges
        driven = [
            e.name
            for i, e in enumerate(edges[: eq.reduced.links])
            for _ in range(int(t.driven[t.r_at[i] : t.r_at[i] + t.dim[i]].sum()))
        ]
        cut = [e.name for i, e in enumerate(edges) if t.kind[i] == CUT for _ in range(int(t.rows[i]))]
        return Constraints(rows, target, gaps, (*driven, *cut), rank)

    def energies(self, state: State) -> Energies:
        """Kinetic, potential and thermal energy."""
        model, row = self._equations.model, self._equations.row(self._reduced(state))
        kind = {"ke": 0, "pe": 1}
        sums = [0.0, 0.0, 0.0]
        for slot, energy in zip(model.descriptor.components, row.energies, strict=True):
            if isinstance(slot.primitive, Storage):
                sums[kind.get(str(slot.path[-1]), 2)] += float(energy)
        s = self.layout.split(state.array)[2]
        taken = s[self._equations.reduced.tables.node < 0]  # by the environment, whose energy no component counts
        return Energies(sums[0], sums[1], sums[2] + model.reference.temperature * float(taken.sum()))

    def derivatives(
        self,
        state: State,
        forces: Mapping[str, ArrayLike] | None = None,
        accelerations: Mapping[str, ArrayLike] | None = None,
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
        q, r, s = self.layout.split(state.array)
        n, nv = self._equations.n, self._equations.nv
        with self._pushed(forces):
            a = self._linear.forward(q, r, s)[:n]
            forward = self._linear.columns(solve=True, fit=True)
            by_force = self._linear.mobility()
        if accelerations is not None:
            a = self.layout.vector("accelerations", accelerations)[:n]
        with failing_at(0.0):
            self._linear.inverse(q, r, s, a)
            inverse = self._linear.columns(solve=False, fit=True)[:n]
        at_q, at_r, at_s = slice(0, n), slice(nv, nv + n), slice(nv + n, None)
        return Derivatives(
            forward[:n, at_q], forward[:n, at_r], by_force, forward[:n, at_s],
            inverse[:, at_q], inverse[:, at_r], self.mass_matrix(state),
            forward[nv:, at_q], forward[nv:, at_r], forward[nv:, at_s],
        )  # fmt: skip

    # ---- steps -------------------------------------------------------------------------------------------------

    def step(self, state: State, h: float, method: "str | Method" = "natural") -> State:
        """The state h seconds later, by one step of a method that takes constant steps.

        Each step is a start of its own: what a method remembers from step to step (alpha: accelerations) begins anew.

        Raises
        ------
        OptionError
            There is no such method, or it takes no constant steps.
        SimulationError
            The step has no solution.
        """
        with failing_at(0.0):
            found = one_step(self._problem, self._equations, self._reduced(state), h, method)
            return self._state(found) if isinstance(found, ReducedState) else self._of_states(found)

    # ---- inside ------------------------------------------------------------------------------------------------

    def _counted(self, q: Array, r: Array, s: Array) -> ReducedState:
        eq = self._equations
        return ReducedState(0.0, q, r, eq.heats.energies(s), np.zeros(2 + len(eq.reduced.made)))

    def _reduced(self, state: State) -> ReducedState:
        return self._counted(*self.layout.split(state.array))

    def _at(self, state: State) -> None:
        self._links.place(*self.layout.split(state.array)[:2])

    def _state(self, at: ReducedState) -> State:
        if self.layout.total > self.layout.n:
            self._links.place(at.q, at.r)
        array = np.concatenate([at.q, at.r, self._equations.heats.entropies(at.heats)])
        return State(array, self.layout, self._linear.cut_rates)

    def _of_states(self, states: States) -> State:
        eq = self._equations
        q, r, s = PaperStates(eq.reduced, replace(self._problem, initial=states), eq.work).initial()
        with failing_at(
            0.0
        ):  # momenta off the joints, as some methods leave them, count by the nearest in the mass metric
            mass = eq.mass(q, r)
            r = np.asarray(np.linalg.solve(mass, self._links.momenta(states)), dtype=float)
            return self._state(eq.closed(self._counted(q, r, s)))

    @contextmanager
    def _pushed(self, forces: Mapping[str, ArrayLike] | None) -> Generator[None, None, None]:
        """Further forces on the joints, for as long as it lasts."""
        drive = self._equations.drive
        before = drive.copy()
        drive += self.layout.vector("forces", forces or {})
        try:
            with failing_at(0.0):
                yield
        finally:
            drive[:] = before
