"""Disjoint sets that are joined step by step (union–find)."""

from collections.abc import Hashable, Iterable, Iterator
from typing import Generic, TypeVar, final

Element = TypeVar("Element", bound=Hashable)


@final
class DisjointSets(Generic[Element]):
    """Sets of elements; each set has a leader, and an element that is met first is a set of its own."""

    __slots__ = ("_above",)

    def __init__(self) -> None:
        self._above: dict[Element, Element] = {}

    def __iter__(self) -> Iterator[Element]:
        return iter(tuple(self._above))

    def leader(self, element: Element) -> Element:
        """The leader of an element's set."""
        above = self._above
        while above.setdefault(element, element) != element:
            above[element] = above[above[element]]
            element = above[element]
        return element

    def leaders(self, elements: Iterable[Element]) -> list[Element]:
        """The leader of each element's set."""
        return [self.leader(element) for element in elements]

    def join(self, first: Element, second: Element) -> bool:
        """Join two elements' sets under the first one's leader; False where they are one set already."""
        one, two = self.leader(first), self.leader(second)
        self._above[two] = one
        return one != two
