"""What the motions of bodies and joints are read from: poses, twists, rates and wrenches by name."""

from collections.abc import Mapping
from typing import Protocol

from ephs.semantics.bundle import Array

__all__ = ["Moving"]


class Moving(Protocol):
    """Where bodies and joints read their motion."""

    @property
    def twists(self) -> Mapping[str, Array]:
        """(n, 6) by body."""
        ...

    @property
    def rates(self) -> Mapping[str, Array]:
        """(n, d) by joint."""
        ...

    def poses(self, name: str) -> Array:
        """(n, 7) of a body."""
        ...

    def wrench(self, name: str) -> Array:
        """(n, 6) of a joint."""
        ...
