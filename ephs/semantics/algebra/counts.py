"""Costs: the size of a system's equations, counted level by level without flattening."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

from ephs.operad import Algebra, AlgebraMap, Interface, Path, Pattern
from ephs.semantics.algebra.free import meaning
from ephs.semantics.algebra.interfaces import interface_of
from ephs.semantics.primitives.primitives import Primitive, Storage
from ephs.semantics.systems.system import Filling


@final
@dataclass(frozen=True, slots=True)
class Cost:
    """Size of a part.

    Parameters
    ----------
    interface
        The outer ports.
    carried
        The outer power ports on which a component's power port lies inside; the flow of any other is zero.
    components
        Primitives.
    rates
        Dimensions of the states that are stored.
    balances
        Dimensions of the junctions inside on which flows add up to zero, and which have an effort each.
    """

    interface: Interface
    carried: frozenset[Path]
    components: int
    rates: int
    balances: int

    @staticmethod
    def of(primitive: Primitive) -> "Cost":
        """The cost of a primitive."""
        rates = primitive.bundle.size if isinstance(primitive, Storage) else 0
        return Cost(primitive.interface, frozenset(primitive.bundle.ports), 1, rates, 0)


def _compose(pattern: Pattern, parts: Mapping[Path, Cost]) -> Cost:
    carried = {pattern.boxes[box].ports[port].junction for box, part in parts.items() for port in part.carried}
    outer = {path for path, of in pattern.interface.items() if of.power}
    closed = carried - outer
    return Cost(
        pattern.interface,
        frozenset(carried & outer),
        sum(part.components for part in parts.values()),
        sum(part.rates for part in parts.values()),
        sum(part.balances for part in parts.values())
        + sum(pattern.junctions[path].quantity.space.dim for path in closed),
    )


cost: Algebra[Cost] = Algebra("cost", interface_of(Cost), _compose)
"""Counts of components, rates and balances."""

counting: AlgebraMap[Filling, Cost] = meaning(cost, lambda _path, primitive: Cost.of(primitive), "counting")
"""The cost of a system."""
