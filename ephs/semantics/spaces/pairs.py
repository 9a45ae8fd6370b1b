"""The lower pairs: subgroups of SE(3), each given by a basis of its Lie algebra.

The element x of a pair's group is the pose of the second joint frame in the first. Axes and origin are always
e₃ and 0: other axes are a matter of the offsets between joint frames and bodies. One basis B, constant, gives
everything: the degrees of freedom u ↦ B u, the multipliers' wrenches, the joint's effort λ ↦ Bᵀ λ. Angles live on the
universal cover, so a torsional spring knows how often it was wound; strictly, the pair's group then covers
the subgroup.

Source: Lohmayer, Capobianco, Leyendecker, "Exergetic Port-Hamiltonian Systems for Multibody Dynamics".
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeAlias, final

import numpy as np

from ephs.operad.quantities import name_pair
from ephs.semantics.spaces import codes, groups
from ephs.semantics.spaces import rotations as so3
from ephs.semantics.spaces.decompositions import pseudoinverse
from ephs.semantics.spaces.errors import SpaceError
from ephs.semantics.spaces.manifold import Array, Manifold, register_manifold

if TYPE_CHECKING:
    from ephs.operad import Space

SETTLED = 1e-13
"""Step of Newton's method in rad and m that ends it: its square is below all rounding."""

Basis: TypeAlias = Callable[..., Array]


@final
@dataclass(frozen=True, slots=True)
class Pair:
    """A subgroup of SE(3) in which one body moves relative to another.

    Attributes
    ----------
    name
        The kind of joint.
    parameters
        Names and values of its parameters, such as a screw's pitch in metres per radian.
    symbol
        The group, for printing.
    basis
        B, shape (6, dim), read-only: columns span the Lie algebra, rows are (ω, υ).
    manifold
        The group itself, intrinsically: how elements x are stored, multiplied and retracted.
    """

    name: str
    parameters: tuple[tuple[str, float], ...]
    symbol: str = field(compare=False)
    basis: Array = field(compare=False, repr=False)
    manifold: Manifold = field(compare=False, repr=False)

    @property
    def code(self) -> int:
        """Code of the group in compiled kernels."""
        return self.manifold.code

    @property
    def dim(self) -> int:
        """Number of freedoms of the pair."""
        return self.manifold.dim

    @property
    def size(self) -> int:
        """Number of reals that store an element."""
        return self.manifold.size

    @staticmethod
    def from_space(space: "Space") -> "Pair":
        """The pair of a space of relative poses."""
        return pair(space.name, **dict(space.parameters))

    def include(self, x: Array) -> Array:
        """The inclusion I(x) into SE(3): the pose, shape (7,), of the second joint frame in the first."""
        match self.code:
            case codes.SO3:
                return np.concatenate((x, np.zeros(3)))
            case codes.SE2:
                half = 0.5 * x[0]
                return np.array([np.cos(half), 0.0, 0.0, np.sin(half), x[1], x[2], 0.0])
            case codes.SE3:
                return np.array(x, dtype=np.float64)
            case _:
                # Abelian: exp is a homomorphism, and onto.
                return groups.SE3.exp(self.basis @ x)

    def coordinates(self, x: Array) -> Array:
        """The joint coordinates, shape (..., dim), of elements (..., size): angles in radians, distances in metres.

        Rotation vectors are principal values of length ≤ π; single angles are not wrapped.
        """
        match self.code:
            case codes.SO3:
                return so3.rotation_log(x)
            case codes.SE3:
                return np.concatenate((so3.rotation_log(x[..., :4]), x[..., 4:]), axis=-1)
            case _:
                return np.array(x)

    def element(self, coordinates: Array) -> Array:
        """The element, shape (size,), with the given joint coordinates.

        Raises
        ------
        SpaceError
            The coordinates are not of shape (dim,).
        """
        given = np.array(coordinates, dtype=np.float64)
        if given.shape != (self.dim,):
            raise SpaceError("pair coordinates", name=self.name, found=given.shape, expected=(self.dim,))
        match self.code:
            case codes.SO3:
                return groups.SO3.exp(given)
            case codes.SE3:
                return np.concatenate((groups.SO3.exp(given[:3]), given[3:]))
            case _:
                return given

    def fit(self, relative: Array, near: Array | None = None) -> Array:
        """The element whose inclusion is nearest to a pose (7,); of several, one close to ``near``."""
        if self.code == codes.SE3:
            return np.array(relative)
        pitch = dict(self.parameters).get("pitch", 0.0)
        if near is not None:
            x = np.array(near)
        else:  # the number of turns of a screw follows from its translation
            x = np.array([relative[6] / pitch]) if pitch else self.manifold.identity()
        for _ in range(30):
            step = left_inverse(self) @ groups.SE3.log(
                groups.SE3.compose(groups.SE3.inverse(self.include(x)), relative)
            )
            x = self.manifold.retract(x, step)
            if np.linalg.norm(step) < SETTLED:
                break
        return x


