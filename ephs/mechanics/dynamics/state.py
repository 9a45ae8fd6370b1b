"""The state of a mechanism as a value."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import final

import numpy as np

from ephs.mechanics.tree.finding.layout import Layout
from ephs.semantics.bundles.bundle import Array


@final
@dataclass(frozen=True, slots=True, eq=False)
class State:
    """State of a mechanism. All arrays are read-only.

    Parameters
    ----------
    array
        (size,) the elements of all joints in the order of `Layout.joints` (angles, distances, unit quaternions; of
        cut joints too), the rates of the tree's degrees of freedom, the entropies of `Layout.entropies` in J/K.
    layout
        Where each joint stands in the array.
    cut_rates
        (total − n,) what the tree's rates make of those of cut joints.
    """

    array: Array
    layout: Layout
    cut_rates: Array

    def __post_init__(self) -> None:
        self.array.setflags(write=False)
        self.cut_rates.setflags(write=False)

    def __repr__(self) -> str:
        return f"State of {', '.join(self.layout.joints)}: {self.array}"

    @property
    def q(self) -> Array:
        """(elements,) of all joints, those of the tree first; with pins and slides only, its coordinates."""
        return self.array[: self.layout.elements_end]

    @property
    def r(self) -> Array:
        """(n,) rates of the tree's freedoms."""
        return self.array[self.layout.elements_end : self.layout.elements_end + self.layout.n]

    @property
    def entropies(self) -> Array:
        """(entropies,) in J/K."""
        return self.array[self.layout.elements_end + self.layout.n :]

    @property
    def coordinates(self) -> Mapping[str, Array]:
        """Joint -> (d,) its coordinates: rad, m, rotation vectors in the axes of C1."""
        return MappingProxyType({name: _fixed(x) for name, x in self.layout.coordinates(self.q).items()})

    @property
    def rates(self) -> Mapping[str, Array]:
        """Joint -> (d,) its twist u_r in the axes of C2, in rad/s and m/s; of cut joints by the tree's rates."""
        whole = np.concatenate([self.r, self.cut_rates])
        return MappingProxyType({name: _fixed(x) for name, x in self.layout.by_joint(whole).items()})


def _fixed(x: Array) -> Array:
    x.setflags(write=False)
    return x
