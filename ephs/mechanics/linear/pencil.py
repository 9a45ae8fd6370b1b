"""The descriptor form of a system at a state: its derivatives, and which states are independent.

It is Tᵀ ẋ + N(e, x) + Cᵀ λ = B u, T e = dH(x), C(x) e = 0 (T takes efforts of junctions to storages). Eliminating e
from the last two leaves conditions on x alone, whose kernel is what the states may do.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.runs.system_problem import problem_of_system
from ephs.mechanics.tree.finding.frames import Unplaced, frames_of
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.descriptor.descriptor import StateSlot
from ephs.semantics.spaces.decompositions import least_squares, svd
from ephs.semantics.spaces.rank import CONSTRAINT, ELIMINATION, REGULAR, TINY, rank_of
from ephs.semantics.systems.system import System
from ephs.solve.equations.instant import rates_read
from ephs.solve.equations.model import Model, model_of
from ephs.solve.equations.sparse import Index
from ephs.solve.methods.continuous import Continuous
from ephs.solve.methods.stored import StoredEnergies
from ephs.solve.posing.errors import OptionError, Outcome, SolveError
from ephs.solve.posing.problem import Problem

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ephs.mechanics.dynamics import Dynamics

SETTLED, LEAST = 1e-12, 1e-6
"""Relative step at which Newton's method ends, with this least scale of unknowns."""
ROUNDING = 1e-13
"""The same in implicit steps, whose matrices are better conditioned."""
BESIDE, BESIDE_ZERO = (1e-9, 1e-12), (1e-24, 1e-30)
"""Distances at which derivatives are compared with difference quotients: parts of a number, and from 0."""
NOISE = 64.0 * float(np.finfo(float).eps)
"""Rounding of an equation, relative to its terms."""
NOTHING = 1e-12
"""Conditions below this part of the largest stiffness are rounding."""


def system_problem(
    system: System,
    states: "Mapping[str, ArrayLike] | None",
    inputs: Mapping[str, Any] | None,
    reference: Reference | None,
    name: str = "system",
) -> Problem:
    """The problem with constant inputs: zero flow at outer ports that are not named.

    Raises
    ------
    OptionError
        An input is not constant.
    """
    outer = {str(port): of for port, of in system.interface.items() if of.power}
    given = {port: {"flow": np.zeros(of.quantity.space.dim)} for port, of in outer.items()} | dict(inputs or {})
    problem = problem_of_system(system, {str(k): v for k, v in (states or {}).items()}, given, reference, name=name)
    if not problem.constant:
        raise OptionError("inputs", "a function", "constants")
    return problem


def mechanism_of(problem: Problem) -> "Dynamics | None":
    """The bodies and joints of a problem in joint coordinates; None where nothing is joined.

    Raises
    ------
    OptionError
        There are joints, beside something that has no place in joint coordinates.
    """
    from ephs.mechanics.dynamics import Dynamics

    found = frames_of(problem.descriptor)
    if not found.links:
        return None
    try:
        return Dynamics(problem)
    except Unplaced as error:
        if not found.joints:  # the poses of bodies that nothing joins are independent
            return None
        expected = "a mechanism in joint coordinates; form='paper' linearises all its states, open joints among them"
        raise OptionError("model", str(error), expected) from error


@final
@dataclass(frozen=True, slots=True, eq=False)
class DescriptorParts:
    """The linearised descriptor form at a state.

    Parameters
    ----------
    rates
        (n_w,) of the states.
    T, Q
        (n_w, n_e) efforts of storages, (n_w, n_w) Hessian of the exergy.
    flow_rates, flow_efforts, flow_states
        The balances' derivatives by rates, efforts, states: rows of junctions.
    hold, hold_states
        The conditions' derivatives by efforts and by states: constraints, then prescribed efforts.
    flow_multipliers
        The same by multipliers and flows at ports with prescribed effort.
    force
        (n_e, m) of inputs that are flows; ``set`` (conditions, m) of those that are efforts.
    """

    rates: Array
    T: Array
    Q: Array
    flow_rates: Array
    flow_efforts: Array
    flow_states: Array
    flow_multipliers: Array
    hold: Array
    hold_states: Array
    force: Array
    set: Array

    @property
    def bare(self) -> Index:
        """Mask of balances of junctions without storage."""
        return np.flatnonzero(np.abs(self.flow_rates).max(axis=1, initial=0.0) == 0.0)

    @property
    def stored(self) -> Index:
        """Mask of the remaining ones."""
        return np.setdiff1d(np.arange(len(self.flow_rates)), self.bare)


