"""Relation of a primitive between its port variables: in continuous time, or over one step.

The pattern glues either in the same way; this is why discretising commutes with composing.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.bundles.given import defined
from ephs.semantics.primitives.primitives import Irreversible, Point, Primitive, Reversible, Storage, midpoint


@final
@dataclass(frozen=True, slots=True)
class Storing:
    """A storage: its effort (n,) as a function of the rate w (n,)."""

    effort: Callable[[Array], Array]


@final
@dataclass(frozen=True, slots=True)
class Relating:
    """A reversible or irreversible primitive: (f (n,), conditions (k,)) from e (n,), λ (k,), rates of read states."""

    relate: Callable[[Array, Array, Mapping[Path, Array]], tuple[Array, Array]]


Behaviour = Storing | Relating


@final
@dataclass(frozen=True, slots=True)
class ContinuousBehaviour:
    """Primitives at an instant: f = ξ̇, e = dH(ξ), (f, e) ∈ D(x), f = M(x, e) e / θ₀."""

    reference: Reference

    def behaviour(self, primitive: Primitive, x: Point) -> Behaviour:
        """The relation at the base point x (states of the primitive's read ports)."""
        if isinstance(primitive, Storage):
            effort = defined(primitive.name, "the effort", primitive.effort(x, self.reference), x)
            return Storing(lambda _rate: effort)
        if isinstance(primitive, Reversible):
            skew, constraint = primitive.structure(x)
            return Relating(lambda e, lam, _rates: (skew @ e + constraint.T @ lam, constraint @ e))
        return Relating(lambda e, _lam, _rates: (primitive.flow(x, e, self.reference), np.zeros(0)))


Gradient = Callable[[Storage, Point, Array, Reference], Array]
"""(storage, x⁰, increment v (n,), reference) -> effort (n,) over the step."""


def own_gradient(storage: Storage, x0: Point, v: Array, reference: Reference) -> Array:
    """The storage's discrete gradient: the energy balance is exact."""
    return storage.discrete_effort(x0, v, reference)


def midpoint_gradient(storage: Storage, x0: Point, v: Array, reference: Reference) -> Array:
    """The effort half way: exact for quadratic energies only."""
    return storage.effort(storage.retract(x0, 0.5 * v), reference)


def average_gradient(storage: Storage, x0: Point, v: Array, reference: Reference) -> Array:
    """The mean of the effort along the step, by the quadrature of Gauss with eight nodes."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    shares = 0.5 * (1.0 + nodes)
    efforts = [storage.effort(storage.retract(x0, s * v), reference) for s in shares]
    return 0.5 * np.einsum("i,in->n", weights, np.array(efforts))


GRADIENTS: Mapping[str, Gradient] = {
    "own": own_gradient,
    "midpoint": midpoint_gradient,
    "average": average_gradient,
}
"""Discrete gradients under which discretising commutes with composing: each is of one storage alone."""


@final
@dataclass(frozen=True, slots=True)
class NaturalBehaviour:
    """Primitives over a step h, each discretised on its own: x¹ = x⁰·exp(h f), discrete gradients, D_h, M_h.

    This is the discrete functor: the pattern glues what it gives by the same formula as the continuous relations.
    """

    reference: Reference
    h: float
    gradient: Gradient = own_gradient

    def behaviour(self, primitive: Primitive, x: Point) -> Behaviour:
        """The discrete relation from the state x⁰ at the start of the step."""
        h = self.h
        if isinstance(primitive, Storage):
            return Storing(lambda rate: self.gradient(primitive, x, h * rate, self.reference))
        if isinstance(primitive, Irreversible):
            return Relating(
                lambda e, _lam, rates: (
                    primitive.flow(midpoint(primitive, x, _scaled(h, rates)), e, self.reference),
                    np.zeros(0),
                )
            )
        return Relating(lambda e, lam, rates: _reversible_step(primitive, h, x, _scaled(h, rates), e, lam))


def _scaled(h: float, rates: Mapping[Path, Array]) -> dict[Path, Array]:
    return {port: h * rate for port, rate in rates.items()}


def _reversible_step(primitive: Reversible, h: float, x0: Point, v: Point, e: Array, lam: Array) -> tuple[Array, Array]:
    skew, constraint = primitive.structure(midpoint(primitive, x0, v))
    if primitive.discrete is None:
        return skew @ e + constraint.T @ lam, constraint @ e
    discrete, residual = primitive.discrete(h, x0, v, e)
    return skew @ e + discrete.T @ lam, residual
