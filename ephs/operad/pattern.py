"""Interconnection patterns: which ports of which boxes meet at which junction.

A pattern is an operation of an operad: its boxes are the inputs, its outer interface is the output. The
definitions and the conditions P1 to P5 are those of Lohmayer, Capobianco, Leyendecker, "Exergetic
Port-Hamiltonian Systems for Multibody Dynamics", with one addition: junctions may be linked, which means that
they share a state but not a power balance. Without links, substitution would not commute with the semantics
where a state port is exposed.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar, final

from ephs.operad.collector import paused_collector
from ephs.operad.directory import Directory, Entries
from ephs.operad.names import ROOT, Path, PathLike
from ephs.operad.normal import NormalForm, normal_form
from ephs.operad.parts import Box, Junction, Port
from ephs.operad.quantities import Interface, PortType

if TYPE_CHECKING:
    import networkx as nx

    from ephs.operad.algebra import Algebra, Composable
    from ephs.operad.isomorphism import Renaming
    from ephs.operad.lint import Diagnostic
    from ephs.semantics.meaning import LinearRelation

T = TypeVar("T")
Boxes: TypeAlias = Entries[Entries[str | Port] | Box]
"""Box name -> port name -> junction name, ``"~name"`` for a state port; or box name -> `Box`."""


@final
@dataclass(frozen=True, slots=True, init=False, eq=False, repr=False)
class Pattern:
    """An interconnection pattern, as a value: immutable, equal up to order and up to names that do not
    matter.

    Parameters
    ----------
    junctions
        Junction name -> `Junction`. Names are dotted paths.
    boxes
        Box name -> port name -> junction name; ``"~name"`` in place of ``"name"`` makes a state port.
    links
        Groups of junctions that share their state, and only that. The relation is closed transitively.

    Attributes
    ----------
    junctions : Directory[Junction]
    boxes : Directory[Box]
    links : frozenset of frozensets of Path
        The classes of two junctions or more.
    interface : Interface
        The outer ports, each named like the junction that it exposes.

    Raises
    ------
    PatternError
        If names clash (P5), a port lies on no junction (P2), a junction has no inner port (P4), or linked junctions
        differ in quantity (P1) or frame. An outer port is named like its junction, so it has one at most (P3).

    Examples
    --------
    >>> from ephs.operad import junction, quantity as Q
    >>> osc = Pattern(
    ...     junctions={"q": junction(Q.displacement), "p": junction(Q.momentum, exposed=True)},
    ...     boxes={"pe": {"q": "q"}, "ke": {"p": "p"}, "pkc": {"q": "q", "p": "p"}},
    ... )
    >>> print(osc.interface)
    p: momentum on real
    """

    junctions: Directory[Junction]
    boxes: Directory[Box]
    links: frozenset[frozenset[Path]]
    interface: Interface
    _classes: Mapping[Path, frozenset[Path]]
    _normal: NormalForm | None

    def __init__(
        self,
        junctions: Entries[Junction],
        boxes: "Boxes",
        links: Iterable[Iterable[PathLike]] = (),
    ) -> None:
        from ephs.operad.wellformed import read_boxes, read_junctions, read_links, require_named_boxes

        found = read_junctions(junctions)
        wired = read_boxes(boxes, found)
        require_named_boxes(wired)
        self._set(found, wired, read_links(links, found))

    def _set(self, junctions: Directory[Junction], boxes: Directory[Box], links: Iterable[Iterable[Path]]) -> None:
        from ephs.operad.frames import in_united_frames
        from ephs.operad.wellformed import require_pattern

        classes = require_pattern(junctions, boxes, links)
        self._assign(*in_united_frames(junctions, boxes, classes), classes)

    def _assign(
        self, junctions: Directory[Junction], boxes: Directory[Box], classes: Mapping[Path, frozenset[Path]]
    ) -> None:
        values = {
            "junctions": junctions,
            "boxes": boxes,
            "links": frozenset(classes.values()),
            "interface": Directory.trusted(
                {path: PortType(j.quantity, j.power) for path, j in junctions.items() if j.exposed}
            ),
            "_classes": classes,
            "_normal": None,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @staticmethod
    def trusted(
        junctions: Directory[Junction], boxes: Directory[Box], classes: Mapping[Path, frozenset[Path]]
    ) -> "Pattern":
        """Pattern of parts known to be well-formed, such as those that substitution produces; without checks.

        `classes` gives each linked junction its class.
        """
        pattern = object.__new__(Pattern)
        pattern._assign(junctions, boxes, classes)
        return pattern

    @staticmethod
    def identity(interface: "Entries[PortType]") -> "Pattern":
        """The identity pattern of an interface: one box at the root path, its ports exposed under their names."""
        ports = Directory(interface, what="interface")
        junctions = Directory([(p, Junction(t.quantity, True, t.power)) for p, t in ports.items()])
        box = Box(Directory([(p, Port(p, t.power)) for p, t in ports.items()]), ports)
        pattern = object.__new__(Pattern)
        pattern._set(junctions, Directory.unit(box), ())
        return pattern

    @property
    def is_identity(self) -> bool:
        """Whether this is the identity of its interface; only identities have a box at the root path."""
        return ROOT in self.boxes

    def state_class(self, junction: PathLike) -> frozenset[Path]:
        """The junctions that share their state with this one, itself included.

        Raises
        ------
        KeyError
            If there is no such junction.
        """
        path = Path.of(junction)
        if path not in self.junctions:
            raise KeyError(junction)
        return self._classes.get(path) or frozenset((path,))

    @property
    def normal_form(self) -> NormalForm:
        """Key of equality; computed once."""
        found = self._normal
        if found is None:
            with paused_collector():
                found = normal_form(self)
            object.__setattr__(self, "_normal", found)
        return found

    def __eq__(self, other: object) -> bool:
        return self.normal_form == other.normal_form if isinstance(other, Pattern) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.normal_form)

    def substitute(
        self,
        mapping: "Mapping[Path, Pattern] | Mapping[str, Pattern] | None" = None,
        /,
        **fillings: "Pattern",
    ) -> "Pattern":
        """Put patterns into boxes: one, some or all of them.

        Parameters
        ----------
        mapping, **fillings
            Box name -> pattern whose outer interface is that of the box: names, quantities and kinds of
            ports. Dotted names go through the mapping. The box of an identity is ``"."``.

        Returns
        -------
        Pattern
            Box b of the filling of box a is named a.b. A junction exposed as a power port is absorbed by the
            junction on which that port lies; any other junction j is kept as a.j, and if it was exposed as a
            state port it is linked to the junction on which that port lies.

        Raises
        ------
        PatternError
            For an unknown box, a filling that is no pattern, an interface that differs, or a state in two frames.
        """
        from ephs.operad.substitution import substitute
        from ephs.operad.wellformed import read_fillings

        return substitute(self, read_fillings(mapping, fillings))

    def __call__(
        self,
        mapping: "Mapping[Path, Composable] | Mapping[str, Composable] | None" = None,
        /,
        **fillings: "Composable",
    ) -> Any:
        """Fill all boxes, in the most general algebra of the fillings; names as in `substitute`.

        Systems and primitives give a `System`; with a `Relation` among them, a `Relation`. The empty pattern, which
        has no fillings to say it, gives the system without parts. Errors are those of `apply`.
        """
        from ephs.operad.algebra import call
        from ephs.operad.wellformed import read_fillings

        return call(self, read_fillings(mapping, fillings))

    def apply(self, algebra: "Algebra[T]", fillings: "Mapping[Path, T] | Mapping[str, T]") -> "T":
        """Value of the pattern in an algebra at an element for each box.

        Raises
        ------
        PatternError
            A box without filling, a filling without box, no element, another interface, or a state in two frames.
        """
        from ephs.operad.algebra import apply
        from ephs.operad.wellformed import read_fillings

        return apply(algebra, self, read_fillings(fillings, {}))

    def rename(
        self,
        *,
        boxes: "Mapping[Path, PathLike] | Mapping[str, PathLike] | None" = None,
        junctions: "Mapping[Path, PathLike] | Mapping[str, PathLike] | None" = None,
        ports: "Mapping[Path, Mapping[Any, PathLike]] | Mapping[str, Mapping[Any, PathLike]] | None" = None,
    ) -> "Pattern":
        """Rename boxes, junctions (and with them outer ports) and ports of boxes, all at once.

        Parameters
        ----------
        boxes, junctions
            Old name -> new name; what is not mentioned keeps its name.
        ports
            Old box name -> old port name -> new port name.

        Raises
        ------
        PatternError
            For a name that does not exist, names that clash, or an identity whose ports would be named differently
            inside and outside.
        """
        from ephs.operad.renaming import rename

        return rename(self, boxes or {}, junctions or {}, ports or {})

    def isomorphic(self, other: "Pattern", *, fix_interface: bool = False) -> "Renaming | None":
        """Whether the pattern is the other one up to names: a renaming with ``renaming(self) == other``, or None.

        Parameters
        ----------
        fix_interface
            Whether outer ports must keep their names.
        """
        from ephs.operad.isomorphism import isomorphism

        return isomorphism(self, other, fix_interface=fix_interface)

    def automorphisms(self, *, fix_interface: bool = False) -> int:
        """The number of renamings that preserve the pattern; 1 if it is rigid."""
        from ephs.operad.isomorphism import automorphisms

        return automorphisms(self, fix_interface=fix_interface)

    def canonical_hash(self) -> str:
        """A digest that isomorphic patterns share in every process, and others do not but for very regular ones."""
        from ephs.operad.isomorphism import canonical_hash

        return canonical_hash(self)

    def relation(self, *, field: Literal["float", "rational"] = "float") -> "LinearRelation":
        """F(f), the relation of the junctions: numbers with error bounds, or exact."""
        from ephs.semantics.meaning.relation import FIELDS, relation_of_pattern

        return relation_of_pattern(FIELDS[field](), self)

    def to_networkx(self) -> "nx.MultiGraph[Any]":
        """The bipartite graph of boxes and junctions, an edge for each port.

        Nodes are ``("box", path)`` and ``("junction", path)``, the latter with the attributes `quantity`, `exposed`
        (None, ``"power"`` or ``"state"``), `power` (whether it bears power) and `state_class` (the junctions of its
        state). Edges have the port's path as their key, and the attribute `power`.
        """
        from ephs.operad.isomorphism import to_networkx

        return to_networkx(self)

    def to_dict(self) -> dict[str, Any]:
        """The pattern as nested dictionaries of text and numbers; equal patterns have equal documents."""
        from ephs.operad.documents import to_dict

        return to_dict(self)

    @staticmethod
    def from_dict(document: Mapping[str, object]) -> "Pattern":
        """Read a document made by `to_dict`, or by hand.

        Raises
        ------
        PatternError
            For what is no document, or no pattern; the message says at which key.
        """
        from ephs.operad.documents import from_dict

        return from_dict(document)

    def to_json(self) -> str:
        """The document as JSON text, by the schema ``ephs/operad/pattern.schema.json``; equal patterns, equal texts."""
        from ephs.operad.documents import to_json

        return to_json(self)

    @staticmethod
    def from_json(text: str | bytes) -> "Pattern":
        """Read JSON text; errors as of `from_dict`."""
        from ephs.operad.documents import from_json

        return from_json(text)

    def to_text(self) -> str:
        """The pattern in compact notation for reading and writing by hand, in its own order.

        >>> from ephs.operad import junction, quantity as Q
        >>> f = Pattern({"q": junction(Q.displacement, exposed=True)}, {"pe": {"q": "q"}, "see": {"x": "~q"}})
        >>> print(f.to_text(), end="")
        q: displacement, exposed
        pe(q)
        see(x=~q)
        """
        from ephs.operad.text import to_text

        return to_text(self)

    @staticmethod
    def from_text(text: str) -> "Pattern":
        """Read the compact form of `to_text`.

        One statement a line, or several with ``;`` between: a junction ``p: momentum, exposed`` (or ``exposed as
        state``), a box ``hc(q_r=~q_r, p=p_r)``, where ``~`` makes a state port and a port named like its junction is
        written once, a link ``q ~ r``. ``#`` starts a comment.

        Raises
        ------
        PatternError
            For what is no statement, with its line, or no pattern.
        """
        from ephs.operad.text import from_text

        return from_text(text)

    def lint(self) -> "list[Diagnostic]":
        """Warnings for legitimate but rarely intended structure: open-circuit ports, linked power balances."""
        from ephs.operad.lint import diagnose

        return diagnose(self)

    @property
    def summary(self) -> str:
        """The pattern in one line."""
        from ephs.operad.printing import summary

        return summary(self)

    def _repr_svg_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        from ephs.show import draw

        return draw(self).svg

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:  # pyright: ignore[reportUnusedFunction] - IPython, Hypothesis
        printer.text(repr(self))

    def __str__(self) -> str:
        from ephs.operad.printing import tree

        return tree(self)

    def __repr__(self) -> str:
        from ephs.operad.printing import expression

        return expression(self)

    def __reduce__(self) -> tuple[object, ...]:
        if self.is_identity:
            return (Pattern.identity, (self.interface,))
        boxes = self.boxes.map(lambda box: box.ports)
        return (Pattern, (self.junctions, boxes, tuple(tuple(sorted(group)) for group in self.links)))
