"""The error of the syntax layer, with all its texts in one table."""

from typing import final

from ephs.operad.messages import legible

_TEXTS = {
    "name": "invalid name {found!r} in a path: {expected}; choose another name",
    "path": "invalid path {found!r}: expected {expected}",
    "prefix": "{what}: the paths {found} clash, as one is a prefix of the other; {expected}; rename one of them",
    "duplicate": "{what}: the path {found} is given twice; {expected}; rename one of them",
    "apart": "the {what} directory lacks {found}; {expected}",
    "p5": "box {box} and junction {junction} clash: one path is a prefix of the other, so that"
    " substitution could name two junctions alike; rename one of them",
    "root-box": "box .: a box at the root path clashes with the junctions of its own fillings; only"
    " Pattern.identity(interface) has one; give the box a name (found the boxes {found})",
    "root-rename": "box .: an identity's box cannot be renamed, and its ports have the same names inside and outside;"
    " found new names for {found}, expected {expected}; write the renaming pattern with a named box",
    "root-junction": "junction .: a junction at the root path is a prefix of every box; give it a name",
    "root-port": "box {box}, port {port}: a port at the root path could name no junction of a filling; give it a name",
    "junction-type": "junction {junction}: found {found}, expected {expected}",
    "box-type": "box {box}: found {found}, expected {expected}",
    "port-type": "box {box}, port {port}: found {found}, expected {expected}",
    "unknown-junction": "box {box}, port {port}: there is no junction {junction}; the junctions are {expected}",
    "no-inner-port": "junction {junction} ({found}) has no inner port; expected at least one port of a box on"
    " it. Connect a port or remove the junction. To pass an outer port through, or to expose it twice, fork"
    " outside: expose it once and connect both users where the pattern is used",
    "link-junction": "link {found}: there is no junction {junction}; the junctions are {expected}",
    "link-size": "link {found}: expected two junctions or more that share their state",
    "link-quantity": "link between junctions {junction}: found the quantities {found}, expected one quantity;"
    " only equal quantities can share a state",
    "frames": "one state in two frames: found {found}, expected {expected}; put a change of frame between them",
    "unknown-box": "box {box}: there is no such box; the boxes are {expected}",
    "filling-type": "box {box}: the filling is {found}, expected {expected}",
    "interface": "box {box}: the filling's interface does not match: {ports}. Found {found}, expected"
    " {expected}; rename ports with Pattern.rename, nothing is matched by type alone",
    "fillings": "box {box}: found fillings for {found}, expected one for each of {expected}; fill each box once",
    "foreign": "box {box}: found {found}, expected an element of the algebra {expected}",
    "not-an-element": "box {box}: found {found}, expected {expected} of an algebra, such as a System, a primitive or a"
    " Relation; fill boxes with elements of an algebra of your own by pattern.apply(algebra, fillings)",
    "mixed": "box {box}: the fillings are of several algebras, found {found}; expected {expected}; map them into one"
    " algebra first",
    "rename": "there is no {what} named {found} to rename; the names are {expected}",
    "pair": "the kind of relative pose is {found!r}, expected one of {expected}",
    "pair-known": "the kind {what} of pairs is known with dim, size and parameters {expected}, found {found}",
    "pair-parameters": "relative pose {what}: found the parameters {found}, expected {expected}",
    "parity": "quantity {what}: the parity is {found!r}, expected +1 (even under time reversal) or -1 (odd)",
    "space": "space {what}: found dim {found}, expected whole numbers dim >= 0 and size >= dim",
    "unit": "the unit {found!r} is not a product of powers; expected a text as in 'kg m²/s' or 'J/(mol K)'",
    "domain": "quantity {what}: the domain is {found}, expected {expected}",
    "charges": "quantity {what}: found the charges {found}, expected {expected}",
    "json": "no {what} can be read: {where}: found {found}, expected {expected}",
    "text": "no pattern can be read: line {where}: found {found}, expected {expected}",
    "rule": "invalid rule {what!r}: found {found}, expected {expected}",
    "match": "the rule {what!r} does not match: found {found}, expected {expected}",
    "identification": "the rule {what!r} cannot be applied: found {found}, expected {expected}",
    "dangling": "the rule {what!r} cannot be applied: found that {found}; expected {expected}",
    "bare": "the rule {what!r} cannot be applied: found that {found}; expected {expected}",
    "derivation": "invalid derivation: found {found}, expected {expected}",
    "parameter": "space {what}: the parameter {found} is not finite; expected a finite number",
}


@final
class PatternError(ValueError):
    """A pattern, name, quantity or substitution that is not well-formed.

    Parameters
    ----------
    kind
        The key of the message.
    box, port, junction
        Dotted paths of the faulty items, or ``None``.
    found, expected
        The given and the expected value.
    **facts
        Further words of the message.
    """

    def __init__(
        self,
        kind: str,
        *,
        box: object = None,
        port: object = None,
        junction: object = None,
        found: object = None,
        expected: object = None,
        **facts: str,
    ) -> None:
        self.kind = kind
        self.box = None if box is None else str(box)
        self.port = None if port is None else str(port)
        self.junction = None if junction is None else str(junction)
        self.found = found
        self.expected = expected
        self.facts = facts
        words = {"box": self.box, "port": self.port, "junction": self.junction, "found": found, "expected": expected}
        super().__init__(_TEXTS[kind].format(**{key: _brief(word) for key, word in (words | facts).items()}))

    def __reduce__(self) -> tuple[object, ...]:
        return (
            _rebuild,
            (self.kind, self.box, self.port, self.junction, self.found, self.expected, self.facts),
        )


def _brief(word: object) -> object:
    """Word of a message, abbreviated in the middle where it is long, with control characters escaped."""
    text = word if isinstance(word, str) else repr(word)
    brief = legible(text, 2000, 120, 40)
    return word if brief == text else brief


def _rebuild(
    kind: str,
    box: object,
    port: object,
    junction: object,
    found: object,
    expected: object,
    facts: dict[str, str],
) -> PatternError:
    return PatternError(kind, box=box, port=port, junction=junction, found=found, expected=expected, **facts)
