"""An oracle: rates of a system, evaluated over the relations of its flat pattern, dense and in plain NumPy.

It reads boxes, junctions and the definitions of primitives (dH, L and C, M), numbers them by itself, and takes nothing
of what numbers, compiles or reduces systems in the package. Efforts at storages follow from their states. What is left
are the other efforts e_U and the multipliers λ, from three sets of equations:

    C_U e_U + C_K e_K = 0,   (L e + M e / θ₀ + Cᵀ λ)_U = inputs_U,   N (Ċ e + C_K ė_K) = 0   with N C_U = 0,

the last ones being what constraints leave of ė_K = S ẋ, where S = ∂e/∂x and ẋ = inputs_K − (L e + M e / θ₀ + Cᵀ λ)_K:
the balances of flows at the storages, which are the rates.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Reference
from ephs.semantics.primitives.primitives import Irreversible, Primitive, Reversible, Storage
from ephs.semantics.spaces import manifold
from ephs.semantics.systems.system import System
from tests.numerics import largest

__all__ = ["Oracle", "Unsolved"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]
State = Mapping[Path, Array]

STEP = 1e-3
"""Of differences of fourth order, relative to the size of what moves: truncation and rounding are both near 1e-12."""
RANK = 1e-11
"""Singular values of balanced equations below this part of the largest are zero."""
SETTLED, NEAR = 1e-13, 1e-9
"""Change of the unknowns, relative to them, at which they have settled; and below which they have when it no longer
halves."""


class Unsolved(ArithmeticError):
    """The equations have no solution at this state."""


@dataclass(frozen=True, slots=True)
class _Part:
    """A primitive, the places of its efforts, and the states that it reads by port."""

    primitive: Primitive
    efforts: Index
    reads: dict[Path, Path]
    multipliers: Index


class Oracle:
    """The relations of a system.

    Parameters
    ----------
    inputs
        Outer port -> its value, and whether that is an effort.
    """

    def __init__(self, system: System, inputs: Mapping[Path, tuple[Array, bool]], reference: Reference) -> None:
        flat = system.flatten()
        pattern, self.reference = flat.pattern, reference
        self.junctions: dict[Path, Index] = {}
        size = 0
        for path, of in pattern.junctions.items():
            bearing = of.power and any(
                p.power and p.junction == path for b in pattern.boxes.values() for p in b.ports.values()
            )
            dim = of.quantity.space.dim if bearing or (of.exposed and of.power) else 0
            self.junctions[path] = np.arange(size, size + dim)
            size += dim
        stored = {
            pattern.state_class(box.ports[port].junction): path / port
            for path, box in pattern.boxes.items()
            if isinstance(of := flat.fillings[path], Storage)
            for port in of.bundle.ports
        }
        self.size, self.parts, count = size, list[_Part](), 0
        self.spaces: dict[Path, Any] = {}
        self.where: dict[Path, Index] = {}
        for path, box in pattern.boxes.items():
            primitive = flat.fillings[path]
            assert not isinstance(primitive, System)
            places = [self.junctions[box.ports[port].junction] for port in primitive.bundle.ports]
            reads = {port: stored[pattern.state_class(box.ports[port].junction)] for port in primitive.reads}
            rows = primitive.multipliers if isinstance(primitive, Reversible) else 0
            efforts = np.concatenate([np.zeros(0, dtype=np.int64), *places])
            self.parts.append(_Part(primitive, efforts, reads, np.arange(count, count + rows)))
            count += rows
            if isinstance(primitive, Storage):
                self.spaces |= {path / port: manifold(q.space) for port, _, q in primitive.bundle.items()}
                self.where |= {path / port: efforts[at] for port, at, _ in primitive.bundle.items()}
        self.multipliers = count
        self.given, self.prescribed = np.zeros(size), dict[int, float]()
        for port, (value, effort) in inputs.items():
            where = self.junctions[port]
            if effort:
                self.prescribed |= dict(zip(where.tolist(), np.asarray(value).tolist(), strict=True))
            else:
                self.given[where] += value

    # ---- the relations -----------------------------------------------------------------------------------------

    def _known(self, x: State) -> dict[int, float]:
        """Efforts of storages and inputs."""
        out = dict(self.prescribed)
        for part in self.parts:
            if isinstance(part.primitive, Storage):
                effort = part.primitive.effort(self._point(part, x), self.reference)
                out |= dict(zip(part.efforts.tolist(), effort.tolist(), strict=True))
        return out

    def _point(self, part: _Part, x: State) -> dict[Path, Array]:
        return {port: x[state] for port, state in part.reads.items()}

    def _structure(self, x: State) -> tuple[Array, Array]:
        """L and C of all reversible components."""
        gyro, constraints = np.zeros((self.size, self.size)), np.zeros((self.multipliers, self.size))
        for part in self.parts:
            if isinstance(part.primitive, Reversible):
                own, constraint = part.primitive.structure(self._point(part, x))
                np.add.at(gyro, np.ix_(part.efforts, part.efforts), own)
                np.add.at(constraints, np.ix_(part.multipliers, part.efforts), constraint)
        return gyro, constraints

    def _produced(self, x: State, e: Array) -> Array:
        """Flows of all irreversible components."""
        out = np.zeros(self.size)
        for part in self.parts:
            if isinstance(part.primitive, Irreversible):
                flow = part.primitive.flow(self._point(part, x), e[part.efforts], self.reference)
                np.add.at(out, part.efforts, flow)
        return out

    def _compliance(self, x: State) -> Array:
        """S = ∂e/∂x of all storages, left-trivialised."""
        out = np.zeros((self.size, self.size))
        for part in self.parts:
            if not isinstance(part.primitive, Storage) or part.primitive.environment:
                continue
            point, of = self._point(part, x), part.primitive
            for port, where, quantity in of.bundle.items():
                ends = [abs(float(point[port][0]) - end) for end in quantity.domain if np.isfinite(end)]
                h = STEP * min([1.0, *ends])
                for i in range(where.start, where.stop):
                    along = np.zeros(of.bundle.size)
                    along[i] = h

                    def effort(steps: float, of: Storage = of, point: State = point, along: Array = along) -> Array:
                        return of.effort(of.retract(dict(point), steps * along), self.reference)

                    out[part.efforts, part.efforts[i]] = _difference(effort) / h
        return out

    def _turning(self, x: State, rates: Array) -> Array:
        """Ċ along rates of the states, given at their junctions."""
        moved = {path: rates[where] for path, where in self.where.items()}
        fastest = max((float(largest(v)) for v in moved.values() if v.size), default=0.0)
        if not fastest > 0.0:
            return np.zeros((self.multipliers, self.size))

        def at(t: float) -> Array:
            near = {path: self.spaces[path].retract(x[path], t * v) if v.size else x[path] for path, v in moved.items()}
            return self._structure(near)[1]

        return _difference(lambda steps: at(steps * STEP / fastest)) * fastest / STEP

    # ---- their solution ----------------------------------------------------------------------------------------

    def rates(self, x: State) -> dict[Path, Array]:
        """State -> its left-trivialised rate.

        Raises
        ------
        Unsolved
            The iteration does not settle.
        """
        known = self._known(x)
        held = np.array(sorted(known), dtype=np.int64)
        free = np.setdiff1d(np.arange(self.size), held)
        stores = np.array(sorted(int(i) for where in self.where.values() for i in where), dtype=np.int64)
        gyro, c = self._structure(x)
        s = self._compliance(x)
        e, lam = np.zeros(self.size), np.zeros(self.multipliers)
        e[held] = [known[int(i)] for i in held]
        n = _left_null(c[:, free])
        read = np.isin(np.arange(self.size), self._read())

        def flows(e: Array, lam: Array) -> Array:
            return gyro @ e + self._produced(x, e) + c.T @ lam - self.given

        change = np.inf
        for _ in range(30):
            f = flows(e, lam)
            rates = np.zeros(self.size)
            rates[stores] = -f[stores]
            turning = self._turning(x, np.where(read, rates, 0.0))
            residual = np.concatenate([c @ e, f[free], n @ (turning @ e + c @ (s @ rates))])
            inner = gyro[:, free] + self._slopes(x, e, free)
            through = n @ c @ s
            matrix = np.block([
                [c[:, free], np.zeros((self.multipliers, self.multipliers))],
                [inner[free], c[:, free].T],
                [n @ turning[:, free] - through @ inner, -through @ c.T],
            ])  # fmt: skip
            step = _solved(matrix, residual)
            e[free] -= step[: free.size]
            lam -= step[free.size :]
            last, change = change, max(_relative(step[: free.size], e), _relative(step[free.size :], lam))
            if change <= SETTLED or (change <= NEAR and change >= 0.5 * last):
                break
        else:
            raise Unsolved(f"the last change is {change:.1e}")
        f = flows(e, lam)
        return {path: -f[where] for path, where in self.where.items()}

    def _read(self) -> Index:
        """Places of the states that constraints read."""
        found = [self.where[state] for part in self.parts if part.multipliers.size for state in part.reads.values()]
        return np.concatenate([np.zeros(0, dtype=np.int64), *found])

    def _slopes(self, x: State, e: Array, free: Index) -> Array:
        """∂(irreversible flows)/∂e_U: the iteration's, not exact."""
        out = np.zeros((self.size, free.size))
        touched = {int(i) for part in self.parts if isinstance(part.primitive, Irreversible) for i in part.efforts}
        for k, i in enumerate(free.tolist()):
            if i in touched:
                h = STEP * max(1.0, abs(float(e[i])))
                unit = np.zeros(self.size)
                unit[i] = 1.0
                out[:, k] = (self._produced(x, e + h * unit) - self._produced(x, e - h * unit)) / (2.0 * h)
        return out


