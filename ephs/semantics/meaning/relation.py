"""The relation of a system, as a value that composes.

A system means a relation between the rates of its states, its outer flows and its outer efforts, over its base: the
states of its storages and of all its outer ports. Over a point of the base (with the arguments of the Onsager matrices
M(x, e) held fixed) the relation is an affine subspace; a coordinate that is constantly one makes it linear. States have
one rate each, however many storages store them. Composition is total: nothing is refused here.

Both routes are one formula (`functor.glued`): the nested one at every level of the system, the flat one at the only
level of the flattened system.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias, final

import numpy as np

from ephs.operad import ROOT, Algebra, Directory, Interface, Path, Pattern
from ephs.operad.wellformed import read_fillings
from ephs.semantics.bundles.bundle import Array, Bundle, Reference
from ephs.semantics.bundles.errors import AssemblyError, SemanticsError, listed
from ephs.semantics.meaning.base import BasePoint, StateClass, Values, component_classes, glued_classes, names_of, place
from ephs.semantics.meaning.components import at_instant, at_ports, efforts_of
from ephs.semantics.meaning.fields import ROUNDED, Field, Rational, Rounded
from ephs.semantics.meaning.functor import glued, relation_of_pattern
from ephs.semantics.meaning.linear import LinearRelation
from ephs.semantics.meaning.posed import Answer, Fibre, Labelled, determined, possible
from ephs.semantics.meaning.variables import ONE, RelationVariable, into, own
from ephs.semantics.primitives.primitives import Primitive, Storage
from ephs.semantics.systems.fitting import require_fillings
from ephs.semantics.systems.system import Filling, as_system, fold

Route: TypeAlias = Literal["flat", "nested"]
Numbers: TypeAlias = Literal["float", "rational"]
Sizes: TypeAlias = "tuple[tuple[Path, int], ...]"
FIELDS: Mapping[str, Any] = {"float": Rounded, "rational": Rational}


@final
@dataclass(frozen=True, slots=True)
class Relation:
    """The relation of a system; every composite has one, even if it cannot be simulated.

    `at` returns the fibre over a point of the base. A relation can fill the box of a pattern, together with systems,
    primitives or other relations; the result is the relation of the whole. Relations are equal if they are constructed
    equally; `Instant.same` compares their meaning at a point.

    Parameters
    ----------
    interface
        The outer ports: power ports carry a flow and an effort, all of them the state that they share.
    classes
        The states of the base, sorted by name: which outer ports and components share each.
    reference
        The environment to which efforts of entropy and volume are relative.
    fibre
        How the relation over a point of the base is found: of one component, or glued of the parts' fibres.
    numbers
        ``"float"``, with error bounds; ``"rational"`` over ℚ, where all structure is constant: then the efforts of
        storages stay open.
    """

    interface: Interface
    classes: tuple[StateClass, ...]
    reference: Reference
    fibre: Fibre = field(repr=False)
    numbers: Numbers = "float"

    @property
    def algebra(self) -> "Algebra[Relation | Filling]":
        """The algebra of a relation; systems and primitives are converted to their relations."""
        from ephs.semantics.algebra import relations

        return relations

    def at(
        self,
        state: Values | None = None,
        ports: Values | None = None,
        efforts: Values | None = None,
    ) -> "Instant":
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
        SemanticsError
            The numbers are rational, and a component's structure is not constant; or it has no value at the state.
        """
        arguments = _efforts(dict(self.fibre.leaves()), efforts or {})
        states, contradiction = place(self.classes, state or {}, ports or {})
        numbers: Field[Any] = FIELDS[self.numbers]()
        names = names_of(self.classes)
        point = BasePoint(states, names, arguments, self.reference, numbers, storages=self.numbers == "float")
        found = Instant(self, point, contradiction)
        _ = found.linear  # what has no value says so here
        return found

    def compose(self, pattern: Pattern, fillings: Mapping[Path, object] | Mapping[str, object]) -> "Relation":
        """Fill the boxes of a pattern with relations, systems and primitives; the latter mean their relations.

        Raises
        ------
        SemanticsError
            A box without filling, a filling without box, an interface that does not match, or relations to other
            reference environments.
        """
        parts: dict[Path, Relation] = {}
        for box, filling in read_fillings(fillings, {}).items():
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
        return replace(_glued(pattern, parts, self.reference), numbers=self.numbers)


