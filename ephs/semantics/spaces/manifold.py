"""Interface of every space of states, and the registry from names to manifolds.

The states of every quantity form a Lie group: coordinates add, poses multiply. All tangent and cotangent
vectors are *left-trivialised*: a twist u at x stands for the tangent vector x·u. So a vector space and SE(3)
answer to the same few operations, and an integrator written with them works for both.

This is the reference: plain NumPy, one point a call, written for clarity. The staged formulas are tested
against it. Source: Lohmayer, Capobianco, Leyendecker, "Exergetic Port-Hamiltonian Systems for Multibody
Dynamics".
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ephs.semantics.spaces.errors import SpaceError

if TYPE_CHECKING:
    from ephs.operad import Space

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Manifold(ABC):
    """A Lie group with exponential map and left trivialisation.

    Attributes
    ----------
    name
        The name of the space.
    dim
        Dimension of the group, and of its Lie algebra.
    size
        How many numbers a point is stored as.
    code
        The number by which programs know the group (see `codes`).

    Notes
    -----
    Points have shape (size,), tangent and cotangent vectors (dim,), linear maps (dim, dim).
    """

    name: str
    dim: int
    size: int
    code: int

    @abstractmethod
    def identity(self) -> Array:
        """The neutral element."""

    @abstractmethod
    def compose(self, a: Array, b: Array) -> Array:
        """The product a·b."""

    @abstractmethod
    def inverse(self, a: Array) -> Array:
        """The inverse of a."""

    @abstractmethod
    def exp(self, v: Array) -> Array:
        """The exponential map from the Lie algebra."""

    @abstractmethod
    def log(self, x: Array) -> Array:
        """The principal logarithm; angles of rotations up to π."""

    @abstractmethod
    def adjoint(self, x: Array) -> Array:
        """Matrix of Ad_x: u ↦ x u x⁻¹. Its transpose is the plain dual Ad*_x, an anti-homomorphism."""

    @abstractmethod
    def ad(self, u: Array) -> Array:
        """Matrix of ad_u: w ↦ [u, w]. Its transpose is the dual ad*_u."""

    @abstractmethod
    def dexp(self, v: Array) -> Array:
        """Right-trivialised differential of exp: (d exp v) exp(v)⁻¹ = dexp_v dv."""

    @abstractmethod
    def dexp_inv(self, v: Array) -> Array:
        """Inverse of `dexp`; singular where a rotation reaches 2π."""

    @abstractmethod
    def normalise(self, x: Array) -> Array:
        """The point with rounding errors of its representation removed (unit quaternion)."""

    @abstractmethod
    def random(self, rng: np.random.Generator) -> Array:
        """A random point: rotations uniform, all else normal with unit variance."""

    def retract(self, x: Array, v: Array) -> Array:
        """The point x·exp(v) reached from x with the left-trivialised displacement v."""
        return self.compose(x, self.exp(v))

    def increment(self, x0: Array, x1: Array) -> Array:
        """The displacement log(x0⁻¹ x1) with which `retract` leads from x0 to x1."""
        return self.log(self.compose(self.inverse(x0), x1))

    def midpoint(self, x0: Array, x1: Array) -> Array:
        """The point half way from x0 to x1; the same from either end."""
        return self.retract(x0, 0.5 * self.increment(x0, x1))

    def coadjoint(self, x: Array) -> Array:
        """Matrix of the plain dual Ad*_x, the transpose of Ad_x; an anti-homomorphism."""
        return self.adjoint(x).T

    def dexp_left(self, v: Array) -> Array:
        """Left-trivialised differential of exp: x⁻¹dx = dexp_left(v) dv for x = x0·exp(v)."""
        return self.dexp(-v)

    def dexp_left_inv(self, v: Array) -> Array:
        """Inverse of `dexp_left`: the change of the displacement v that a twist at x0·exp(v) makes."""
        return self.dexp_inv(-v)


Factory: TypeAlias = "Callable[[Space], Manifold]"

_FACTORIES: dict[str, Factory] = {}
# One entry serves every dual space.
_DUAL = "*"


def register_manifold(name: str, factory: Factory) -> None:
    """Register a space by its name.

    Parameters
    ----------
    name
        The name that spaces carry. Names ending in "*" are dual vector spaces and need no entry.
    factory
        Called with the space; returns its manifold.

    Raises
    ------
    SpaceError
        The name is taken, or ends in "*".
    """
    if name.endswith("*") and name != _DUAL:
        raise SpaceError("dual name", name=name)
    if name in _FACTORIES:
        raise SpaceError("manifold taken", name=name)
    _FACTORIES[name] = factory


@lru_cache(maxsize=256)
def manifold(space: "Space") -> Manifold:
    """The manifold that a space names.

    Parameters
    ----------
    space
        A value with `name`, `dim`, `size` and `parameters`.

    Raises
    ------
    SpaceError
        The name is not known, or the space's numbers are not the manifold's.
    """
    factory = _FACTORIES.get(_DUAL if space.name.endswith(_DUAL) else space.name)
    if factory is None:
        raise SpaceError("unknown space", name=space.name, known=", ".join(sorted(_FACTORIES.keys() - {_DUAL})))
    found = factory(space)
    if (found.dim, found.size) != (space.dim, space.size):
        raise SpaceError(
            "space numbers", name=space.name, found=(space.dim, space.size), expected=(found.dim, found.size)
        )
    return found
