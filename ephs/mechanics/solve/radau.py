"""Radau IIA of order 5 on the descriptor form: stiff, adaptive, constraints met at every step.

The collocation method of Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.8, written for implicit
equations g(x, ẋ, e, λ) = 0: the unknowns of a stage are its rates, efforts and multipliers, so neither a mass matrix
nor a choice of causality is needed, and what is algebraic in them is met at the end of the step, which is a stage.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from scipy.linalg import get_lapack_funcs
from scipy.sparse.linalg import splu

from ephs.mechanics.solve.continuous import Continuous, Matrices
from ephs.mechanics.solve.errors import Outcome, SolveError
from ephs.mechanics.solve.model import Model
from ephs.semantics.bundle import Array
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.codes import VECTOR

__all__ = ["Radau", "RadauState", "Step"]

_S6 = 6.0**0.5
NODES = np.array([(4.0 - _S6) / 10.0, (4.0 + _S6) / 10.0, 1.0])
DENSE = 48
"""Unknowns up to which factorising without regard to zeros is faster."""
ITERATIONS = 10
Inputs = Callable[[float, Array], Array]


def _moments(nodes: Array, theta: float) -> Array:
    """∫₀^θ of each Lagrange polynomial on the nodes, (3,)."""
    powers = np.array([theta ** (k + 1) / (k + 1) for k in range(nodes.size)])
    return np.asarray(np.linalg.solve(np.vander(nodes, increasing=True).T, powers), dtype=float)


COEFFICIENTS = np.array([_moments(NODES, node) for node in NODES])
_VALUES, _VECTORS = np.linalg.eig(COEFFICIENTS)
_REAL = int(np.argmin(np.abs(np.imag(_VALUES))))
_COMPLEX = int(np.argmax(np.imag(_VALUES)))
_PAIR = int(np.argmin(np.imag(_VALUES)))
GAMMA = float(_VALUES[_REAL].real)
T = _VECTORS[:, [_REAL, _COMPLEX, _PAIR]]
T_INVERSE = np.linalg.inv(T)
# The embedded method of order 3 takes γ₀ of the rate at the start; its defect, weight by weight.
_ORDER_3 = np.array([1.0 - GAMMA, 1.0 / 2.0, 1.0 / 3.0])
DEFECT = np.linalg.solve(np.vander(NODES, increasing=True).T, _ORDER_3) - COEFFICIENTS[-1]


@final
@dataclass(frozen=True, slots=True, eq=False)
class RadauState:
    """Where the method stands: time, states, and the unknowns there."""

    t: float
    x: Array
    z: Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """A step that was solved.

    Parameters
    ----------
    start, h
        From where, and how far in s.
    stages
        (3, unknowns) rates, efforts, multipliers, outer flows at the nodes.
    error
        Estimated error of the states, relative to the tolerances.
    iterations
        How many Newton iterations it took.
    """

    start: RadauState
    h: float
    stages: Array
    end: RadauState
    error: float
    iterations: int


@final
class Radau:
    """The method for one model on vector spaces.

    Parameters
    ----------
    model
        The compiled model.
    inputs
        Values at the outer ports, one after the other, from the time in s and the states (point_size,).
    rtol, atol
        A state x is wanted to atol + rtol·|x|.
    """

    name = "radau"
    order = 5

    def __init__(self, model: Model, inputs: Inputs, rtol: float, atol: float) -> None:
        self.model, self.equations, self.inputs = model, Continuous(model), inputs
        self.rtol, self.atol = rtol, atol
        self.evaluations = self.factorisations = 0
        self._rates = int(model.tables.counts[0])
        self._matrices: Matrices | None = None
        self._solvers: tuple[float, Any, Any] | None = None
        self._current: RadauState | None = None

    def init(self, t0: float, x: Array, h: float) -> RadauState:
        """The state of the method; rates and multipliers there come from a step too short to move anything.

        Raises
        ------
        SolveError
            The states contradict the constraints: however short the step, they jump. Or a state is on a Lie group.
        """
        d = self.model.descriptor
        for slot in d.states:
            if manifold(slot.quantity.space).code != VECTOR:
                found = f"it is on {slot.quantity.space}, radau wants vector spaces"
                raise SolveError(Outcome.UNSUITED, str(slot.path), found)
        z = np.zeros(self.model.unknowns)
        for slot in d.components:
            if slot.primitive.kind == "storage":
                z[[self._rates + i for i in slot.efforts]] = slot.primitive.effort(
                    d.point(slot, x), self.model.reference
                )
        start = RadauState(t0, x.copy(), z)
        first, second = (self.step(start, 1e-7 * h * part, estimate=False) for part in (1.0, 0.5))
        jumps = [self._size(step.end.x - x, x) for step in (first, second)]
        if jumps[1] > 0.75 * jumps[0] and jumps[1] > 1.0:
            entry = int(np.argmax(np.abs(second.end.x - x) / (self.atol + self.rtol * np.abs(x))))
            state = next(slot for slot in d.states if slot.point.start <= entry < slot.point.stop)
            raise SolveError(Outcome.INCONSISTENT, str(state.path), "the constraints do not hold at the start")
        self._matrices = None
        return RadauState(t0, x.copy(), second.end.z)

    def step(self, state: RadauState, h: float, *, estimate: bool = True) -> Step:
        """One step of h seconds, solved to a fraction of the tolerances.

        Raises
        ------
        SolveError
            The stages have no solution near by, or lie outside the domain of a component.
        """
        if self._matrices is None:
            self._refresh(state)
        try:
            stages, iterations = self._stages(state, h)
        except SolveError:
            if self._current is state:
                raise
            self._refresh(state)
            stages, iterations = self._stages(state, h)
        weights = h * COEFFICIENTS[-1]
        x = state.x + weights @ stages[:, : self._rates]
        end = RadauState(state.t + h, x, stages[-1].copy())
        error = self._error(state, h, stages, x) if estimate else 0.0
        if iterations > 4:
            self._matrices = None
        return Step(state, h, stages, end, error, iterations)

    def dense(self, step: Step, t: float) -> tuple[Array, Array]:
        """States and unknowns at a time within the step, by its collocation polynomial."""
        theta = (t - step.start.t) / step.h
        x = step.start.x + step.h * _moments(NODES, theta) @ step.stages[:, : self._rates]
        basis = np.linalg.solve(np.vander(NODES, increasing=True).T, np.array([1.0, theta, theta**2]))
        return x, basis @ step.stages

    def powers(self, step: Step) -> tuple[Array, float]:
        """What flows into the ledgers at the stages, per second, (3, 4 + components); and the least entropy production
        of a component at a stage, times the step."""
        xs = step.start.x + step.h * COEFFICIENTS @ step.stages[:, : self._rates]
        found = [
            self.equations.powers(x, z, self.inputs(step.start.t + c * step.h, x))
            for x, z, c in zip(xs, step.stages, NODES, strict=True)
        ]
        return np.array([sums for sums, _ in found]), step.h * min(least for _, least in found)

    def integral(self, step: Step, powers: Array, t: float) -> Array:
        """What came into the ledgers from the start of the step to a time within it."""
        return step.h * _moments(NODES, (t - step.start.t) / step.h) @ powers

    def energies(self, state: RadauState) -> Array:
        """(components,): energy of each storage, zero elsewhere."""
        return self.equations.energies(state.x, state.z, self.inputs(state.t, state.x))

    def _refresh(self, state: RadauState) -> None:
        self._matrices = self.equations.matrices(state.x, state.z, self.inputs(state.t, state.x))
        self._current = state
        self._solvers = None

    def _solve(self, h: float) -> tuple[Any, Any]:
        """Solvers with ∂g/∂z + h·μ·∂g/∂x for the real and the complex eigenvalue μ."""
        if self._solvers is None or self._solvers[0] != h:
            m = self._matrices
            assert m is not None
            real = _solver(m.unknowns + (h * GAMMA) * m.states)
            rest = _solver(m.unknowns + (h * complex(_VALUES[_COMPLEX])) * m.states)
            self._solvers = h, real, rest
            self.factorisations += 1
        return self._solvers[1], self._solvers[2]

    def _stages(self, state: RadauState, h: float) -> tuple[Array, int]:
        real, rest = self._solve(h)
        stages = np.tile(state.z, (3, 1))
        rates = self._rates
        before = np.inf
        for iteration in range(1, ITERATIONS + 1):
            xs = state.x + h * COEFFICIENTS @ stages[:, :rates]
            found = np.array(
                [
                    self.equations.residual(x, z, self.inputs(state.t + c * h, x))
                    for x, z, c in zip(xs, stages, NODES, strict=True)
                ]
            )
            self.evaluations += 3
            turned = T_INVERSE @ found
            pair = rest(turned[1])
            change = np.real(T @ np.array([real(np.real(turned[0])), pair, np.conj(pair)]))
            stages -= change
            moved = self._size(h * COEFFICIENTS @ change[:, :rates], state.x)
            if not np.isfinite(moved):
                break
            # Rounding stops the iteration where the tolerances are beyond it.
            if moved <= 1e-3 or (iteration > 2 and moved > 0.3 * before and moved <= 1e-1):
                return stages, iteration
            if iteration > 2 and moved > 2.0 * before:
                break
            before = moved
        raise SolveError(Outcome.DIVERGED, "", "")

    def _error(self, state: RadauState, h: float, stages: Array, x: Array) -> float:
        """The difference to the embedded method, filtered by the equations as the stiff part of it must be."""
        real, _ = self._solve(h)
        m = self._matrices
        assert m is not None
        rates = self._rates
        raw = np.zeros(state.z.size)
        raw[:rates] = h * (GAMMA * state.z[:rates] + DEFECT @ stages[:, :rates])
        correction = real(-(m.states @ raw))
        difference = raw[:rates] + h * GAMMA * correction[:rates]
        return self._size(difference, np.maximum(np.abs(state.x), np.abs(x)))

    def _size(self, difference: Array, x: Array) -> float:
        """Largest entry relative to its tolerance."""
        return float(np.max(np.abs(difference) / (self.atol + self.rtol * np.abs(x)), initial=0.0))


def _solver(matrix: Any) -> Callable[[Array], Array]:
    if matrix.shape[0] <= DENSE:
        whole = matrix.toarray()
        factorise, solve = get_lapack_funcs(("getrf", "getrs"), (whole,))
        factors, pivots, info = factorise(whole, overwrite_a=True)
        if info > 0 or not np.isfinite(factors).all():
            raise SolveError(Outcome.SINGULAR, "", "")
        return lambda right: solve(factors, pivots, right)[0]
    try:
        return splu(matrix.tocsc()).solve
    except RuntimeError as error:  # what SuperLU says of a singular matrix
        raise SolveError(Outcome.SINGULAR, "", "") from error
