"""Positions of the joints of a mechanism in its vectors."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from types import MappingProxyType
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from ephs.mechanics.tree.finding.mechanism import Edge, Reduced
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import listed
from ephs.semantics.systems.kept import once
from ephs.solve.equations.heats import PLAIN
from ephs.solve.equations.sparse import Index
from ephs.solve.posing.errors import OptionError


@final
@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """Positions of the joints in the vectors of a mechanism.

    Parameters
    ----------
    joints
        Names of all joints but spans, those of the tree first, in the order of the vectors. A body, or a group of
        bodies, that no joint holds moves with a free joint of its (first) body's name.
    freedoms
        Joint -> (d,) places of its degrees of freedom: in vectors of the tree's n degrees of freedom where below n, and
        from there on those of cut joints.
    elements
        Joint -> places of its element in a state's array.
    entropies
        Paths of the entropies.
    n, total
        How many degrees of freedom the tree has, and all joints together.
    edges
        Joint -> numbers of its edges, and these.
    paths
        State of the system that is a joint's element -> where that starts and ends in a state's array.
    elements_end
        How many numbers the elements take.
    attached
        Places among the entropies of what are states of attachments.
    """

    joints: tuple[str, ...]
    freedoms: Mapping[str, Index]
    elements: Mapping[str, Index]
    entropies: tuple[Path, ...]
    n: int
    total: int
    edges: Mapping[str, tuple[tuple[int, Edge], ...]]
    paths: Mapping[Path, slice]
    elements_end: int
    attached: frozenset[int]

    @staticmethod
    def of(reduced: Reduced) -> "Layout":
        """The layout of a system in joint coordinates, made once."""
        return once(reduced, "layout", lambda: Layout._made(reduced))

    @staticmethod
    def _made(reduced: Reduced) -> "Layout":
        t = reduced.tables
        taken = {edge.name for edge in reduced.edges if edge.name}
        edges: dict[str, list[tuple[int, Edge]]] = {}
        for i, edge in enumerate(reduced.joints):
            if i not in reduced.spans:
                edges.setdefault(edge.name or _free_name(reduced, i, taken), []).append((i, edge))
        for parts in edges.values():
            parts.sort(key=lambda part: part[1].freedoms.start)

        def places(at: Index, size: Index, parts: list[tuple[int, Edge]]) -> Index:
            return np.concatenate([np.arange(at[i], at[i] + size[i]) for i, _ in parts]).astype(np.int64)

        return Layout(
            tuple(edges),
            MappingProxyType({name: places(t.r_at, t.dim, parts) for name, parts in edges.items()}),
            MappingProxyType({name: places(t.q_at, t.q_size, parts) for name, parts in edges.items()}),
            reduced.entropies,
            reduced.freedoms,
            int(t.dim[: len(reduced.joints)].sum()),
            MappingProxyType({name: tuple(parts) for name, parts in edges.items()}),
            MappingProxyType(
                {
                    edge.state: slice(int(t.q_at[i]), int(t.q_at[i] + t.q_size[i]))
                    for i, edge in enumerate(reduced.joints)
                    if edge.path is not None and edge.state is not None
                }
            ),
            reduced.coordinates,
            frozenset(np.flatnonzero(t.node == PLAIN).tolist()),
        )

    def vector(self, what: str, values: "Mapping[str, ArrayLike] | ArrayLike") -> Array:
        """(total,) from joint -> (d,), a number where there is one degree of freedom; zero for joints that are not
        named.

        Or from an array (n,) of all joints of the tree, or (total,).

        Raises
        ------
        OptionError
            A joint is not known, or its value has another length or is not finite.
        """
        out = np.zeros(self.total)
        if not isinstance(values, Mapping):
            given = np.asarray(values, dtype=float)
            if given.shape not in ((self.n,), (self.total,)) or not np.isfinite(given).all():
                raise OptionError(what, values, f"{self.n} finite numbers, or such by joint")
            out[: given.size] = given
            return out
        for name, value in values.items():
            if name not in self.freedoms:
                raise OptionError(f"{what}[{name!r}]", value, f"a joint: {listed(name, self.joints)}")
            where = self.freedoms[name]
            if type(value) is float and where.size == 1 and isfinite(value):  # in the loops of controllers
                out[where[0]] = value
                continue
            array = np.atleast_1d(np.asarray(value, dtype=float))
            if array.shape != where.shape or not np.isfinite(array).all():
                raise OptionError(f"{what}[{name!r}]", value, f"{where.size} finite numbers")
            out[where] = array
        return out

    def named(self, what: str, values: "Mapping[str, ArrayLike] | ArrayLike | None") -> "Mapping[str, ArrayLike]":
        """Joint -> (d,) of what `vector` takes.

        Raises
        ------
        OptionError
            An array has another length, or is not finite.
        """
        if values is None or isinstance(values, Mapping):
            return values or {}
        found = self.by_joint(self.vector(what, values))
        return {name: found[name] for name, where in self.freedoms.items() if where.max(initial=-1) < self.n}

    def by_joint(self, values: Array) -> dict[str, Array]:
        """Joint -> (d,) of a vector (total,), or of one (n,) with zeros for cut joints."""
        whole = np.concatenate([values, np.zeros(self.total - values.size)])
        return {name: whole[where] for name, where in self.freedoms.items()}

    def coordinates(self, q: Array) -> dict[str, Array]:
        """Joint -> (d,) coordinates of the elements at the start of a state's array."""
        out: dict[str, Array] = {}
        for name, parts in self.edges.items():
            sizes = np.cumsum([edge.pair.size for _, edge in parts])[:-1]
            elements = np.split(q[self.elements[name]], sizes)
            out[name] = np.concatenate([edge.pair.coordinates(x) for (_, edge), x in zip(parts, elements, strict=True)])
        return out

    def split(self, array: Array) -> tuple[Array, Array, Array]:
        """(q, r, s) of a state's array."""
        first = self.elements_end
        return array[:first].copy(), array[first : first + self.n].copy(), array[first + self.n :].copy()


def _free_name(reduced: Reduced, edge: int, taken: set[str]) -> str:
    body = str(reduced.bodies[edge])
    return f"free.{body}" if body in taken else body