@cache
def left_inverse(of: Pair) -> Array:
    """(d, 6), read-only: the least matrix B⁺ with B⁺ B = 1."""
    out = np.asarray(pseudoinverse(of.basis), dtype=float)
    out.setflags(write=False)
    return out


@final
@dataclass(frozen=True, slots=True)
class PairEntry:
    """Data that determine a pair.

    Attributes
    ----------
    name
        The kind of joint.
    symbol
        The group, for printing.
    basis
        Called with the parameters by name; returns B, shape (6, dim).
    group
        The intrinsic group; None for an abelian one, whose elements are their own coordinates.
    parameters
        Names of the parameters.
    """

    name: str
    symbol: str
    basis: Basis
    group: Manifold | None = None
    parameters: tuple[str, ...] = ()


_ENTRIES: dict[str, PairEntry] = {}
PAIRS: Mapping[str, PairEntry] = MappingProxyType(_ENTRIES)


def register_pair(entry: PairEntry) -> None:
    """Make a pair known: to `pair`, to `quantity`, to joints, and its group as a space of the same name to `manifold`.

    Raises
    ------
    SpaceError
        The name is taken.
    """
    if entry.name in _ENTRIES:
        raise SpaceError("pair taken", name=entry.name)
    if entry.group is None:
        # How many degrees of freedom a pair has does not depend on its parameters.
        dim = size = np.shape(entry.basis(**dict.fromkeys(entry.parameters, 1.0)))[-1]
    else:
        dim, size = entry.group.dim, entry.group.size
    name_pair(entry.name, dim, size, entry.parameters)
    register_manifold(entry.name, lambda space: Pair.from_space(space).manifold)
    _ENTRIES[entry.name] = entry


@lru_cache(maxsize=256)
def pair(kind: str, **parameters: float) -> Pair:
    """The lower pair of a kind.

    Parameters
    ----------
    kind
        A name in `PAIRS`.
    **parameters
        Exactly those that the entry names, such as ``pitch`` of a screw in metres per radian.

    Raises
    ------
    SpaceError
        The kind is not known, parameters are missing or not known, or the entry's basis has the wrong shape.
    """
    entry = _ENTRIES.get(kind)
    if entry is None:
        raise SpaceError("unknown pair", name=kind, known=", ".join(_ENTRIES))
    if sorted(parameters) != sorted(entry.parameters):
        raise SpaceError("pair parameters", name=kind, found=sorted(parameters), expected=sorted(entry.parameters))
    basis = np.array(entry.basis(**parameters), dtype=np.float64)
    columns = entry.group.dim if entry.group is not None else basis.shape[-1]
    if basis.shape != (6, columns):
        raise SpaceError("pair basis", name=kind, found=basis.shape, expected=(6, columns))
    basis.setflags(write=False)
    group = groups.vector_space(kind, columns) if entry.group is None else entry.group
    return Pair(kind, tuple(sorted(parameters.items())), entry.symbol, basis, group)


def _columns(*numbers: int) -> Basis:
    return lambda: np.eye(6)[:, list(numbers)]


def _screw(pitch: float) -> Array:
    return np.array([[0.0], [0.0], [1.0], [0.0], [0.0], [pitch]])


for _entry in (
    PairEntry("revolute", "SO(2)", _columns(2)),
    PairEntry("prismatic", "ℝ", _columns(5)),
    PairEntry("screw", "H", _screw, parameters=("pitch",)),
    PairEntry("cylindrical", "SO(2) × ℝ", _columns(2, 5)),
    PairEntry("planar", "SE(2)", _columns(2, 3, 4), groups.SE2),
    PairEntry("spherical", "SO(3)", _columns(0, 1, 2), groups.SO3),
    PairEntry("fixed", "1", _columns()),
    PairEntry("free", "SE(3)", _columns(0, 1, 2, 3, 4, 5), groups.SE3),
):
    register_pair(_entry)
