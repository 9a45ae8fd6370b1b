"""Rewriting rules: left side, right side, and interface."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

from ephs.operad.directory import Directory, Entries
from ephs.operad.documents import contents_from, contents_record
from ephs.operad.errors import PatternError
from ephs.operad.isomorphism import Renaming
from ephs.operad.links import closure
from ephs.operad.names import Path, paths_text
from ephs.operad.parts import Box, Junction, Port
from ephs.operad.pattern import Boxes, Pattern
from ephs.operad.reading import Reader
from ephs.operad.text import statements
from ephs.operad.wellformed import read_boxes, read_junctions, read_links, require_one_quantity

if TYPE_CHECKING:
    from examples.rewriting.derivation import Derivation


@final
@dataclass(frozen=True, slots=True, init=False)
class Fragment:
    """A piece of a pattern: junctions, and boxes with ports on them.

    A junction of a fragment need not have ports, and a box not all of the ports that it has in a pattern.

    Parameters
    ----------
    junctions, boxes, links
        As of a `Pattern`. No junction is exposed: rewriting leaves interfaces alone.

    Raises
    ------
    PatternError
        A port on a junction that there is not, names that clash, linked junctions of different quantities, or a
        junction that is exposed.
    """

    junctions: Directory[Junction]
    boxes: Directory[Box]
    links: frozenset[frozenset[Path]]

    def __init__(self, junctions: Entries[Junction], boxes: Boxes = (), links: Any = ()) -> None:
        found = read_junctions(junctions)
        for path, junction in found.items():
            if junction.exposed:
                expected = "a junction that is not exposed"
                raise PatternError("junction-type", junction=path, found=str(junction), expected=expected)
        classes = closure(read_links(links, found))
        require_one_quantity(found, classes)
        object.__setattr__(self, "junctions", found)
        object.__setattr__(self, "boxes", read_boxes(boxes, found))
        object.__setattr__(self, "links", frozenset(classes.values()))

    @staticmethod
    def from_text(text: str) -> "Fragment":
        """Read the compact form of `Pattern.to_text`."""
        return Fragment(*statements(text))

    @property
    def classes(self) -> dict[Path, frozenset[Path]]:
        """Junction -> the junctions that share its state, itself included."""
        found = {path: frozenset((path,)) for path in self.junctions}
        return found | {path: group for group in self.links for path in group}

    @property
    def ports(self) -> dict[tuple[Path, Path], Port]:
        """(Box, port) -> the port."""
        return {(box, name): port for box, content in self.boxes.items() for name, port in content.ports.items()}

    @property
    def powered(self) -> frozenset[Path]:
        """The junctions with a power port."""
        return frozenset(port.junction for port in self.ports.values() if port.power)


@final
@dataclass(frozen=True, slots=True)
class Rule:
    """A rule: replacement of the left side by the right side; elements named in both are preserved.

    Its interface, left ⇐ interface ⇒ right, is what both sides have in common: boxes of one name, junctions of one
    name, and ports of one name that lie alike. Rules are linear: both inclusions are injective, so each has a reverse.

    Parameters
    ----------
    left, right
        Names in one are not those of the pattern to which the rule is applied.
    name
        For messages.

    Raises
    ------
    PatternError
        A junction of both sides has two quantities, or two junctions of both share their state in one of them only.

    Examples
    --------
    Two springs on a junction become one:

    >>> rule = Rule.from_text("q: displacement; a(q); b(q)", "q: displacement; c(q)")
    >>> sorted(map(str, rule.interface.boxes)), sorted(map(str, rule.interface.junctions))
    ([], ['q'])
    >>> pattern = Pattern.from_text("x: displacement, exposed; soft(x); stiff(x); mass(x)")
    >>> found = next(m for m in rule.matches(pattern) if "mass" not in map(str, m.boxes.values()))
    >>> print(rule.apply(pattern, found).target.to_text(), end="")
    x: displacement, exposed
    c(q=x)
    mass(x)
    """

    left: Fragment
    right: Fragment
    name: str = "rule"

    def __post_init__(self) -> None:
        left, right = self.left.classes, self.right.classes
        kept = sorted(left.keys() & right.keys())
        for path in kept:
            one, two = self.left.junctions[path].quantity, self.right.junctions[path].quantity
            if one != two:
                found, expected = f"junction {path} as {two} on the right", f"{one}, as on the left"
                raise PatternError("rule", what=self.name, found=found, expected=expected)
            if left[path] & right.keys() != right[path] & left.keys():
                shared = paths_text(left[path] & right.keys())
                found = f"junction {path} sharing its state with {paths_text(right[path] & left.keys())} on the right"
                raise PatternError("rule", what=self.name, found=found, expected=f"{shared}, as on the left")

    @staticmethod
    def from_text(left: str, right: str, name: str = "rule") -> "Rule":
        """A rule of two fragments in the compact form."""
        return Rule(Fragment.from_text(left), Fragment.from_text(right), name)

    @property
    def interface(self) -> Fragment:
        """The common part of both sides."""
        left, right = self.left, self.right
        junctions = {path: j for path, j in left.junctions.items() if path in right.junctions}
        ports = right.ports
        boxes = {
            box: {name: port for name, port in content.ports.items() if ports.get((box, name)) == port}
            for box, content in left.boxes.items()
            if box in right.boxes
        }
        groups = [sorted(group & junctions.keys()) for group in left.links]
        return Fragment(junctions, boxes, [group for group in groups if len(group) > 1])

    @property
    def powered(self) -> frozenset[Path]:
        """The junctions with a power port on either side; the others share states only."""
        return self.left.powered | self.right.powered

    @property
    def reverse(self) -> "Rule":
        """The rule with its sides exchanged."""
        return Rule(self.right, self.left, f"{self.name}, reversed")

    def matches(self, pattern: Pattern, *, injective: bool = True) -> Iterator[Renaming]:
        """All places in a pattern at which the rule can be applied, in a fixed order.

        Parameters
        ----------
        injective
            Whether different boxes, ports and junctions must have different images. Else what is kept may coincide.

        Yields
        ------
        Renaming
            Names of the left side -> names in the pattern. A junction that stands for a state only is named like the
            least junction of that state in the canonical pattern.
        """
        from examples.rewriting.matching import matches

        return matches(self, pattern, injective=injective)

    def apply(self, pattern: Pattern, match: Renaming) -> "Derivation":
        """Rewrite a pattern: remove the left side except the interface; add the right side.

        Parameters
        ----------
        match
            One of `matches`, or any names of the left side -> names in the pattern or in its canonical form.

        Raises
        ------
        PatternError
            The match is none, fails the gluing condition, or would leave a junction or a state that is kept without a
            port.
        """
        from examples.rewriting.derivation import apply

        return apply(self, pattern, match)

    def to_dict(self) -> dict[str, Any]:
        """The rule as nested dictionaries of text and numbers."""
        return {"name": self.name, "left": _record(self.left), "right": _record(self.right)}


def _record(fragment: Fragment) -> dict[str, Any]:
    return contents_record(fragment.junctions, fragment.boxes, fragment.links)


def rule_from(reader: Reader, where: str, value: object) -> Rule:
    """Read a rule; the inverse of `Rule.to_dict`."""
    found = reader.record(where, value, {"name", "left", "right"}, set())
    sides: list[Fragment] = []
    for side in ("left", "right"):
        at = f"{where}.{side}"
        given = reader.record(at, found[side], {"junctions", "boxes"}, {"links"})
        sides.append(Fragment(*contents_from(given, f"{at}.")))
    return Rule(sides[0], sides[1], reader.text(f"{where}.name", found["name"]))