def relation_of(filling: Filling, reference: Reference, route: Route, numbers: Numbers = "float") -> Relation:
    """The relation of a system or primitive."""

    def leaf(_path: Path, primitive: Primitive) -> Relation:
        return Relation(primitive.interface, component_classes(primitive), reference, _Component(primitive))

    whole = as_system(filling).flatten() if route == "flat" else filling
    found = fold(whole, leaf, lambda pattern, parts: _glued(pattern, parts, reference))
    return replace(found, numbers=numbers)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Instant:
    """The relation of a system over a point of its base.

    Parameters
    ----------
    contradiction
        Which values of one state differ, where the point is none of the base; nothing satisfies the relation there.
    """

    relation: Relation
    point: BasePoint
    contradiction: str = ""
    _found: list[LinearRelation] = field(default_factory=list[LinearRelation], init=False, repr=False)

    @property
    def linear(self) -> LinearRelation:
        """Equations between rates, outer flows, outer efforts and the constant 1; computed once."""
        if not self._found:
            found = self._at(self.point).onto(self.order)
            variables = found.variables.union(self.order)
            equations = [{v: found.field.one} for v in variables] if self.contradiction else found.equations
            self._found.append(LinearRelation.of(found.field, variables, equations))
        return self._found[0]

    def _at(self, point: BasePoint) -> LinearRelation:
        return self.relation.fibre.at(ROOT, point)

    @property
    def rates(self) -> Sizes:
        """Names and dimensions of the states that are stored, sorted: each has one rate."""
        return tuple((each.name, each.quantity.space.dim) for each in self.relation.classes if each.stores)

    @property
    def ports(self) -> Sizes:
        """Names and dimensions of the outer power ports, sorted."""
        return tuple(sorted((port, q.space.dim) for port, _, q in Bundle.of(self.relation.interface).items()))

    @property
    def order(self) -> list[RelationVariable]:
        """All variables: rates by the names of states, flows, then efforts by port, the constant last."""
        out = [variable for name, dim in self.rates for variable in own("rate", name, dim)]
        bundle = Bundle.of(self.relation.interface)
        if not self.point.storages:
            for path, primitive in self.relation.fibre.leaves():
                out += efforts_of(primitive, path) if isinstance(primitive, Storage) else []
        return [*out, *sorted(at_ports("flow", bundle)), *sorted(at_ports("effort", bundle)), ONE]

    @property
    def empty(self) -> Answer:
        """Whether no motion exists: whatever irreversible components do, the equations of the others contradict.

        True with the weighted equations whose sum is 1 = 0, by junction and component; within the error bounds of the
        efforts at the state.
        """
        if self.contradiction:
            return Answer(True, (self.contradiction,))
        return possible(self.relation.fibre, self.point)

    @property
    def determined(self) -> Answer:
        """Whether outer flows, or outer efforts, determine the rates of all states; hidden equations are
        differentiated once.

        False with the states and junctions that nothing determines.
        """
        if self.empty:
            return Answer(False, ("no motion exists",))
        return determined(self.relation.fibre, self.point)

    @property
    def doubt(self) -> str:
        """Why no motion exists, or why it is not known to be determined; empty where it is."""
        if empty := self.empty:
            return f"no motion exists: {'; '.join(empty.because)}"
        known = determined(self.relation.fibre, self.point)
        return "" if known else f"the motion is not known to be determined: {'; '.join(known.because)}"

    @property
    def values(self) -> dict[Path, Array]:
        """Rates of states that are determined alone, without outer flows: name of the state -> (n,)."""
        found, out = self.linear.values(), dict[Path, Array]()
        for name, dim in self.rates:
            names = own("rate", name, dim)
            if all(variable in found for variable in names):
                out[name] = np.array([found[variable] for variable in names])
        return out

    @property
    def projector(self) -> Array:
        """The orthogonal projector on the relation, as a subspace of the vectors in the `order` of variables."""
        return self.linear.projector(self.order)

    @property
    def dimension(self) -> int:
        """Dimension of the subspace, the constant coordinate included."""
        return self.linear.dimension

    @property
    def dimensions(self) -> tuple[int, int]:
        """Dimensions of the subspace and of its projection on efforts."""
        return self.dimension, self.linear.onto(v for v in self.order if v.kind in ("effort", "one")).dimension

    @property
    def clear(self) -> bool:
        """Whether no coefficient is near its error bound: dimensions are the same, also of what efforts there are, for
        bounds a thousand times as large, and for a thousandth. Else floats may find what rational numbers do not.
        """
        if self.point.field.decides:
            return True
        fields = (Rounded(share * ROUNDED) for share in (1e-3, 1e3))
        others = (replace(self, point=replace(self.point, field=field)) for field in fields)
        return all(other.dimensions == self.dimensions for other in others)

    def same(self, other: "Instant") -> bool:
        """Whether it is the same relation, to the error bounds; two empty ones are the same."""
        return self.linear.same(other.linear)

    def distance(self, other: "Instant") -> float:
        """Largest entry of the difference of projectors; 0 if both are empty, 1 if one is. The names must agree."""
        if self.order != other.order:
            raise ValueError("relations between variables of other names cannot be compared")
        if self.linear.empty or other.linear.empty:
            return float(self.linear.empty != other.linear.empty)
        return float(np.abs(self.projector - other.projector).max(initial=0.0))


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
        return at_instant(self.primitive, path, point)

    def labelled(self, path: Path, point: BasePoint) -> Iterator[Labelled]:
        found = self.at(path, point).renamed(lambda v: into(path, v))
        yield from (("component", path, row) for row in found.equations)


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
        return glued(point.field, self.pattern, {box: part.at(path / box, point) for box, part in self.parts.items()})

    def labelled(self, path: Path, point: BasePoint) -> Iterator[Labelled]:
        # ports of an identity's box are those of the identity
        rows = () if self.pattern.is_identity else relation_of_pattern(point.field, self.pattern, "met").equations
        for row in rows:
            first = next(iter(row))
            wire = self.pattern.boxes[first.box].ports[first.port] if first.role == "met" else None
            junction = path / (first.port if wire is None else wire.junction)
            yield first.kind, junction, {into(path, v): number for v, number in row.items()}
        for box, part in self.parts.items():
            yield from part.labelled(path / box, point)


