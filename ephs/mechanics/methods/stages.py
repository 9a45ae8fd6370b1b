"""Stages of a collocation method on the reduced form, by Newton's method with a reused exact Jacobian.

Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.8: the system of all stages falls apart into one of
the mechanism's size for each eigenvalue of the method's coefficients, complex ones in pairs.
"""

from typing import Any, final

import numpy as np

from ephs.mechanics.methods.jacobian import Jacobian
from ephs.mechanics.methods.sparse import PIVOTS, SparseSystems, by_freedoms
from ephs.mechanics.tree.equations.equations import ReducedEquations, ReducedState
from ephs.mechanics.tree.finding.naming import counted
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.stage import PLAIN
from ephs.solve.march.iteration import iterate
from ephs.solve.march.stiff import Newton
from ephs.solve.methods.collocation import Collocation, radau_for
from ephs.solve.methods.kept import KeptMatrices
from ephs.solve.methods.solvers import Solver, Solvers, dense
from ephs.solve.posing.errors import Outcome, SolveError, worst_entry
from ephs.solve.running.control import Control

SOLVED = 1e-13
"""Attainable relative accuracy of a step's equations: rounding, times a condition of some hundreds."""
ROUNDING = 1e-14
"""Tolerances to which stages are solved at constant steps."""
KEPT = 0.3
"""As `Stages.enough`, at constant steps: with a kept matrix errors fall by a rate, and not as squares."""
PIVOTING = ("swaps", "ends")
"""Integers of the factors, by the names of `ephs.solve.march.Stiff`."""
FACTORS, FACTORED, SUBSTITUTED = 2, 500, 40
"""Evaluations that cost as much as factors of a matrix of n freedoms, and solutions: 2 + n²/500 and 1 + n/40.

An evaluation takes some 400 n operations, factors of a real and a complex matrix 10 n³/3, four times as many of them in
the same time, as their inner loops are long; solutions with them take 10 n²."""
FAST, PATIENT = 2e-3, 0.3
"""Rate of convergence at which a new matrix does not pay: it costs about as much as an iteration; as dozens of them,
where it is sparse."""


def costs(freedoms: int, stages: int) -> tuple[int, int]:
    """Cost of factors for a number of stages and of solutions with them, in evaluations of the rates."""
    work = freedoms * (2 * stages - 1)  # a complex matrix takes four times as much as a real one
    return FACTORS + freedoms * work // (5 * FACTORED), 1 + work // (5 * SUBSTITUTED)


def scheme_of(equations: ReducedEquations, control: Control) -> Collocation:
    """The stages of radau on a mechanism: by the tolerance, fewer where surfaces may touch or loops lose rank."""
    kinked = bool(equations.reduced.tables.support.any())
    rtol = control.rtol.value if control.step is None else None
    return radau_for(rtol, kinked=kinked, looped=equations.engine.looped)


