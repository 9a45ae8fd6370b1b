"""Algebras of the operad of patterns, and maps between them.

An algebra A has for each interface I a set A(I), for each pattern f from the interfaces of its boxes to I a function
f_A from elements at the boxes to an element of A(I), such that identities do nothing and substitution is composition
of functions. Systems are one, their relations another; `ephs.operad.laws.ALGEBRA_LAWS` says what holds of all.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from operator import eq
from typing import Any, Generic, Protocol, TypeVar, cast, final

from ephs.operad.errors import PatternError
from ephs.operad.frames import in_frames_of
from ephs.operad.matching import require_interface
from ephs.operad.names import ROOT, Path, paths_text
from ephs.operad.nesting import Nesting
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import Interface

S = TypeVar("S")
T = TypeVar("T")


def _without_names(element: Any, names: Mapping[Path, Path]) -> Any:
    return element


@final
@dataclass(frozen=True, slots=True)
class Lax(Generic[T]):
    """An order on elements, for algebras whose elements enclose exact ones, such as intervals.

    The result then depends on how the patterns are bracketed; by every bracketing it encloses the exact result.

    Parameters
    ----------
    below
        Whether the first element is enclosed by the second.
    points
        Exact elements that an element encloses, equally many of each.
    """

    below: Callable[[T, T], bool]
    points: Callable[[T], tuple[T, ...]]


@final
@dataclass(frozen=True, slots=True)
class Algebra(Generic[T]):
    """An algebra of the operad of patterns.

    Parameters
    ----------
    name
        For people; unique among the algebras that are mixed.
    interface_of
        The interface of an element; None of what is no element.
    compose
        f_A: called with a pattern and an element for each box, in the order of the boxes, whose interfaces fit.
        Gives an element of the pattern's interface. `Pattern.apply` calls it.
    equal
        When two elements are the same: equality of data where not given. A function may allow for rounding.
    rename
        How the names of boxes act on names inside an element, such as those of its states: called with the element
        and old prefix -> new prefix. Not needed where nothing inside has names.
    lax
        The order by which the laws hold as inclusions; None where they hold as equations.

    Examples
    --------
    The number of boxes, level by level:

    >>> from dataclasses import dataclass
    >>> from ephs.operad import Interface, Nesting
    >>> @dataclass(frozen=True)
    ... class Boxes:
    ...     interface: Interface
    ...     count: int = 1
    >>> boxes = Algebra(
    ...     "boxes",
    ...     lambda element: element.interface if isinstance(element, Boxes) else None,
    ...     lambda pattern, parts: Boxes(pattern.interface, sum(part.count for part in parts.values())),
    ... )
    >>> pair = Pattern.from_text("p: momentum, exposed; l(p); r(p)")
    >>> nesting = Nesting(pair, {"l": pair})
    >>> leaves = {box: Boxes(content.interface) for box, content in nesting.flatten().boxes.items()}
    >>> nesting.fold(boxes, leaves).count
    3
    """

    name: str
    interface_of: Callable[[object], Interface | None]
    compose: Callable[[Pattern, Mapping[Path, T]], T]
    equal: Callable[[T, T], bool] = eq
    rename: Callable[[T, Mapping[Path, Path]], T] = _without_names
    lax: Lax[T] | None = None

    def __repr__(self) -> str:
        return self.name

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:  # pyright: ignore[reportUnusedFunction] - as in Pattern
        printer.text(self.name)


@final
@dataclass(frozen=True, slots=True)
class AlgebraMap(Generic[S, T]):
    """A family of functions α_I: A(I) → B(I), natural: α(f_A(s)) = f_B(α(s)) for every pattern f.

    Parameters
    ----------
    source, target
        A and B.
    component
        α, the same function for all interfaces; it keeps the interface.
    name
        For people.
    """

    source: Algebra[S]
    target: Algebra[T]
    component: Callable[[S], T]
    name: str = ""

    def __call__(self, element: S) -> T:
        """The image of an element.

        Raises
        ------
        PatternError
            It is none of the source.
        """
        if self.source.interface_of(element) is None:
            raise PatternError("foreign", box=ROOT, found=type(element).__name__, expected=self.source.name)
        return self.component(element)

    def then(self, after: "AlgebraMap[T, Any]") -> "AlgebraMap[S, Any]":
        """This map, then another."""
        name = f"{self.name}, then {after.name}"
        return AlgebraMap(self.source, after.target, lambda element: after.component(self.component(element)), name)

    def __repr__(self) -> str:
        return self.name or f"AlgebraMap({self.source}, {self.target})"


class Composable(Protocol):
    """Composable of a box when a pattern is called: it names its algebra."""

    @property
    def algebra(self) -> Algebra[Any]:
        """The algebra that composes it with its like."""
        ...


def apply(algebra: Algebra[T], pattern: Pattern, elements: Mapping[Path, T], at: Path = ROOT) -> T:
    """f_A of an element for each box; see `Pattern.apply`. Errors name boxes below the path ``at``."""
    if elements.keys() != pattern.boxes.keys():
        wrong = min(elements.keys() ^ pattern.boxes.keys())
        found, expected = paths_text(elements), paths_text(pattern.boxes)
        raise PatternError("fillings", box=at / wrong, found=found, expected=expected)
    given_by: dict[Path, Interface] = {}
    for box, content in pattern.boxes.items():
        given = algebra.interface_of(elements[box])
        if given is None:
            raise PatternError("foreign", box=at / box, found=type(elements[box]).__name__, expected=algebra.name)
        require_interface(at / box, content.interface, given)
        given_by[box] = given
    pattern = in_frames_of(pattern, given_by)
    return algebra.compose(pattern, {box: elements[box] for box in pattern.boxes})


def call(pattern: Pattern, elements: Mapping[Path, object]) -> Any:
    """Fill the boxes in the algebra of the elements; see `Pattern.__call__`."""
    known: dict[Algebra[Any], Path] = {}
    for box, element in elements.items():
        algebra = cast("object", getattr(element, "algebra", None))
        if not isinstance(algebra, Algebra):
            raise PatternError("not-an-element", box=box, found=type(element).__name__, expected="an element")
        known.setdefault(cast("Algebra[Any]", algebra), box)
    if not known:
        from ephs.semantics.algebra import systems

        return apply(systems, pattern, {})
    for algebra in known:
        if all(algebra.interface_of(element) is not None for element in elements.values()):
            return apply(algebra, pattern, elements)
    found = ", ".join(f"{algebra.name} in {box}" for algebra, box in sorted(known.items(), key=lambda item: item[1]))
    raise PatternError("mixed", box=min(known.values()), found=found, expected="elements of one algebra")


@final
@dataclass(slots=True)
class _TraversalLevel:
    """State of the traversal of a nesting: its path, the boxes not yet visited, and the results of the others."""

    path: Path
    box: Path
    nesting: Nesting
    boxes: Iterator[Path]
    parts: dict[Path, Any] = field(default_factory=dict[Path, Any])


def fold(algebra: Algebra[T], nesting: Nesting, leaves: Mapping[Path, T]) -> T:
    """The value of a tree of patterns; see `Nesting.fold`."""
    left = dict(leaves)
    # A list, as recursion would bound the depth.
    levels = [_TraversalLevel(ROOT, ROOT, nesting, iter(nesting.pattern.boxes))]
    while True:
        level = levels[-1]
        for box in level.boxes:
            child, path = level.nesting.children.get(box), level.path / box
            if child is not None:
                levels.append(_TraversalLevel(path, box, child, iter(child.pattern.boxes)))
                break
            if path not in left:
                raise PatternError("fillings", box=path, found=paths_text(leaves), expected=_open(nesting))
            level.parts[box] = left.pop(path)
        else:
            levels.pop()
            value = apply(algebra, level.nesting.pattern, level.parts, level.path)
            if levels:
                levels[-1].parts[level.box] = value
                continue
            if left:
                raise PatternError("fillings", box=min(left), found=paths_text(leaves), expected=_open(nesting))
            return value


def _open(nesting: Nesting) -> str:
    return paths_text(nesting.flatten().boxes)
