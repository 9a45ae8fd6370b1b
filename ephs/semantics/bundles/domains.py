"""Declared domains of primitives: bounds of their states and efforts."""

from collections.abc import Callable, Mapping
from typing import TypeVar

from ephs.operad import Interface, Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.bundles.errors import StructureError
from ephs.semantics.primitives.primitives import Domain, Point
from ephs.semantics.spaces import codes, manifold

Bounds = Mapping[str, tuple[float, float]]
"""Port name -> (least, greatest) number."""
T = TypeVar("T")


def domain_of(name: str, interface: Interface, domain: Bounds | None) -> Domain:
    """The bounds by port.

    Raises
    ------
    StructureError
        There is no such port, its states are no vectors, or nothing lies between its bounds.
    """
    out: list[tuple[Path, float, float]] = []
    for port, (low, high) in (domain or {}).items():
        path, key = Path.of(port), f"domain of {port}"
        if path not in interface:
            raise StructureError("parameter", name, key=key, found=port, expected=", ".join(map(str, interface)))
        if manifold(interface[path].quantity.space).code != codes.VECTOR:
            raise StructureError("parameter", name, key=key, found=(low, high), expected="none: it is no vector")
        if not low < high:
            raise StructureError("parameter", name, key=key, found=(low, high), expected="two numbers, least first")
        out.append((path, float(low), float(high)))
    return tuple(out)


def within_domain(domain: Domain, values: Mapping[Path, Array]) -> bool:
    """Whether the values at all ports of the domain lie in it."""
    return all(low < values[port].min() and values[port].max() < high for port, low, high in domain)


def bounded(function: Callable[[Point], T], domain: Domain, outside: T) -> Callable[[Point], T]:
    """The function where the states are in the domain, else NaN."""
    return lambda x: function(x) if within_domain(domain, x) else outside
