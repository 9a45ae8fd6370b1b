"""The algebra of relations over their base, the physical semantics of systems, and the map from systems to it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from ephs.operad import Algebra, AlgebraMap, Directory, Path, Pattern, PortType
from ephs.operad.matching import interfaces_match
from ephs.semantics.algebra.free import systems
from ephs.semantics.algebra.interfaces import interface_of
from ephs.semantics.bundles.bundle import Array, Bundle, Reference
from ephs.semantics.meaning import Relation, relation_of
from ephs.semantics.meaning.relation import Renamed
from ephs.semantics.primitives.primitives import Irreversible
from ephs.semantics.systems.system import Filling
from ephs.semantics.verdicts.checks import random_point

Meaning: TypeAlias = Relation | Filling
"""A relation, or a system or primitive in place of its relation."""
Values: TypeAlias = dict[Path, Array]
SAMPLES = 3
"""Points of the base at which two relations are compared."""


def relation_for(element: Meaning) -> Relation:
    """The relation of an element at the default reference."""
    return element if isinstance(element, Relation) else relation_of(element, Reference(), "nested")


def _compose(pattern: Pattern, parts: Mapping[Path, Meaning]) -> Meaning:
    known = [part for part in parts.values() if isinstance(part, Relation)]
    return (known or [relation_for(Pattern({}, {})())])[0].compose(pattern, parts)


def _equal(left: Meaning, right: Meaning) -> bool:
    """Same ports and base, and at points of it the same subspace, to the error bounds."""
    one, other = relation_for(left), relation_for(right)
    if not interfaces_match(one.interface, other.interface) or one.reference != other.reference:
        return False
    if one.classes != other.classes or _arguments(one) != _arguments(other):
        return False
    rng = np.random.default_rng(0)
    for _ in range(SAMPLES):
        state, ports = _sample(one, rng)
        # temperatures stay above zero
        efforts = {path: rng.uniform(-1.0, 1.0, size) for path, size in _arguments(one)}
        found, expected = (each.at(state, ports, efforts=efforts) for each in (one, other))
        if not found.same(expected):
            return False
    return True


def _sample(relation: Relation, rng: np.random.Generator) -> tuple[Values, Values]:
    """Random values of states inside, and of states at outer ports only."""
    state: Values = {}
    ports: Values = {}
    for each in relation.classes:
        layout = Bundle.of(Directory({each.name: PortType(each.quantity)}))
        value = random_point(layout, (each.name,), rng)[each.name]
        (state if each.stores or each.readers else ports)[each.name] = value
    return state, ports


def _arguments(relation: Relation) -> list[tuple[Path, int]]:
    """The components whose structure depends on efforts, and on how many."""
    leaves = relation.fibre.leaves()
    return sorted((path, leaf.bundle.size) for path, leaf in leaves if isinstance(leaf, Irreversible))


def _rename(element: Meaning, names: Mapping[Path, Path]) -> Meaning:
    relation = relation_for(element)

    def moved(paths: tuple[Path, ...]) -> tuple[Path, ...]:
        return tuple(sorted(path.moved(names) for path in paths))

    classes = (replace(each, stores=moved(each.stores), readers=moved(each.readers)) for each in relation.classes)
    fibre = Renamed(relation, Directory.trusted(dict(names)))
    return replace(relation, classes=tuple(sorted(classes, key=lambda each: each.name)), fibre=fibre)


relations: Algebra[Meaning] = Algebra("relations", interface_of(Meaning), _compose, _equal, _rename)
"""Relations over their base; equal if their bases agree, and their fibres at sampled points."""


def meaning_of_systems(reference: Reference | None = None) -> AlgebraMap[Filling, Meaning]:
    """The map from systems to their relations, which flattens first."""
    at = reference or Reference()
    return AlgebraMap(systems, relations, lambda element: relation_of(element, at, "flat"), "meaning")
