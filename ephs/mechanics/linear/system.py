"""A system linearised in its states.

What its states may do, x = X ξ, is spanned by independent states, so that X is the identity on them. The balances then
give ξ̇, with least-norm multipliers, whatever is redundant. States of the environment act on nothing and are left out.
"""

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.linear.pencil import DescriptorParts, Pencil, mechanism_of, system_problem
from ephs.mechanics.linear.statespace import StateSpace
from ephs.mechanics.linear.structure import PortHamiltonian, Sizes
from ephs.mechanics.scene.errors import did_you_mean, listing
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.spaces import manifold
from ephs.semantics.spaces.decompositions import least_squares, pseudoinverse, svd, symmetric_eigenvalues
from ephs.semantics.spaces.rank import ELIMINATION, IMPLICIT, NEIGHBOUR, SPANNED, TINY, rank_of
from ephs.semantics.systems.system import System
from ephs.solve.equations.instant import rates_read
from ephs.solve.equations.model import Model
from ephs.solve.equations.sparse import Index
from ephs.solve.methods.stored import StoredEnergies
from ephs.solve.posing.errors import OptionError, failing_at
from ephs.solve.posing.problem import Problem
from ephs.solve.result.replay import replay
from ephs.solve.result.solution import Solution
from ephs.solve.running.stepping import Row

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

RESTS = 1e-12
"""Rates of states, in their units, that count as rounding."""
NEGATIVE = 1e-9
"""Tolerance, relative to the largest entry, for zero or non-negative quantities: rounding of eliminations."""


def linear_system(
    system: System,
    states: "Mapping[Any, ArrayLike] | None",
    inputs: "Sequence[str] | Mapping[str, Any] | None",
    outputs: Sequence[str] | None,
    reference: Reference | None,
    name: str = "system",
) -> StateSpace:
    """See `ephs.linearize`."""
    if inputs is not None and not isinstance(inputs, Mapping):
        raise OptionError("inputs", inputs, "{port: {'effort': e}} or {port: {'flow': f}}, of a system")
    problem = system_problem(system, states, inputs, reference, name)
    if problem.descriptor.strikes is not None and (model := mechanism_of(problem)) is not None:
        model.loading.hard.check_open(model.state0.q, model.state0.r)
    with failing_at(0.0):
        found = LinearSystem(problem, problem.point)
        found.pencil.require_derivatives(found.x, found.z)
        return found.whole(outputs)


