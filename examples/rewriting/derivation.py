"""Application of a rule at a match, and the derivation: the step as a value to check, reverse and store."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, NoReturn, cast, final

from ephs.operad.canonical import canonical
from ephs.operad.documents import pattern_within
from ephs.operad.errors import PatternError
from ephs.operad.isomorphism import Renaming
from ephs.operad.names import Path
from ephs.operad.pattern import Pattern
from ephs.operad.reading import Reader
from examples.rewriting.elements import Elements, Place, State
from examples.rewriting.gluing import require_gluing, require_morphism
from examples.rewriting.rules import Rule, rule_from

FORMAT = 1
SCHEMA_FILE = FilePath(__file__).with_name("derivation.schema.json")
_READ = Reader("derivation")


@final
@dataclass(frozen=True, slots=True)
class Derivation:
    """One step of rewriting, source ⇒ target: a double pushout.

    Parameters
    ----------
    rule
        What was applied.
    source, target
        The canonical patterns before and after. What the rule does not touch has the same names in both.
    match, comatch
        Names of the rule's left side -> names in the source; of its right side -> names in the target.
    """

    rule: Rule
    source: Pattern
    target: Pattern
    match: Renaming
    comatch: Renaming

    def check(self) -> None:
        """Verify the step by a checker that shares no code with the application of rules.

        Raises
        ------
        PatternError
            It is no double pushout; the message says what is not.
        """
        from examples.rewriting.replay import replay

        replay(self.rule, self.source, self.target, self.match, self.comatch)

    @property
    def reverse(self) -> "Derivation":
        """The step back, by the reversed rule."""
        return Derivation(self.rule.reverse, self.target, self.source, self.comatch, self.match)

    def to_dict(self) -> dict[str, Any]:
        """The derivation as nested dictionaries of text and numbers."""
        patterns = {"source": self.source.to_dict(), "target": self.target.to_dict()}
        names = {"match": _names(self.match), "comatch": _names(self.comatch)}
        return {"format": FORMAT, "rule": self.rule.to_dict()} | patterns | names

    @staticmethod
    def from_dict(document: Mapping[str, object]) -> "Derivation":
        """Read a document made by `to_dict`, without verification; see `check`.

        Raises
        ------
        PatternError
            For what is no document; the message says at which key.
        """
        keys = {"format", "rule", "source", "target", "match", "comatch"}
        found = _READ.record("document", document, keys, set())
        _READ.format(found, FORMAT)
        source, target = (pattern_within(_READ, side, found[side]) for side in ("source", "target"))
        match, comatch = (_renaming(side, found[side]) for side in ("match", "comatch"))
        return Derivation(rule_from(_READ, "rule", found["rule"]), source, target, match, comatch)

    def to_json(self) -> str:
        """The document as JSON text, by the schema ``examples/rewriting/derivation.schema.json``."""
        return json.dumps(self.to_dict(), ensure_ascii=False, indent=1, allow_nan=False) + "\n"

    @staticmethod
    def from_json(text: str | bytes) -> "Derivation":
        """Read JSON text; errors as of `from_dict`."""
        return Derivation.from_dict(cast("Mapping[str, object]", _READ.json(text)))


def apply(rule: Rule, pattern: Pattern, match: Renaming) -> Derivation:
    """Rewrite a pattern; see `Rule.apply`."""
    if pattern.is_identity:
        raise PatternError("match", what=rule.name, found="an identity pattern", expected="a pattern of named boxes")
    source = canonical(pattern)
    elements = Elements.of(source)
    match = _canonical(match, Elements.of(pattern), elements)
    require_morphism(rule, match, elements)
    require_gluing(rule, match, elements)
    states = {path: elements.state_of[match.junctions[path]] for path in rule.left.junctions}
    known = elements.ports()
    _take(rule, match, elements)
    comatch, states = _add(rule, match, elements, states, known)
    for path, image in comatch.junctions.items():
        if path in rule.powered and not elements.junctions[image][1] and image not in elements.power.values():
            _bare(rule, f"junction {image} would have no power port")
        if elements.states[states[path]].bare:
            _bare(rule, f"the state of junction {image} would have no port")
    try:
        target = elements.pattern()
    except PatternError as error:
        if error.kind != "no-inner-port":
            raise
        _bare(rule, f"junction {error.junction} would have no port")
    return Derivation(rule, source, target, match, _canonical(comatch, elements, Elements.of(target)))


def _canonical(match: Renaming, raw: Elements, form: Elements) -> Renaming:
    """The match, with states named like their least junction in the canonical pattern."""
    least = {_items(form.states[number]): form.handle(number) for number in set(form.state_of.values())}
    junctions = {
        path: image if image in form.junctions or image not in raw.state_of
        else least.get(_items(raw.states[raw.state_of[image]]), image)
        for path, image in match.junctions.items()
    }  # fmt: skip
    return Renaming(match.boxes, junctions, match.ports)


def _items(state: State) -> tuple[frozenset[object], ...]:
    return frozenset(state.members), frozenset(state.outer), frozenset(state.ports)


def _take(rule: Rule, match: Renaming, elements: Elements) -> None:
    """Remove the images of the elements outside the interface."""
    kept = rule.interface
    for box, name in rule.left.ports.keys() - kept.ports.keys():
        place = match.boxes[box], match.ports[box][name]
        elements.power.pop(place, None)
        for state in elements.states:
            state.ports.discard(place)
    elements.boxes.difference_update(match.boxes[box] for box in rule.left.boxes.keys() - kept.boxes.keys())
    for path in rule.left.junctions.keys() - kept.junctions.keys():
        if path in rule.powered:
            image = match.junctions[path]
            del elements.junctions[image]
            elements.states[elements.state_of[image]].members.discard(image)


def _add(
    rule: Rule, match: Renaming, elements: Elements, states: dict[Path, int], known: dict[Path, dict[Path, bool]]
) -> tuple[Renaming, dict[Path, int]]:
    """Add the right side to the remaining pattern under fresh names; returns the maps of its names and states."""
    kept, right = rule.interface, rule.right
    new = [path for path in (*right.boxes, *right.junctions) if path not in kept.boxes and path not in kept.junctions]
    fresh = _fresh(new, {path[0] for path in (*known, *elements.state_of, *match.junctions.values())})
    boxes = {box: match.boxes[box] if box in kept.boxes else fresh[box] for box in right.boxes}
    junctions = {path: match.junctions[path] if path in kept.junctions else fresh[path] for path in right.junctions}
    elements.boxes.update(boxes.values())
    for group in set(right.classes.values()):
        number = next((states[path] for path in sorted(group & kept.junctions.keys())), len(elements.states))
        if number == len(elements.states):
            elements.states.append(State(right.junctions[min(group)].quantity, set(), set(), set()))
        for path in group - kept.junctions.keys():
            elements.state_of[junctions[path]] = number
            if path in rule.powered:
                elements.junctions[junctions[path]] = (right.junctions[path].quantity, False)
                elements.states[number].members.add(junctions[path])
        states = states | dict.fromkeys(group, number)
    ports: dict[Path, dict[Path, Path]] = {}
    for box, content in right.boxes.items():
        names: dict[Path, Path] = {}
        ports[box] = names
        taken = {path[0] for path in known.get(boxes[box], {})}
        for name, port in content.ports.items():
            if (box, name) in rule.left.ports and box in kept.boxes:
                names[name] = match.ports[box][name]  # kept, or plugged in elsewhere
            else:
                names[name] = _fresh([name], taken)[name] if box in kept.boxes else name
                taken |= {names[name][0]} if box in kept.boxes else set()
            place: Place = boxes[box], names[name]
            if (box, name) in kept.ports:
                continue
            if port.power:
                elements.power[place] = junctions[port.junction]
            else:
                elements.states[states[port.junction]].ports.add(place)
    return Renaming(boxes, junctions, ports), states


def _fresh(paths: list[Path], taken: set[str]) -> dict[Path, Path]:
    """Fresh names for paths: unchanged, or with a number after the first name on a clash."""
    first: dict[str, str] = {}
    for path in paths:
        if path[0] in first:
            continue
        name, number = path[0], 0
        while name in taken or name in first.values():
            number += 1
            name = f"{path[0]}{number}"
        first[path[0]] = name
    return {path: Path((first[path[0]], *path[1:])) for path in paths}


def _bare(rule: Rule, found: str) -> NoReturn:
    raise PatternError("bare", what=rule.name, found=found, expected="a port on each remaining junction and state")


def _names(names: Renaming) -> dict[str, Any]:
    return {
        "boxes": {str(old): str(new) for old, new in sorted(names.boxes.items())},
        "junctions": {str(old): str(new) for old, new in sorted(names.junctions.items())},
        "ports": {
            str(box): {str(old): str(new) for old, new in sorted(ports.items())}
            for box, ports in sorted(names.ports.items())
        },
    }


def _renaming(where: str, value: object) -> Renaming:
    found = _READ.record(where, value, {"boxes", "junctions", "ports"}, set())
    ports = _READ.mapping(f"{where}.ports", found["ports"])
    return Renaming(
        _paths(f"{where}.boxes", found["boxes"]),
        _paths(f"{where}.junctions", found["junctions"]),
        {Path.of(box): _paths(f"{where}.ports.{box}", names) for box, names in ports},
    )


def _paths(where: str, value: object) -> dict[Path, Path]:
    pairs = _READ.mapping(where, value)
    return {Path.of(old): Path.of(_READ.text(f"{where}.{old}", new)) for old, new in pairs}