def _difference(function: Callable[[float], Array]) -> Array:
    """The derivative at zero by steps of one, of fourth order."""
    return (8.0 * (function(1.0) - function(-1.0)) - (function(2.0) - function(-2.0))) / 12.0


def _left_null(matrix: Array) -> Array:
    """Orthonormal rows n with n·matrix = 0."""
    if not matrix.size:
        return np.eye(matrix.shape[0])
    u, sigma, _ = np.linalg.svd(matrix)
    return u[:, int(np.sum(sigma > RANK * sigma[0])) :].T


def _solved(matrix: Array, right: Array) -> Array:
    """A solution of equations whose rows and columns are brought to one size."""
    rows, columns = np.ones(matrix.shape[0]), np.ones(matrix.shape[1])
    for _ in range(4):
        sizes = np.abs(matrix * columns * rows[:, None])
        rows /= np.sqrt(_positive(sizes.max(axis=1, initial=0.0)))
        columns /= np.sqrt(_positive(sizes.max(axis=0, initial=0.0)))
    return columns * np.linalg.lstsq(matrix * columns * rows[:, None], rows * right, rcond=RANK)[0]


def _positive(sizes: Array) -> Array:
    return np.where(sizes > 0.0, sizes, 1.0)


def _relative(change: Array, of: Array) -> float:
    return float(largest(change, initial=0.0)) / max(float(largest(of, initial=0.0)), 1e-300)