@final
class LinearSystem:
    """One linearisation.

    Attributes
    ----------
    which, X
        Places of the k independent states, and (n_w, k) what all do with them.
    A, B
        (k, k), (k, m) of the independent states; m are the numbers of all outer ports.
    ports
        Outer power port -> (d, k + m) what the power conjugate of its input is, of states and inputs.
    columns
        Outer power port -> its place among the m.
    held
        Outer ports whose input holds states, so that its derivative would act.
    """

    def __init__(self, problem: Problem, x: Array) -> None:
        self.pencil, self.x = Pencil(problem), x
        pencil, d = self.pencil, problem.descriptor
        self.z = pencil.unknowns(x)
        self.parts = p = pencil.parts(x, self.z)
        self.held = pencil.differentiated(p)
        still = [i for slot, storage in d.storages if storage.environment for i in rates_read(slot)]
        self.left_out = np.array(still, dtype=np.int64)
        self.which = pencil.independent(p, self.left_out)
        self.X = X = pencil.span(p, self.which, self.left_out)
        self.k = k = self.which.size
        rows, by_states, by_inputs = pencil.algebraic(p)
        back = pseudoinverse(rows, part=ELIMINATION)  # efforts, multipliers, outer flows: a = by ξ and u, and W c
        given = np.hstack([by_states @ X, by_inputs])
        by = back @ given
        W = _kernel(rows)
        moving = np.hstack([X, np.eye(pencil.n_w)[:, self.left_out]])
        acting = np.hstack([p.flow_efforts, p.flow_multipliers])
        matrix = np.hstack([p.flow_rates @ moving, acting @ W])
        right = np.hstack([-(p.flow_rates @ self._turning() + p.flow_states @ X), p.force]) - acting @ by
        found = _solved(matrix[p.stored], right[p.stored], k)
        rest = found[moving.shape[1] :]
        whole, known = by + W @ rest, np.abs(found).max(axis=0, initial=0.0)  # κ ε of which is in all of a solution
        terms = np.abs(back) @ np.abs(given) + np.abs(W).sum(axis=1, keepdims=True) * known
        self.sizes = Sizes.of(found[:, k:], terms[:, :k], terms[:, k:])
        self.A, self.B = found[:k, :k], found[:k, k:]
        efforts, flows = whole[: pencil.n_e], whole[pencil.n_e + pencil.n_l :]
        self.ports: dict[str, Array] = {}
        self.columns: dict[str, slice] = {}
        flow = at = 0
        for slot, effort in pencil.ports:
            dim = slot.quantity.space.dim
            self.ports[str(slot.path)] = flows[flow : flow + dim] if effort else efforts[slot.efforts]
            self.columns[str(slot.path)] = slice(at, at + dim)
            flow, at = flow + (dim if effort else 0), at + dim

    def refuse(self, ports: Collection[str]) -> None:
        """Refuse inputs that hold states.

        Raises
        ------
        OptionError
            One of them does.
        """
        if held := [name for name in self.held if name in ports]:
            expected = "the other of effort and flow there: as it is, its derivative would act on the states"
            raise OptionError("inputs", ", ".join(held), expected)

    def whole(self, outputs: Sequence[str] | None) -> StateSpace:
        """The linear system of all independent states."""
        self.refuse(self.ports)
        pencil, A, X = self.pencil, self.A, self.X
        C, D, names_out = self._outputs(outputs)
        structure, reason = _structure(self.parts, X, self.which, A)
        if structure is not None:
            A = (structure.J - structure.R) @ structure.Q
        d = pencil.problem.descriptor
        return StateSpace(
            pencil.problem.name, A, self.B, C, D, self._names(), self._names_in(), names_out, structure, reason,
            MappingProxyType({str(slot.path): X[slot.rates] for slot in d.states if slot.quantity.space.dim}),
            MappingProxyType({str(path): value.copy() for path, value in d.unpack(self.x).items()}),
            partial(_play, pencil.problem, pencil.model, self.x, X), self.sizes,
        )  # fmt: skip

    def _turning(self) -> Array:
        """(n_w, k) Ẋ + ad_w X: what a state that moves adds to the rates' changes δw = X ξ̇ + …"""
        pencil, d = self.pencil, self.pencil.problem.descriptor
        out, w = np.zeros_like(self.X), self.parts.rates
        speed = float(np.abs(w).max(initial=0.0))
        if speed <= RESTS:
            return out
        for slot in d.states:
            out[slot.rates] = manifold(slot.quantity.space).ad(w[slot.rates]) @ self.X[slot.rates]
        if self.k + self.left_out.size < pencil.n_w:  # by differences of fourth order
            h = 1e-3 / max(1.0, speed)
            spans: dict[int, Array] = {}
            for step in (-2, -1, 1, 2):
                x = d.advance(self.x, step * h * w)
                spans[step] = pencil.span(pencil.parts(x, pencil.unknowns(x)), self.which, self.left_out)
            out += (8.0 * (spans[1] - spans[-1]) - (spans[2] - spans[-2])) / (12.0 * h)
        return out

    def _names(self) -> tuple[str, ...]:
        names = [""] * self.pencil.n_w
        for slot in self.pencil.problem.descriptor.states:
            names[slot.rates] = _numbered(str(slot.path), slot.quantity.space.dim)
        return tuple(names[int(i)] for i in self.which)

    def _names_in(self) -> tuple[str, ...]:
        ports = self.pencil.ports
        return tuple(name for slot, _ in ports for name in _numbered(str(slot.path), slot.quantity.space.dim))

    def _outputs(self, wanted: Sequence[str] | None) -> tuple[Array, Array, tuple[str, ...]]:
        """C, D and names: of ports the power conjugate of what is prescribed there, of states their change."""
        rows, width = dict(self.ports), self.B.shape[1]
        ports = tuple(rows)
        for slot in self.pencil.problem.descriptor.states:
            rows.setdefault(str(slot.path), np.hstack([self.X[slot.rates], np.zeros((slot.quantity.space.dim, width))]))
        for name in wanted or ():
            if name not in rows:
                raise OptionError("outputs", name, did_you_mean(name, rows, f"one of {listing(rows)}"))
        chosen = ports if wanted is None else tuple(wanted)
        whole = np.vstack([np.zeros((0, self.k + width)), *(rows[name] for name in chosen)])
        names = tuple(numbered for name in chosen for numbered in _numbered(name, rows[name].shape[0]))
        return whole[:, : self.k], whole[:, self.k :], names