@final
class Stages:
    """The stages of one method on one mechanism.

    Parameters
    ----------
    scheme
        The method's coefficients.
    counts
        Where iterations and factorisations are counted.

    Attributes
    ----------
    rtol, atol
        Of what counts in an error; near rounding where steps are constant.
    inverse
        Of the coefficients.
    enough, enough_kept, rough
        Change of an iteration, relative to what is allowed, after which stages are solved; where the matrix is kept;
        that is good enough where the iteration gets no further.
    """

    def __init__(
        self, equations: ReducedEquations, control: Control, scheme: Collocation, counts: dict[str, Any]
    ) -> None:
        self.equations, self.scheme, self.inverse = equations, scheme, np.linalg.inv(scheme.coefficients)
        self.rtol, self.atol = equations.allowed(control.rtol, control.atol)
        if control.step is None:
            # Convergence of Newton's method, relative to the tolerance: below the method's own error.
            least = float(np.min(self.rtol, initial=1.0))
            self.enough, self.rough = max(SOLVED / max(least, SOLVED), min(0.03, least**0.5)), 1e-2
            self.enough_kept = self.enough
        else:  # to rounding, and near changes of rank as far as it converges
            self.rtol, self.atol = np.full_like(self.rtol, ROUNDING), np.full_like(self.atol, ROUNDING)
            self.enough, self.rough, self.enough_kept = 1.0, 1e5, KEPT
        self.counts = counts
        for name in ("iterations", "factorisations"):
            counts.setdefault(name, 0)
        self.jacobian = Jacobian(equations, counts)
        # Off the constraints the exact matrix grows with the inverse of this, and so does an old one's error.
        self._separation = equations.separation()
        self.kept: KeptMatrices[ReducedState, Array | SparseSystems] = KeptMatrices(
            scheme, self._made, self._solver, counts
        )
        self._solvers = Solvers(lambda _: "", PIVOTS, _places(equations) if self.jacobian.sparse else None)
        self._fast = PATIENT if self.jacobian.sparse else FAST
        self.heat = slice(equations.nv + equations.n, self.jacobian.size)

    def solve(self, state: ReducedState, y0: Array, h: float) -> tuple[Array, Array]:
        """Increments (stages, size) of (v, r, heats), and rates of all numbers.

        States that are not booked as heat have the rates that lead to their increments.

        Raises
        ------
        SolveError
            The iteration does not converge, or a component cannot be evaluated.
        """
        self.kept.stale = self.kept.stale or self.jacobian.holding is not self.equations.holding
        return self.kept.solved(state, lambda: self._solve(state, y0, h))

    def keep(self) -> None:
        """Renew the matrix at the next step's start, if constraints have rotated."""
        self.kept.stale = self.kept.stale or self._turned()

    def allowed(self, y0: Array, y1: Array) -> Array:
        """Error allowances of a step, for the counted components."""
        return self.atol + self.rtol * self.equations.sizes(y0, y1)

    def _turned(self) -> bool:
        """Whether the constraints' distance from dependence has changed since the matrix was made."""
        found = self.equations.separation()
        if found.shape != self._separation.shape:  # another rank
            return True
        return bool(np.any(np.abs(np.log2(found / self._separation)) > 1.0))

    def _made(self, state: ReducedState) -> Array | SparseSystems:
        """The Jacobian at a state, with what its constraints are apart by."""
        value, self._separation = self.jacobian.at(state), self.equations.separation()
        if isinstance(value, np.ndarray):
            return value
        return SparseSystems(value, self.equations.nv, self.equations.n, self._solvers)

    def _solver(self, matrix: Array | SparseSystems, length: complex) -> Solver:
        """Solver with 1/(h μ) − J for the eigenvalue μ of the coefficients."""
        if isinstance(matrix, SparseSystems):
            return matrix.solver(length)
        return dense(np.eye(len(matrix)) / length - matrix, _singular)

    def _solve(self, state: ReducedState, y0: Array, h: float) -> tuple[Array, Array]:
        eq, size, count = self.equations, self.jacobian.size, self.scheme.nodes.size
        stages, rates = np.zeros((count, size)), np.zeros((count, eq.size))
        coldest = eq.heats.coldest(y0[self.heat])  # an iterate may overshoot, a solution is not below
        worst = np.zeros(eq.counted.size)

        def correct(_: Any) -> float:
            for i, node in enumerate(self.scheme.nodes):
                y = y0.copy()
                y[:size] += stages[i]
                y[self.heat] = np.maximum(y[self.heat], coldest)
                rates[i] = eq.rates(state.t + node * h, state.q, y)
            self.counts["iterations"] += 1
            defect = rates[:, :size] - self.inverse @ stages / h
            change = self.scheme.solved(defect, self.kept.solvers(h))
            reached = np.abs(y0)  # states that start from zero, such as heat, are scaled by their end values
            reached[:size] += np.abs(stages + change).max(axis=0)
            worst[:] = np.max(np.abs(change[:, eq.counted]) / self.allowed(y0, reached), axis=0, initial=0.0)
            stages[:] += change
            return float(np.max(worst, initial=0.0))

        found = iterate(PLAIN, correct, self.enough, self.rough, self._fast)
        if found.solved:
            plain = eq.nv + eq.n + np.flatnonzero(eq.heats.plain)
            rates[:, plain] = self.inverse @ stages[:, plain] / h
            self.kept.stale = not found.fast
            return stages, rates
        path, what = counted(eq.reduced, worst_entry(worst))
        raise SolveError(Outcome.DIVERGED, path, f"{what} at the stages")


