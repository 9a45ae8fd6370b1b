"""Systems: the free algebra on the primitives. A map out of it is a value for each primitive."""

from collections.abc import Callable, Mapping
from typing import TypeVar

from ephs.operad import Algebra, AlgebraMap, Directory, Path, Pattern
from ephs.semantics.algebra.interfaces import interface_of
from ephs.semantics.primitives.primitives import Primitive
from ephs.semantics.systems.system import Filling, System, as_system

T = TypeVar("T")


def _fill(pattern: Pattern, parts: Mapping[Path, Filling]) -> Filling:
    return System(pattern, Directory(parts))


def _flat(element: Filling) -> System:
    return as_system(element).flatten()


def _equal(left: Filling, right: Filling) -> bool:
    one, other = _flat(left), _flat(right)
    return one.fillings == other.fillings and _unnamed(one.pattern) == _unnamed(other.pattern)


def _unnamed(pattern: Pattern) -> object:
    """The normal form; inner junctions are identified by their ports instead of their names."""
    form = pattern.normal_form
    known = {path: (path if junction.exposed else None, junction) for path, junction in form.junctions.items()}
    classes = {
        (each.quantity, frozenset(known[path] for path in each.members), each.outer, each.ports)
        for each in form.classes
    }
    return form.boxes, frozenset(known.values()), frozenset(classes)


def _rename(element: Filling, names: Mapping[Path, Path]) -> Filling:
    flat = _flat(element)
    inner = [path for path, junction in flat.pattern.junctions.items() if not junction.exposed]
    pattern = flat.pattern.rename(
        boxes={box: box.moved(names) for box in flat.pattern.boxes},
        junctions={path: path.moved(names) for path in inner},
    )
    return System(pattern, Directory([(box.moved(names), filling) for box, filling in flat.fillings.items()]))


systems: Algebra[Filling] = Algebra("systems", interface_of(Filling), _fill, _equal, _rename)
"""Systems and primitives, equal if they are after flattening, up to names of junctions inside.

A primitive is the one box of an identity.
"""

flattening: AlgebraMap[Filling, Filling] = AlgebraMap(
    systems,
    Algebra(
        "flat systems",
        interface_of(Filling),
        lambda pattern, parts: as_system(_fill(pattern, parts)).flatten(),
        rename=_rename,
    ),
    lambda element: as_system(element).flatten(),
    "flattening",
)
"""From systems to those of one level, which compose by substitution."""


def meaning(target: Algebra[T], value: Callable[[Path, Primitive], T], name: str = "") -> AlgebraMap[Filling, T]:
    """The map of algebras out of systems that gives primitives these values.

    Parameters
    ----------
    value
        Called with the full path of each primitive and the primitive.
    """

    def component(element: Filling) -> T:
        system = as_system(element)
        return system.nesting.fold(target, {path: value(path, leaf) for path, leaf in system.leaves()})

    return AlgebraMap(systems, target, component, name)