def _structure(p: DescriptorParts, X: Array, which: Index, A: Array) -> tuple[PortHamiltonian | None, str]:
    """J, R and Q on the independent states, or why there are none.

    Efforts that satisfy the conditions are e = V c, those of storages ε = P c with P = T V. Balances projected on V
    have no multipliers; eliminating what P does not see of c leaves ẋ = 𝒥 ε on the range of P, and multipliers across
    it, which Π, the projection onto the conditions along them, takes out.
    """
    size = np.abs(A).max(initial=0.0)
    turned = max(np.abs(p.flow_states @ X).max(initial=0.0), np.abs(p.hold_states @ X).max(initial=0.0))
    if turned > NEGATIVE * max(1.0, np.abs(p.flow_efforts).max(initial=0.0)):
        return None, "exchange or dissipation depends on the state in this state"
    if np.abs(p.Q - p.Q.T).max(initial=0.0) > NEGATIVE * np.abs(p.Q).max(initial=0.0):
        return None, "a potential pushes a state on a group, where it has no Hessian"
    V = _kernel(p.hold)
    P, N = p.T @ V, V.T @ p.flow_efforts @ V
    back, W = pseudoinverse(P, part=ELIMINATION), _kernel(P)
    returned = W.T @ N @ W
    inner = N - N @ W @ pseudoinverse(returned, part=ELIMINATION) @ W.T @ N
    flow = -back.T @ inner @ back
    across = np.hstack([_kernel(P.T), back.T @ N @ W @ _kernel(returned)])
    held = across.T @ p.Q @ across
    project = np.eye(len(X)) - across @ pseudoinverse(held, part=ELIMINATION) @ across.T @ p.Q
    whole = (project @ flow @ project.T)[np.ix_(which, which)]
    Q = X.T @ p.Q @ X
    J, R, Q = 0.5 * (whole - whole.T), -0.5 * (whole + whole.T), 0.5 * (Q + Q.T)
    if symmetric_eigenvalues(R).min(initial=0.0) < -NEGATIVE * np.abs(whole).max(initial=0.0):
        return None, "entropy is produced in this state"
    if np.abs((J - R) @ Q - A).max(initial=0.0) > SPANNED * max(size, TINY):
        return None, "stored exergy does not determine what is dissipated in this state"
    return PortHamiltonian(J, R, Q), ""


def _kernel(matrix: Array) -> Array:
    """An orthonormal basis (n, k) of a matrix's null space."""
    if not matrix.size:
        return np.eye(matrix.shape[1])
    _, sigma, vt = svd(matrix)
    return vt[rank_of(sigma, ELIMINATION) :].T


def _solved(matrix: Array, right: Array, count: int) -> Array:
    """The solution of least norm; the first ``count`` unknowns must be determined.

    Raises
    ------
    OptionError
        They are not: efforts or rates are not determined by the equations.
    """
    size = np.maximum(np.abs(matrix).max(axis=1, initial=0.0), TINY)[:, None]
    found = least_squares(matrix / size, right / size, part=IMPLICIT)
    loose = _kernel(matrix / size)[:count]
    off = np.abs(matrix @ found - right).max(initial=0.0)
    if np.abs(loose).max(initial=0.0) > NEIGHBOUR or off > NEIGHBOUR * max(1.0, np.abs(right).max(initial=0.0)):
        raise OptionError("model", "equations that do not determine its rates", "a system whose motion is determined")
    return found


def _numbered(name: str, count: int) -> list[str]:
    return [f"{name}[{i}]" for i in range(count)] if count > 1 else [name] * count


def _play(problem: Problem, model: Model, x: Array, X: Array, t: Array, moved: Array) -> Solution:
    """The system along some displacements (frames, states) of the state."""
    xs = [problem.descriptor.advance(x, X @ row) for row in moved]
    stored = StoredEnergies(model)
    rows = [Row(point, stored.energies(point), np.zeros(4)) for point in xs]
    return replay(problem, t, rows, "mode")
