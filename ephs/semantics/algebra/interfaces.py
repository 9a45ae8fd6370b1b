"""Interfaces of elements: how an algebra knows its own."""

from collections.abc import Callable
from typing import Any

from ephs.operad import Interface


def interface_of(*kinds: Any) -> Callable[[object], Interface | None]:
    """The function that gives the interface of an element of these kinds, and None of anything else."""

    def interface(element: Any) -> Interface | None:
        return element.interface if isinstance(element, kinds) else None

    return interface
