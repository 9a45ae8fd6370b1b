"""What a primitive imposes on its own port variables: in continuous time, or over one step.

The pattern glues either in the same way; this is why discretising commutes with composing.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundle import Array, Reference
from ephs.semantics.primitives import Irreversible, Point, Primitive, Reversible, Storage, midpoint

__all__ = ["Behaviour", "Continuous", "Natural", "Relating", "Storing"]


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
class Continuous:
    """Primitives at an instant: f = ξ̇, e = dH(ξ), (f, e) ∈ D(x), f = M(x, e) e / θ₀."""

    reference: Reference

    def behaviour(self, primitive: Primitive, x: Point) -> Behaviour:
        """The relation at the base point x (states of the primitive's read ports)."""
        if isinstance(primitive, Storage):
            effort = primitive.effort(x, self.reference)
            return Storing(lambda _rate: effort)
        if isinstance(primitive, Reversible):
            skew, constraint = primitive.structure(x)
            return Relating(lambda e, lam, _rates: (skew @ e + constraint.T @ lam, constraint @ e))
        return Relating(lambda e, _lam, _rates: (primitive.flow(x, e, self.reference), np.zeros(0)))


@final
@dataclass(frozen=True, slots=True)
class Natural:
    """Primitives over a step h, each discretised on its own: x¹ = x⁰·exp(h f), discrete gradients, D_h, M_h."""

    reference: Reference
    h: float

    def behaviour(self, primitive: Primitive, x: Point) -> Behaviour:
        """The discrete relation from the state x⁰ at the start of the step."""
        h = self.h
        if isinstance(primitive, Storage):
            return Storing(lambda rate: primitive.discrete_effort(x, h * rate, self.reference))
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
