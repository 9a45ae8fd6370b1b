"""Sources of the motions of bodies and joints: poses, twists, rates and wrenches, by name or by path."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, final

from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array


class Moving(Protocol):
    """Source of the motion of bodies and joints."""

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


class ByPath(Protocol):
    """The motion of links and joints by the paths of their boxes."""

    @property
    def twists(self) -> Mapping[Path, Array]:
        """Path of a body -> (n, 6) in its frame; rad/s, m/s."""
        ...

    def rate(self, joint: Path) -> Array:
        """(n, d) of a joint, in the axes of C2."""
        ...

    def wrench(self, joint: Path) -> Array:
        """(n, 6) of a joint: λ on body 2 in C2, NaN in components that are indeterminate."""
        ...

    def pressed(self, point: Path) -> tuple[Array, list[Array]]:
        """(n, 3) force of the point of a hard contact with this box on the second body, in world axes; and at each
        instant (3, m) its share of those that balance each other."""
        ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class BoxMotion:
    """The motion of a box of a system, by the paths within it."""

    whole: ByPath
    box: Path

    @property
    def twists(self) -> Mapping[Path, Array]:
        """Path of a body -> (n, 6) in its frame; rad/s, m/s."""
        box = tuple(self.box)
        return {
            Path.of(tuple(path)[len(box) :]): twist
            for path, twist in self.whole.twists.items()
            if tuple(path)[: len(box)] == box
        }

    def rate(self, joint: Path) -> Array:
        """(n, d) of a joint, in the axes of C2."""
        return self.whole.rate(self.box / joint)

    def wrench(self, joint: Path) -> Array:
        """(n, 6) of a joint: λ on body 2 in C2, NaN in components that are indeterminate."""
        return self.whole.wrench(self.box / joint)

    def pressed(self, point: Path) -> tuple[Array, list[Array]]:
        """Force of the point of a hard contact with this box on the second body, and what of it is indeterminate."""
        return self.whole.pressed(self.box / point)
