"""Systems: patterns whose boxes are filled, down to primitives.

A system carries its states: isolated composites have no ports, and equality of relations on ports would be vacuous.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, TypeVar, cast, final

import numpy as np

from ephs.operad import ROOT, Algebra, Directory, Interface, Nesting, Path, Pattern, Quantity
from ephs.operad.frames import in_frames_of
from ephs.operad.links import closure
from ephs.semantics.bundles.bundle import Array, Reference
from ephs.semantics.bundles.errors import AssemblyError, listed
from ephs.semantics.primitives.primitives import Irreversible, Primitive, Reversible, Storage
from ephs.semantics.spaces import manifold
from ephs.semantics.systems.fitting import interface_in_words, require_fillings
from ephs.semantics.systems.initial import read_state, saved_state, started
from ephs.semantics.systems.kept import Kept, once

if TYPE_CHECKING:
    from ephs.semantics.descriptor.descriptor import Descriptor
    from ephs.semantics.meaning import Relation, Route
    from ephs.semantics.symbols.equations import Equations
    from ephs.semantics.systems.ledger import Ledger
    from ephs.semantics.systems.report import CheckReport

T = TypeVar("T")


@final
@dataclass(frozen=True, slots=True)
class System:
    """A composite system: a pattern with every box filled by a system or a primitive of the box' interface.

    Parameters
    ----------
    pattern
        How the subsystems are interconnected.
    fillings
        Box path -> subsystem.

    Raises
    ------
    SemanticsError
        A box without filling, a filling without box, or an interface that does not match.
    PatternError
        A state has two frames: those of the pattern, and of what fills its boxes.
    """

    pattern: Pattern
    fillings: Directory["Filling"]
    _kept: Kept = field(default_factory=Kept, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_fillings(self.pattern, self.fillings)
        interfaces = {box: filling.interface for box, filling in self.fillings.items()}
        object.__setattr__(self, "pattern", in_frames_of(self.pattern, interfaces, self._joined))

    def _joined(self) -> list[list[Path]]:
        """The junctions that share their state since a subsystem has it at several ports."""
        return [
            [self.pattern.boxes[box].ports[port].junction for port in group]
            for box, filling in self.fillings.items()
            if isinstance(filling, System)
            for group in filling.shared_ports
        ]

    @property
    def shared_ports(self) -> list[list[Path]]:
        """The outer ports that share a state, two or more, by state."""
        classes = set(closure([*self.pattern.links, *self._joined()]).values())
        groups = [sorted(path for path in each if path in self.interface) for each in classes]
        return [group for group in groups if len(group) > 1]

    @staticmethod
    def of(pattern: Pattern, fillings: Mapping[str, "Filling"] | Mapping[Path, "Filling"]) -> "System":
        """Fill the boxes of a pattern; keys are paths or dotted names."""
        return System(pattern, Directory({Path.of(box): filling for box, filling in fillings.items()}))

    @property
    def algebra(self) -> "Algebra[Filling]":
        """Algebra of which a system is an element."""
        from ephs.semantics.algebra import systems

        return systems

    @property
    def kind(self) -> Literal["composite"]:
        """Kind of filling."""
        return "composite"

    @property
    def interface(self) -> Interface:
        """The ports of the system, named like the exposed junctions."""
        return self.pattern.interface

    @property
    def is_flat(self) -> bool:
        """Whether every box is filled by a primitive."""
        return not any(isinstance(filling, System) for filling in self.fillings.values())

    def flatten(self) -> "System":
        """The same system on one level: patterns substituted, primitives under the paths of their boxes."""
        if self.is_flat:
            return self
        return System.trusted(self.nesting.flatten(), Directory.trusted(dict(self.leaves())))

    @staticmethod
    def trusted(pattern: Pattern, fillings: Directory["Filling"]) -> "System":
        """System of fillings known to fit a pattern in their frames, such as those with other numbers; unchecked."""
        system = object.__new__(System)
        for name, value in (("pattern", pattern), ("fillings", fillings), ("_kept", Kept())):
            object.__setattr__(system, name, value)
        return system

    def flatten_once(self) -> "System":
        """The same system with its subsystems opened by one level."""
        inner = {box: filling for box, filling in self.fillings.items() if isinstance(filling, System)}
        fillings: dict[Path, Filling] = {}
        for box, filling in self.fillings.items():
            parts = filling.fillings.items() if isinstance(filling, System) else [(ROOT, filling)]
            fillings |= {box / path: part for path, part in parts}
        return System(self.pattern.substitute({box: f.pattern for box, f in inner.items()}), Directory(fillings))

    @property
    def nesting(self) -> Nesting:
        """Patterns of all levels, without the components in the innermost boxes."""
        inner = {box: filling.nesting for box, filling in self.fillings.items() if isinstance(filling, System)}
        return Nesting(self.pattern, inner)

    def leaves(self) -> Iterator[tuple[Path, Primitive]]:
        """The primitives with their full paths, depth first."""
        return iter(once(self, "leaves", lambda: tuple(_leaves(self, ROOT))))

    @property
    def states(self) -> Directory[Quantity]:
        """The states of the storages: path of the component, then its port -> quantity."""

        def all_states() -> Directory[Quantity]:
            return Directory.trusted(
                {
                    path / port: quantity
                    for path, primitive in self.leaves()
                    if isinstance(primitive, Storage)
                    for port, _, quantity in primitive.bundle.items()
                }
            )

        return once(self, "states", all_states)

    @property
    def initial(self) -> dict[Path, Array]:
        """Initial values that the storages carry: path of the state -> (size,)."""
        return {
            path / port: np.array(value)
            for path, primitive in self.leaves()
            if isinstance(primitive, Storage)
            for port, value in primitive.initial
        }

    def state(self, values: Mapping[str, object] | None = None) -> dict[Path, Array]:
        """Initial values by path: as given, else those that the storages carry, else the identity of their space.

        Raises
        ------
        AssemblyError
            An unknown path, a wrong shape, or a number that is not finite.
        """
        states = self.states
        out = {path: manifold(quantity.space).identity() for path, quantity in states.items()} | self.initial
        for path, value in _known(values or {}, states).items():
            out[path] = read_state(path, states[path], value)
        return out

    def with_initial(self, values: Mapping[str, object] | Mapping[Path, object]) -> "System":
        """The system in another start: its storages carry these values, by path; others stay as they are.

        Raises
        ------
        AssemblyError
            An unknown path, a wrong shape, or a number that is not finite.
        """
        return _started(self, _known(values, self.states), ROOT)

    def at(self, solution: Any, time: float) -> "System":
        """The system in the state of a solution at one of its times, in s.

        Raises
        ------
        AssemblyError
            The solution has no such time, or states that the system has not.
        """
        return self.with_initial(saved_state(solution, time))

    @property
    def ledger(self) -> "Ledger":
        """Accounts of stored amounts and entropy production at a state."""
        from ephs.semantics.systems.ledger import Ledger

        return Ledger(self)

    def relation(
        self,
        reference: Reference | None = None,
        *,
        route: "Route" = "flat",
        field: Literal["float", "rational"] = "float",
    ) -> "Relation":
        """The system's meaning: a relation between the rates of its states and its outer flows and efforts.

        Parameters
        ----------
        route
            ``"flat"`` flattens and glues at one level; ``"nested"`` glues the relations of the subsystems level by
            level. They agree: this is what functoriality says.
        field
            ``"float"``: numbers with error bounds; ``"rational"``: exact, where all structure is constant; the efforts
            of storages stay open then.
        """
        from ephs.semantics.meaning import relation_of

        return relation_of(self, reference or Reference(), route, field)

    def descriptor(self) -> "Descriptor":
        """The square descriptor form, assembled without choosing causality.

        Subsystems of one pattern with components of the same ports are numbered once, and all of them by index maps.
        """
        from ephs.semantics.descriptor.descriptor import descriptor_of

        return once(self, "descriptor", lambda: descriptor_of(self))

    def equations(self, form: Literal["relation", "descriptor", "reduced"] = "reduced") -> "Equations":
        """The equations of the system, with the names of its junctions; as text, LaTeX, or SymPy's expressions.

        Parameters
        ----------
        form
            ``"relation"``: what the pattern says of each junction, and each component of its ports; ``"descriptor"``:
            efforts of storages, balances, conditions; ``"reduced"``: interface variables eliminated.

        Raises
        ------
        AssemblyError
            A descriptor or reduced form is asked of what has no square system of equations.
        """
        from ephs.semantics.symbols.equations import equations_of

        return equations_of(self, form)

    def check(self, reference: Reference | None = None, *, state: Mapping[str, object] | None = None) -> "CheckReport":
        """Check the structure of the components, that there are equations, and the laws.

        Parameters
        ----------
        state
            Where the laws are measured, missing values at the start; where None at random states, the first of which is
            the start of a system that carries one.
        """
        from ephs.semantics.systems.report import check_system

        if isinstance(cast("object", reference), Mapping):
            raise AssemblyError("reference", ROOT, found=str(reference))

        return check_system(self, reference, state=state)

    def to_dict(self, *, proofs: bool = False) -> "dict[str, Any]":
        """The system as nested dictionaries of text and numbers: patterns, library parts, formulas as data.

        With ``proofs``, what proves the components' structures is in it, too; reading replays it.

        Raises
        ------
        SemanticsError
            A component is no part of the library, and its formula cannot be traced; the message says which.
        """
        from ephs.semantics.documents.systems import to_dict

        return to_dict(self, proofs)

    @staticmethod
    def from_dict(document: Mapping[str, object]) -> "System":
        """Read a document made by `to_dict`, or by hand. No code is run; primitives are checked like any others.

        Raises
        ------
        PatternError
            For what is no document, or no system; the message says at which key.
        """
        from ephs.semantics.documents.systems import from_dict

        return from_dict(document)

    def to_json(self, *, proofs: bool = False) -> str:
        """The document as JSON text, by the schema ``ephs/semantics/system.schema.json``; as `to_dict`."""
        from ephs.semantics.documents.systems import to_json

        return to_json(self, proofs)

    @staticmethod
    def from_json(text: str | bytes) -> "System":
        """Read JSON text; errors as of `from_dict`."""
        from ephs.semantics.documents.systems import from_json

        return from_json(text)

    def _repr_svg_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        from ephs.show import draw

        return draw(self).svg

    def __repr__(self) -> str:
        lines = [f"System with ports {interface_in_words(self.interface)}"]
        for box, filling in self.fillings.items():
            if isinstance(filling, System):
                lines.append(f"  {box}: " + str(filling).replace("\n", "\n  "))
            else:
                values = ", ".join(f"{key}={value}" for key, value in filling.parameters)
                lines.append(f"  {box}: {filling.name}({values})  [{filling.kind}, {filling.verdict}]")
        return "\n".join(lines)


Filling = System | Storage | Reversible | Irreversible


def as_system(filling: Filling) -> System:
    """A primitive as the one box of an identity pattern; a system as it is."""
    if isinstance(filling, System):
        return filling
    return System(Pattern.identity(filling.interface), Directory.unit(filling))


def _known(values: Mapping[Any, object], states: Mapping[Path, Quantity]) -> dict[Path, object]:
    """The values by path."""
    found: dict[Path, object] = {}
    for name, value in values.items():
        path = Path.of(name)
        if path not in states:
            raise AssemblyError("unknown-state", name, expected=listed(name, sorted(map(str, states))))
        found[path] = value
    return found


def _started(system: System, values: Mapping[Path, object], at: Path) -> System:
    """The system in the box ``at`` with initial values, all of states that it has."""
    inside: dict[Path, dict[Path, object]] = {}
    for path, value in values.items():
        box = next(Path(path[:k]) for k in range(len(path)) if path[:k] in system.fillings)
        inside.setdefault(box, {})[Path(path[len(box) :])] = value
    fillings = dict(system.fillings)
    for box, given in inside.items():
        part = fillings[box]
        if isinstance(part, System):
            fillings[box] = _started(part, given, at / box)
        elif isinstance(part, Storage):
            fillings[box] = started(part, given, at / box)
    return System.trusted(system.pattern, Directory.trusted(fillings)) if inside else system


def _leaves(system: System, at: Path) -> Iterator[tuple[Path, Primitive]]:
    """The primitives of the system in the box ``at``, with their full paths."""
    for box, filling in system.fillings.items():
        path = at / box if at else box
        if isinstance(filling, System):
            yield from _leaves(filling, path)
        else:
            yield path, filling


def fold(
    filling: Filling,
    leaf: Callable[[Path, Primitive], T],
    compose: Callable[[Pattern, Mapping[Path, T]], T],
    path: Path = ROOT,
) -> T:
    """Evaluate from the inside, level by level: primitives at their full paths by ``leaf``, systems by ``compose``."""
    if not isinstance(filling, System):
        return leaf(path, filling)
    return compose(
        filling.pattern, {box: fold(each, leaf, compose, path / box) for box, each in filling.fillings.items()}
    )