@final
class Pencil:
    """The equations of a system at a state, with constant inputs."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.model: Model = model_of(problem, 0.0)
        self.equations = Continuous(self.model)
        self.n_w, self.n_e, self.n_l, _ = (int(count) for count in self.model.tables.counts)
        self._given = self.model.input_values()
        self.ports = [(slot, problem.signals[slot.path].effort) for slot in problem.descriptor.outer]

    def unknowns(self, x: Array) -> Array:
        """Rates, efforts, multipliers, outer flows at the states x: those that keep to the constraints.

        Raises
        ------
        SolveError
            There are none near by.
        """
        z = StoredEnergies(self.model).efforts(x)
        for _ in range(30):
            residual = self.equations.residual(x, z, self._given)
            matrices = self.equations.matrices(x, z, self._given)
            kept = self._conditions(self._parts(matrices.unknowns.toarray(), matrices.states.toarray(), z))
            rows = np.vstack([matrices.unknowns.toarray(), np.hstack([kept, np.zeros((len(kept), z.size - self.n_w))])])
            right = np.concatenate([residual, kept @ z[: self.n_w]])
            size = np.maximum(np.abs(rows).max(axis=1, initial=0.0), TINY)
            step = least_squares(rows / size[:, None], right / size, part=REGULAR)
            z = z - step
            if np.abs(step).max(initial=0.0) <= SETTLED * max(LEAST, float(np.abs(z).max(initial=0.0))):
                return z
        raise SolveError(Outcome.DIVERGED, "", "rates and multipliers in this state")

    def parts(self, x: Array, z: Array) -> DescriptorParts:
        """The linearised equations at states x and unknowns z."""
        matrices = self.equations.matrices(x, z, self._given)
        return self._parts(matrices.unknowns.toarray(), matrices.states.toarray(), z)

    def _parts(self, unknowns: Array, states: Array, z: Array) -> DescriptorParts:
        n_w, n_e, n_l = self.n_w, self.n_e, self.n_l
        w, b, c = slice(0, n_w), slice(n_w, n_w + n_e), slice(n_w + n_e, None)
        states = states[:, :n_w]
        width = sum(slot.quantity.space.dim for slot, _ in self.ports)
        force, given = np.zeros((n_e, width)), np.zeros((z.size - n_w - n_e, width))
        at, row = 0, n_l
        for slot, effort in self.ports:
            dim = slot.quantity.space.dim
            if effort:
                given[row : row + dim, at : at + dim] = np.eye(dim)
                row += dim
            else:
                force[slot.efforts, at : at + dim] = np.eye(dim)
            at += dim
        return DescriptorParts(
            z[:n_w], unknowns[w, b], -states[w], unknowns[b, w], unknowns[b, b], states[b], unknowns[b, c],
            unknowns[c, b], states[c], force, given,
        )  # fmt: skip

    def require_derivatives(self, x: Array, z: Array) -> None:
        """Refuse a state at which the equations have none: their difference quotients do not tend to the matrix.

        Raises
        ------
        OptionError
            A state is at a kink or a jump of an energy or a flow.
        """
        matrices, here = self.equations.matrices(x, z, self._given), self.equations.residual(x, z, self._given)
        states, sizes, d = matrices.states.toarray()[:, : self.n_w], np.abs(z), self.problem.descriptor
        # what rounds are temperatures and pressures, not their differences from the environment's
        sizes[self.n_w : self.n_w + self.n_e] += np.abs(self.model.tables.intensive)
        terms = np.abs(matrices.unknowns) @ sizes

        def off(slot: StateSlot, w: Array, step: float, size: float) -> Array:
            """Error of each equation's difference quotient, 0 where it is rounding."""
            noise = NOISE * (terms + (size + step) * np.abs(states[:, slot.rates]).sum(axis=1))
            moved = self.equations.residual(d.advance(x, step * w), z, self._given) - here
            error = np.abs(moved - step * (states @ w))
            return np.where(error > noise, error / step, 0.0)

        for slot in d.states:
            size = float(np.abs(x[slot.point]).max(initial=0.0))
            steps = [size * share for share in BESIDE] if size else BESIDE_ZERO
            for place, side in product(range(slot.rates.start, slot.rates.stop), (1.0, -1.0)):
                w = np.where(np.arange(self.n_w) == place, side, 0.0)
                far, near = (off(slot, w, step, size) for step in steps)
                if np.any((near > 0.9 * far) & (near > 0.0)):
                    expected = "one at which energies and flows have derivatives"
                    raise OptionError("state", f"{slot.path} at a kink", expected)

    def algebraic(self, parts: DescriptorParts) -> tuple[Array, Array, Array]:
        """The equations without rates: (rows on efforts, multipliers and outer flows; their right-hand sides by the
        states; by the inputs): efforts of storages, conditions, balances at junctions without storage."""
        bare = parts.bare
        width = parts.flow_multipliers.shape[1]
        rows = np.block(
            [
                [parts.T, np.zeros((self.n_w, width))],
                [parts.hold, np.zeros((len(parts.hold), width))],
                [parts.flow_efforts[bare], parts.flow_multipliers[bare]],
            ]
        )
        by_states = np.vstack([parts.Q, -parts.hold_states, -parts.flow_states[bare]])
        by_inputs = np.vstack([np.zeros((self.n_w, parts.set.shape[1])), parts.set, parts.force[bare]])
        return rows, by_states, by_inputs

    def _left(self, rows: Array) -> Array:
        """The left kernel of the equations without rates: what leaves conditions on states, and on inputs."""
        u, sigma, _ = svd(rows)
        return u[:, int(np.sum(sigma > ELIMINATION * sigma.max(initial=1.0))) :]

    def _conditions(self, parts: DescriptorParts) -> Array:
        """(c, n_w) conditions on the states' changes."""
        rows, by_states, _ = self.algebraic(parts)
        found = self._left(rows).T @ by_states
        largest = float(np.abs(by_states).max(initial=0.0))
        return found[np.abs(found).max(axis=1, initial=0.0) > NOTHING * largest]  # redundant ones add no conditions

    def differentiated(self, parts: DescriptorParts) -> list[str]:
        """Outer ports whose input holds states themselves, so that its derivative would act."""
        rows, _, by_inputs = self.algebraic(parts)
        held = np.abs(self._left(rows).T @ by_inputs).max(axis=0, initial=0.0) > CONSTRAINT
        names = [str(slot.path) for slot, _ in self.ports for _ in range(slot.quantity.space.dim)]
        return list(dict.fromkeys(name for name, hit in zip(names, held.tolist(), strict=True) if hit))

    def independent(self, parts: DescriptorParts, left_out: Index) -> Index:
        """Places of independent states, without some that act on nothing."""
        from scipy.linalg import qr

        rows = self._conditions(parts)
        if not rows.size:
            return np.setdiff1d(np.arange(self.n_w), left_out)
        size = np.abs(rows).max(axis=0)
        rows = rows / np.maximum(np.abs(rows).max(axis=1, initial=0.0), TINY)[:, None]
        # In the metric of the exergy, independent of the states' units.
        stiff = np.maximum(np.abs(np.diag(parts.Q)), SETTLED * size.max(initial=0.0))
        weight = np.where(size > 0.0, stiff**-0.5, 1.0)
        factors: Any = qr(rows * weight, mode="economic", pivoting=True)
        order, diagonal = np.asarray(factors[2], dtype=np.int64), np.abs(np.diag(factors[1]))
        rank = rank_of(diagonal, CONSTRAINT)
        return np.setdiff1d(np.sort(order[rank:]), left_out)

    def span(self, parts: DescriptorParts, which: Index, left_out: Index) -> Array:
        """(n_w, k) X: the identity on the independent states, within the conditions; what is left out stays."""
        X = np.zeros((self.n_w, which.size))
        X[which, np.arange(which.size)] = 1.0
        rows = self._conditions(parts)
        rest = np.setdiff1d(np.arange(self.n_w), np.concatenate([which, left_out]))
        if rows.size and rest.size:
            size = np.maximum(np.abs(rows).max(axis=1, initial=0.0), TINY)[:, None]
            X[rest] = -least_squares(rows[:, rest] / size, rows[:, which] / size, part=ELIMINATION)
        return X

    @property
    def counted(self) -> Index:
        """Places of the rates that must vanish at rest: all but the environment's."""
        stored = self.problem.descriptor.storages
        found = [i for slot, storage in stored if not storage.environment for i in rates_read(slot)]
        return np.array(found, dtype=np.int64)

    def implicit_step(self, x: Array, guess: Array, h: float) -> Array | None:
        """The unknowns at the end of an implicit Euler step of h seconds; None where Newton's method finds none.

        Raises
        ------
        SolveError
            A component cannot be evaluated at the start.
        """
        d, z = self.problem.descriptor, np.array(guess)
        for iteration in range(25):
            at = d.advance(x, h * z[: self.n_w])
            try:
                residual = self.equations.residual(at, z, self._given)
                matrices = self.equations.matrices(at, z, self._given)
            except SolveError:
                if not iteration and not np.any(guess):
                    raise
                return None
            rows = matrices.unknowns.toarray() + h * matrices.states.toarray()
            columns = np.ones(z.size)
            columns[: self.n_w] = 1.0 / max(1.0, h)  # increments rather than rates: both of one size
            rows = rows * columns
            size = np.maximum(np.abs(rows).max(axis=1, initial=0.0), TINY)
            step = columns * least_squares(rows / size[:, None], residual / size, part=REGULAR)
            if not np.isfinite(step).all():
                return None
            z = z - step
            moved = h * float(np.abs(step[: self.n_w]).max(initial=0.0)) + float(
                np.abs(step[self.n_w :]).max(initial=0.0)
            )
            if moved <= ROUNDING * (
                1.0 + float(np.abs(at).max(initial=0.0)) + float(np.abs(z[self.n_w :]).max(initial=0.0))
            ):
                return z
        return None
