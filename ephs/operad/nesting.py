"""Nestings: trees of patterns with matching interfaces; equal subtrees are shared until flattening."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar, cast, final

from ephs.operad.collector import paused_collector
from ephs.operad.directory import Directory, Entries
from ephs.operad.errors import PatternError
from ephs.operad.names import Path, paths_text
from ephs.operad.pattern import Pattern

if TYPE_CHECKING:
    from ephs.operad.algebra import Algebra

T = TypeVar("T")


@final
@dataclass(frozen=True, slots=True, init=False)
class Nesting:
    """A pattern, and in some of its boxes nestings again.

    Nothing is copied: one nesting may fill many boxes, so a chain of 10⁵ bodies takes the room of one body and one
    chain until it is flattened.

    Parameters
    ----------
    pattern
        The outermost level.
    children
        Box name -> nesting, or pattern; a box that is not mentioned stays open.

    Raises
    ------
    PatternError
        For a box that there is not, or a child that is neither nesting nor pattern. Interfaces are compared when
        it is flattened.

    Examples
    --------
    >>> from ephs.operad import junction, quantity
    >>> pair = Pattern({"p": junction(quantity.momentum, exposed=True)}, {"l": {"p": "p"}, "r": {"p": "p"}})
    >>> two = Nesting(pair, {"l": pair, "r": pair})
    >>> sorted(str(box) for box in two.flatten().boxes)
    ['l.l', 'l.r', 'r.l', 'r.r']
    >>> two.depth, two.size
    (2, 4)
    """

    pattern: Pattern
    children: Directory["Nesting"]

    def __init__(self, pattern: Pattern, children: "Entries[Nesting | Pattern]" = ()) -> None:
        found: dict[Path, Nesting] = {}
        for box, child in cast("Directory[object]", Directory(children, what="children")).items():
            if box not in pattern.boxes:
                raise PatternError("unknown-box", box=box, found=str(box), expected=paths_text(pattern.boxes))
            if not isinstance(child, Nesting | Pattern):
                expected = "a Nesting or a Pattern"
                raise PatternError("filling-type", box=box, found=type(child).__name__, expected=expected)
            found[box] = child if isinstance(child, Nesting) else Nesting(child)
        object.__setattr__(self, "pattern", pattern)
        object.__setattr__(self, "children", Directory.trusted(found))

    @property
    def depth(self) -> int:
        """Number of levels."""
        return 1 + max((child.depth for child in self.children.values()), default=0)

    @property
    def size(self) -> int:
        """Number of boxes of the flat pattern."""
        return len(self.pattern.boxes) + sum(child.size - 1 for child in self.children.values())

    def flatten(self) -> Pattern:
        """All levels in one: every child substituted, in one pass, linear in the ports of the result.

        Raises
        ------
        PatternError
            If an interface does not match; the message names the box by its full path.
        """
        from ephs.operad.substitution import flatten

        with paused_collector():
            return flatten(self)

    def fold(self, algebra: "Algebra[T]", leaves: "Mapping[Path, T] | Mapping[str, T]") -> T:
        """The value in an algebra, level by level from the innermost patterns: fill, then compose.

        Equal to ``nesting.flatten().apply(algebra, leaves)``: flatten, then fill.

        Parameters
        ----------
        leaves
            An element for each open box, by its path in the whole.

        Raises
        ------
        PatternError
            An open box without element, an element without box, what is no element, or an interface that differs; it
            names the box by its path in the whole.
        """
        from ephs.operad.algebra import fold
        from ephs.operad.wellformed import read_fillings

        return fold(algebra, self, read_fillings(leaves, {}))

    def bottom_up(self) -> Pattern:
        """Flatten the children first, then substitute them; equal to `flatten`."""
        return self.pattern.substitute({box: child.bottom_up() for box, child in self.children.items()})

    def top_down(self) -> Pattern:
        """Substitute the children one after the other, then their children; equal to `flatten`."""
        result = self.pattern
        pending = list(self.children.items())
        while pending:
            box, child = pending.pop(0)
            result = result.substitute({box: child.pattern})
            pending += [(box / inner, grandchild) for inner, grandchild in child.children.items()]
        return result

    def __str__(self) -> str:
        lines = [str(self.pattern)]
        for box, child in self.children.items():
            lines.append(f"  in box {box}: " + str(child).replace("\n", "\n  "))
        return "\n".join(lines)

    def __repr__(self) -> str:
        children = ", ".join(f"{str(box)!r}: {child!r}" for box, child in self.children.items())
        return f"Nesting({self.pattern!r}{', {' + children + '}' if children else ''})"
