"""Corelations: which outer ports of a part hang together, in that they show one state."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import final

from ephs.operad import Algebra, AlgebraMap, Interface, Path, Pattern
from ephs.operad.links import closure
from ephs.operad.names import PathLike
from ephs.semantics.algebra.fibres import Meaning, relation_for, relations
from ephs.semantics.algebra.interfaces import interface_of
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.meaning.partition import pushout


@final
@dataclass(frozen=True, slots=True)
class Corelation:
    """A partition of the ports of an interface.

    Parameters
    ----------
    interface
        The ports, power and state.
    classes
        The partition; each port is in one class.
    """

    interface: Interface
    classes: frozenset[frozenset[Path]]

    @staticmethod
    def of(interface: Interface, groups: Iterable[Iterable[PathLike]] = ()) -> "Corelation":
        """The finest partition that joins the members of each group; singletons by default.

        Raises
        ------
        SemanticsError
            Ports of unlike quantities in one class, or no port of that name.
        """
        joined = closure([[Path.of(port) for port in group] for group in groups if group])
        for port, group in joined.items():
            if unknown := group - interface.keys():
                raise SemanticsError("unknown-port", min(unknown), expected=", ".join(sorted(map(str, interface))))
            for other in group:
                if not interface[port].quantity.matches(interface[other].quantity):
                    found, expected = interface[other].quantity, interface[port].quantity
                    raise SemanticsError("joined", other, found=found, expected=expected, port=port)
        return Corelation(interface, frozenset(joined.get(port) or frozenset((port,)) for port in interface))

    def __str__(self) -> str:
        return "; ".join(sorted(" ~ ".join(sorted(map(str, group))) for group in self.classes)) or "(no port)"


def _compose(pattern: Pattern, parts: Mapping[Path, Corelation]) -> Corelation:
    """A part that joins two of its ports joins the junctions that they are on."""
    shown = {box: [(group, None) for group in part.classes] for box, part in parts.items()}
    classes = (frozenset(ports) for ports, _ in pushout(pattern, shown) if ports)
    return Corelation(pattern.interface, frozenset(classes))


corelations: Algebra[Corelation] = Algebra("corelations", interface_of(Corelation), _compose)
"""Partitions of the ports; they compose by pushouts."""


def _base(element: Meaning) -> Corelation:
    relation = relation_for(element)
    return Corelation.of(relation.interface, [each.ports for each in relation.classes if len(each.ports) > 1])


base: AlgebraMap[Meaning, Corelation] = AlgebraMap(relations, corelations, _base, "base")
"""Identification of the states at a relation's outer ports."""
