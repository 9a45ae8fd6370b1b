"""Axes of a sweep: paths, their values, and the resulting members."""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from ephs.mechanics.runs.signals import numbers_of
from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import OptionError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

MEMBER = "member"
"""The single dimension of individually listed members."""


@final
@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """The numbers that are varied.

    Parameters
    ----------
    paths
        Where they stand in the model, see `ephs.mechanics.scene.parameters`.
    values
        Of each path, (n,).
    paired
        Member k takes the k-th value of every path; else every value of one is combined with all of the others.
    """

    paths: tuple[str, ...]
    values: tuple[Array, ...]
    paired: bool

    @staticmethod
    def of(vary: "Mapping[str, ArrayLike]", *, paired: bool) -> "Axes":
        """From the user's option.

        Raises
        ------
        OptionError
            There is nothing to vary, a value is no finite number, or paired paths have different numbers of values.
        """
        if not vary or not isinstance(vary, Mapping) or not all(isinstance(path, str) for path in vary):
            raise OptionError("vary", vary, "a path and its values, such as {'bodies.crank.mass': [0.1, 0.2]}")
        values: list[Array] = []
        for path, given in vary.items():
            found = numbers_of(given)
            if found is None or found.ndim != 1 or not found.size or not np.all(np.isfinite(found)):
                raise OptionError(f"vary[{path!r}]", given, "one finite number or a list of them")
            values.append(found)
        sizes = {found.size for found in values}
        if paired and len(sizes) > 1:
            found = {path: found.size for path, found in zip(vary, values, strict=True)}
            raise OptionError("vary", found, "equally many values for every path, because paired=True")
        return Axes(tuple(vary), tuple(values), paired)

    @property
    def shape(self) -> tuple[int, ...]:
        """Arrangement of the members."""
        return (self.values[0].size,) if self.paired else tuple(found.size for found in self.values)

    def names(self, outputs: Collection[str]) -> tuple[str, ...]:
        """Names of the paths in the table, in which an output is the number at any time, not the initial one; so are
        coordinates and rates of joints.
        """
        moving = re.compile(r"joints\..*\.(coordinate|rate)[\[\]\d]*")
        return tuple(f"initial.{path}" if path in outputs or moving.fullmatch(path) else path for path in self.paths)

    @property
    def members(self) -> Array:
        """(members, paths), the last path varying fastest."""
        if self.paired:
            return np.column_stack(self.values)
        return np.stack(np.meshgrid(*self.values, indexing="ij"), axis=-1).reshape(-1, len(self.paths))