@final
class KeptJacobian:
    """The Jacobian of compiled implicit steps, and their memory: `ephs.solve.march.Stiff`.

    Parameters
    ----------
    stages
        The same method step by step, whose Jacobian and counts it shares.
    """

    def __init__(self, stages: Stages) -> None:
        eq, m, scheme = stages.equations, stages.jacobian.size, stages.scheme
        self._stages = stages
        # In these coordinates the inverse is (Re μ, −Im μ; Im μ, Re μ) on the pair of each of its eigenvalues μ.
        out = np.ascontiguousarray(_parts(scheme.back.T, -1.0).T)
        count, systems = scheme.nodes.size, len(scheme.values)
        self.newton = Newton.table(1)
        shapes: dict[str, tuple[int, ...]] = {
            "matrix": (m, m), "damping": (eq.n, eq.n), "spring": (eq.n, eq.n), "factors": (count * m, m),
            "right": (2 * eq.n,), "y": (eq.size,), "rate": (eq.size,), "q": (eq.reduced.coordinates,), "part": (count,),
            **dict.fromkeys(("stages", "change", "parts"), (count, m)),
        }  # fmt: skip
        self.memory: dict[str, Any] = {name: np.zeros(shape) for name, shape in shapes.items()} | {
            "newton": self.newton, "inverse": stages.inverse, "into": np.linalg.inv(out), "out": out,
            "values": _parts(1.0 / np.array(scheme.values)[:, None], 1.0).ravel(),
            **{name: np.zeros(systems * m, dtype=np.int64) for name in PIVOTING},
        }  # fmt: skip

    def begin(self) -> None:
        """Forget the matrix, at the start of a leg."""
        for array in self.newton.arrays:
            array[:] = 0
        n, stages = self.newton[0], self._stages
        n.enough, n.rough, n.stale, n.pairs = stages.enough_kept, stages.rough, 1, len(stages.scheme.values) - 1

    def renew(self, state: ReducedState) -> None:
        """Make the matrix that of a state.

        Raises
        ------
        SolveError
            A component cannot be evaluated there, or the mass matrix is singular.
        """
        found, f = self._stages.kept.renew(state), self._stages.equations.n
        assert isinstance(found, np.ndarray)
        self.memory["matrix"][:], split = found, by_freedoms(found, f, f)
        if split is not None:
            self.memory["damping"][:], self.memory["spring"][:] = split
        n: Any = self.newton[0]
        n.stale, n.young, n.factored, n.split = 0, 1, 0.0, int(split is not None)

    @property
    def cost(self) -> int:
        """Cost of matrices, factors and solutions so far, in evaluations, roughly."""
        n: Any = self.newton[0]
        factors, solutions = costs(self._stages.equations.n, self._stages.scheme.nodes.size)
        known = self._stages.counts
        iterations = solutions * (known["iterations"] + int(n.iterations))
        return self._stages.jacobian.cost + iterations + factors * (known["factorisations"] + int(n.factorisations))

    def count(self) -> None:
        """Add the steps' costs since the last call to the method's counts."""
        n: Any = self.newton[0]
        for name in ("iterations", "factorisations"):
            self._stages.counts[name] += int(getattr(n, name))
        n.iterations = n.factorisations = 0

    def parts(self) -> list[tuple[str, Any]]:
        """All that the next step depends on, by name."""
        integers, reals = self.newton.arrays
        names = "matrix", "damping", "spring", "factors", *PIVOTING
        return [("newton", integers), ("newton_reals", reals), *((name, self.memory[name]) for name in names)]


def _singular(_: int) -> SolveError:
    return SolveError(Outcome.SINGULAR, "", "")


def _parts(rows: Array, sign: float) -> Array:
    """Rows in real numbers: the first, which is real, and both parts of each other one, the second times a sign."""
    return np.array([np.real(rows[0]), *(part for row in rows[1:] for part in (np.real(row), sign * np.imag(row)))])


def _places(equations: ReducedEquations) -> Array:
    """(freedoms, 3) positions at the start of the bodies that joints lead to, by the joints' rates; 0 of frames."""
    initial, reduced = equations.problem.initial, equations.reduced
    found = [np.zeros(3) if link.pose is None else initial[link.pose.path][4:] for link in reduced.places]
    return np.repeat(np.array(found).reshape(-1, 3), reduced.tables.dim[: reduced.links], axis=0)
