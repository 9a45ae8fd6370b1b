"""The relation of a system, as a value that composes.

A system means a relation between the rates ξ̇ of its states, its outer flows and its outer efforts, over its base:
the states of its storages and of all its outer ports. Over a point of the base (with the arguments of the Onsager
matrices M(x, e) held fixed) the relation is an affine subspace; a coordinate that is constantly one makes it linear.
Composition is total: nothing is refused here.

Two routes give the relation of a composite. The nested one composes the relations of the parts level by level, their
bases included; the flat one takes the base from the flattened pattern and eliminates all unknowns at once. They share
no code but the primitives and the closure of an equivalence.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol, TypeAlias, final

import numpy as np

from ephs.operad import ROOT, Algebra, Directory, Interface, Path, Pattern
from ephs.semantics.bundle import Array, Reference
from ephs.semantics.errors import AssemblyError, SemanticsError, listed
from ephs.semantics.primitives import Primitive, Storage
from ephs.semantics.relations.base import BasePoint, StateClass, Values, component_classes, glued_classes, place
from ephs.semantics.relations.flat import Flat, flat_classes
from ephs.semantics.relations.linear import LinearRelation, component_relation, compose_linear, power_ports
from ephs.semantics.system import Filling, as_system, fold, require_fillings

Route: TypeAlias = Literal["flat", "nested"]


class Fibre(Protocol):
    """Subspace over a point of the base."""

    def leaves(self) -> Iterator[tuple[Path, Primitive]]:
        """The primitives with their full paths."""
        ...

    def at(self, path: Path, point: BasePoint) -> LinearRelation:
        """The subspace over a point, for the part at this path of the point's system."""
        ...


@final
@dataclass(frozen=True, slots=True)
class Relation:
    """The relation of a system; every composite has one, even if it cannot be simulated.

    `at` returns the subspace over a point of the base. A relation can fill the box of a pattern, together with systems,
    primitives or other relations; the result is the relation of the whole. Relations are equal if they are constructed
    equally; `LinearRelation.distance` compares their meaning at a point.

    Parameters
    ----------
    interface
        The outer ports.
    classes
        The states of the base, sorted by name: which outer ports and components share each.
    reference
        The environment to which efforts of entropy and volume are relative.
    fibre
        How the subspace over a point of the base is found: by either route, or glued of the parts' fibres.
    """

    interface: Interface
    classes: tuple[StateClass, ...]
    reference: Reference
    fibre: Fibre = field(repr=False)

    @property
    def algebra(self) -> "Algebra[Relation | Filling]":
        """The algebra of a relation; systems and primitives are converted to their relations."""
        from ephs.semantics.algebra import relations

        return relations

    def at(
        self,
        state: Values | None = None,
        ports: Values | None = None,
        *,
        efforts: Values | None = None,
    ) -> LinearRelation:
        """The fibre over a point of the base; empty where values of one state differ.

        Parameters
        ----------
        state
            Values by path of a storage's port; also of a port that reads a state which nobody stores.
        ports
            Values of states at outer ports, power and state.
        efforts
            Arguments e of the Onsager matrices by the component's path, (n,) each; zero where not given, which is
            right for matrices that do not depend on efforts, and for entropy ports at the reference temperature.

        Notes
        -----
        A state takes the value that is given for any of its ports, and is at the identity where none is.

        Raises
        ------
        AssemblyError
            An unknown path, a wrong shape, or a number that is not finite.
        """
        components = dict(self.fibre.leaves())
        at = _efforts(components, efforts or {})
        states, contradiction = place(self.classes, state or {}, ports or {})
        if contradiction:
            rates = sorted((path, each.quantity.space.dim) for each in self.classes for path in each.stores)
            return LinearRelation.nothing(tuple(rates), power_ports(self.interface), contradiction)
        unit = 1.0
        for path, primitive in components.items():
            if isinstance(primitive, Storage):
                point = {port: states[path / port] for port in primitive.reads}
                effort = primitive.effort(point, self.reference)
                unit = max(unit, float(np.abs(effort).max(initial=0.0)))
        return self.fibre.at(ROOT, BasePoint(states, at, self.reference, unit))

    def compose(self, pattern: Pattern, fillings: Mapping[Path, object]) -> "Relation":
        """Fill the boxes of a pattern with relations, systems and primitives; the latter mean their relations.

        Raises
        ------
        SemanticsError
            A box without filling, a filling without box, an interface that does not match, or relations to other
            reference environments.
        """
        parts: dict[Path, Relation] = {}
        for box, filling in fillings.items():
            if isinstance(filling, Relation):
                if filling.reference != self.reference:
                    raise SemanticsError("references", box, found=filling.reference, expected=self.reference)
                parts[box] = filling
            elif isinstance(filling, Filling):
                parts[box] = relation_of(filling, self.reference, "nested")
            else:
                raise TypeError(
                    f"{box}: a filling is a System, a primitive or a Relation, found {type(filling).__name__}"
                )
        require_fillings(pattern, parts)
        return _glued(pattern, parts, self.reference)


def relation_of(filling: Filling, reference: Reference, route: Route) -> Relation:
    """The relation of a system or primitive."""
    if route == "flat":
        flat = as_system(filling).flatten()
        return Relation(filling.interface, flat_classes(flat), reference, Flat(flat))

    def leaf(_path: Path, primitive: Primitive) -> Relation:
        return Relation(primitive.interface, component_classes(primitive), reference, _Component(primitive))

    return fold(filling, leaf, lambda pattern, parts: _glued(pattern, parts, reference))


def _glued(pattern: Pattern, parts: Mapping[Path, Relation], reference: Reference) -> Relation:
    classes = glued_classes(pattern, {box: part.classes for box, part in parts.items()})
    fibres = Directory.trusted({box: part.fibre for box, part in parts.items()})
    return Relation(pattern.interface, classes, reference, _Glued(pattern, fibres))


@final
@dataclass(frozen=True, slots=True)
class _Component:
    primitive: Primitive

    def leaves(self) -> Iterator[tuple[Path, Primitive]]:
        yield ROOT, self.primitive

    def at(self, path: Path, point: BasePoint) -> LinearRelation:
        return component_relation(self.primitive, path, point)


@final
@dataclass(frozen=True, slots=True)
class _Glued:
    pattern: Pattern
    parts: Directory[Fibre]

    def leaves(self) -> Iterator[tuple[Path, Primitive]]:
        for box, part in self.parts.items():
            for path, primitive in part.leaves():
                yield box / path, primitive

    def at(self, path: Path, point: BasePoint) -> LinearRelation:
        return compose_linear(self.pattern, {box: part.at(path / box, point) for box, part in self.parts.items()})


def _efforts(components: Mapping[Path, Primitive], values: Values) -> dict[Path, Array]:
    """The given efforts by component, (n,) each."""
    found: dict[Path, Array] = {}
    for name, value in values.items():
        path = Path.of(name)
        if path not in components:
            raise AssemblyError("unknown-component", path, expected=listed(path, sorted(map(str, components))))
        shape = (components[path].bundle.size,)
        try:
            array = np.atleast_1d(np.asarray(value, dtype=float))
        except (TypeError, ValueError):
            array = np.array(np.nan)
        if array.shape != shape or not np.all(np.isfinite(array)):
            raise AssemblyError("efforts", path, found=value, expected=shape)
        found[path] = array
    return found