@final
@dataclass(frozen=True, slots=True)
class Renamed:
    """The fibres of a relation whose components have new names."""

    relation: Relation
    names: Directory[Path]

    def leaves(self) -> Iterator[tuple[Path, Primitive]]:
        """The components under their new names."""
        for path, primitive in self.relation.fibre.leaves():
            yield path.moved(self.names), primitive

    def _before(self, path: Path, point: BasePoint) -> BasePoint:
        """The point in terms of the old names; states keep the names that their rates have."""
        states: dict[Path, Array] = {}
        names: dict[Path, Path] = {}
        efforts: dict[Path, Array] = {}
        for leaf, primitive in self.relation.fibre.leaves():
            new, old = path / leaf.moved(self.names), path / leaf
            for port in primitive.interface:
                if new / port in point.states:
                    states[old / port] = point.states[new / port]
                    names[old / port] = point.names[new / port]
            if new in point.efforts:
                efforts[old] = point.efforts[new]
        return replace(point, states=states, names=names, efforts=efforts)

    def at(self, path: Path, point: BasePoint) -> LinearRelation:
        """The relation over a point."""
        return self.relation.fibre.at(path, self._before(path, point))

    def labelled(self, path: Path, point: BasePoint) -> Iterator[Labelled]:
        """The equations under the old names."""
        return self.relation.fibre.labelled(path, self._before(path, point))


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
