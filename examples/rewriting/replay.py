"""Checker of derivations, independent of the code that applies rules.

A step is a double pushout if what is left of the source without the images of what goes is what is left of the target
without the images of what comes; if both sides are sent there as they are; and if nothing hangs loose.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn, final

from ephs.operad.errors import PatternError
from ephs.operad.isomorphism import Renaming
from ephs.operad.names import Path
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import Quantity
from examples.rewriting.rules import Fragment, Rule

Item = tuple[str, Any, Any]
"""Owner of a state: a junction, an outer state port, a state port of a box."""


@final
@dataclass(frozen=True, slots=True)
class _Facts:
    """Contents of a pattern: its boxes, ports, junctions that bear power, and shared states."""

    boxes: frozenset[Path]
    ports: dict[tuple[Path, Path], Path | None]
    junctions: dict[Path, tuple[Quantity, bool]]
    states: dict[Path, frozenset[Item]]
    quantities: dict[Path, Quantity]


def _facts(pattern: Pattern) -> _Facts:
    ports = {(box, name): port for box, content in pattern.boxes.items() for name, port in content.ports.items()}
    on = {port.junction for port in ports.values() if port.power}
    junctions = {
        path: (j.quantity, j.exposed and j.power)
        for path, j in pattern.junctions.items()
        if path in on or (j.exposed and j.power)
    }
    states: dict[Path, frozenset[Item]] = {}
    for path in pattern.junctions:
        group = pattern.state_class(path)
        items: set[Item] = {("junction", each, None) for each in group if each in junctions}
        items |= {
            ("outer", each, pattern.junctions[each].quantity)
            for each in group
            if pattern.junctions[each].exposed and not pattern.junctions[each].power
        }
        items |= {("port", *place) for place, port in ports.items() if not port.power and port.junction in group}
        states[path] = frozenset(items)
    wires = {place: port.junction if port.power else None for place, port in ports.items()}
    quantities = {path: j.quantity for path, j in pattern.junctions.items()}
    return _Facts(frozenset(pattern.boxes), wires, junctions, states, quantities)


def replay(rule: Rule, source: Pattern, target: Pattern, match: Renaming, comatch: Renaming) -> None:
    """Raise an error unless the value is a derivation; see `Derivation.check`."""
    before, after = _facts(source), _facts(target)
    for side, fragment, facts, names in (
        ("left", rule.left, before, match),
        ("right", rule.right, after, comatch),
    ):
        _require_morphism(rule, f"the {side} side", fragment, facts, names)
    kept = rule.interface
    places = {side: _places(f, n) for side, f, n in (("left", rule.left, match), ("right", rule.right, comatch))}
    _require({b: match.boxes[b] for b in kept.boxes}, {b: comatch.boxes[b] for b in kept.boxes}, "kept boxes")
    _require({p: places["left"][p] for p in kept.ports}, {p: places["right"][p] for p in kept.ports}, "kept ports")
    strong = [path for path in kept.junctions if path in rule.powered]
    one, two = ({path: names.junctions[path] for path in strong} for names in (match, comatch))
    _require(one, two, "kept junctions")
    gone = _own(rule, rule.left, match, places["left"], before)
    come = _own(rule, rule.right, comatch, places["right"], after)
    for own, facts, other in ((gone, before, after), (come, after, before)):
        if loose := [p for p in facts.ports.keys() - own.ports if p[0] in own.boxes or facts.ports[p] in own.junctions]:
            _refuse(f"port {loose[0][0]}.{loose[0][1]} would be dangling", "no port on removed or added elements")
        if again := own.boxes & other.boxes or own.junctions & other.junctions.keys():
            _refuse(f"{min(again)} both before and after", "different names for removed and added elements")
        if outer := [path for path in own.junctions if facts.junctions[path][1] or ("outer", path) in _outer(facts)]:
            _refuse(f"junction {outer[0]} is exposed", "an unchanged interface")
    _require(before.boxes - gone.boxes, after.boxes - come.boxes, "the other boxes")
    _require(_without(before.ports, gone.ports), _without(after.ports, come.ports), "the other ports")
    _require(
        _without(before.junctions, gone.junctions), _without(after.junctions, come.junctions), "the other junctions"
    )
    _require(_remaining(before, gone.items), _remaining(after, come.items), "who shares a state")
    for path in kept.junctions:
        rest = before.states[match.junctions[path]] - gone.items, after.states[comatch.junctions[path]] - come.items
        _require(*rest, f"the state of {path}")
    for fragment, facts, names, own in ((rule.left, before, match, gone), (rule.right, after, comatch, come)):
        groups = {frozenset(group): facts.states[names.junctions[min(group)]] for group in fragment.classes.values()}
        for group, items in groups.items():
            alone = not group & kept.junctions.keys()
            if alone and (items - own.items or list(groups.values()).count(items) > 1):
                _refuse(f"the state of {min(group)} is shared by others", "a state of its own")
    for path in rule.right.junctions.keys() - kept.junctions.keys():
        if path in rule.powered and after.junctions[comatch.junctions[path]][0] != rule.right.junctions[path].quantity:
            _refuse(f"junction {path} of another quantity", str(rule.right.junctions[path].quantity))


@final
@dataclass(frozen=True, slots=True)
class _Own:
    """Elements that only one side has, by their names in the pattern."""

    boxes: frozenset[Path]
    ports: frozenset[tuple[Path, Path]]
    junctions: frozenset[Path]
    items: frozenset[Item]


def _own(
    rule: Rule, fragment: Fragment, names: Renaming, places: Mapping[Any, tuple[Path, Path]], facts: _Facts
) -> _Own:
    kept = rule.interface
    boxes = {b: names.boxes[b] for b in fragment.boxes}
    junctions = {j: names.junctions[j] for j in fragment.junctions if j in rule.powered}
    own: list[frozenset[Any]] = []
    for what, images, same in (
        ("box", boxes, kept.boxes.keys()),
        ("port", places, kept.ports.keys()),
        ("junction", junctions, kept.junctions.keys()),
    ):
        mine = {key: image for key, image in images.items() if key not in same}
        theirs = [image for key, image in images.items() if key in same]
        if len({*mine.values()}) < len(mine) or any(image in theirs for image in mine.values()):
            _refuse(f"one {what} for two of the rule", "two, since one of them is not kept")
        own.append(frozenset(mine.values()))
    items = frozenset(
        {("junction", path, None) for path in own[2]} | {("port", *p) for p in own[1] if facts.ports[p] is None}
    )
    return _Own(own[0], own[1], own[2], items)


def _places(fragment: Fragment, names: Renaming) -> dict[tuple[Path, Path], tuple[Path, Path]]:
    return {(box, name): (names.boxes[box], names.ports[box][name]) for box, name in fragment.ports}


def _require_morphism(rule: Rule, side: str, fragment: Fragment, facts: _Facts, names: Renaming) -> None:
    named = {*names.boxes} == {*fragment.boxes} and {*names.junctions} == {*fragment.junctions}
    if not named or any({*names.ports.get(b, {})} != {*c.ports} for b, c in fragment.boxes.items()):
        _refuse(f"other names than {side} has", "all of them")
    if {*names.ports} - {*fragment.boxes}:
        _refuse(f"ports of boxes that {side} does not have", "none")
    for box, image in names.boxes.items():
        if image not in facts.boxes:
            _refuse(f"box {box} of {side} at {image}", "a box of the pattern")
    for path, image in names.junctions.items():
        known = facts.junctions if path in rule.powered else facts.states
        if image not in known or not facts.quantities[image].matches(fragment.junctions[path].quantity):
            _refuse(f"junction {path} of {side} at {image}", "a junction of its quantity")
    for path, group in fragment.classes.items():
        if len({facts.states[names.junctions[each]] for each in group}) > 1:
            _refuse(f"junction {path} of {side} with another state", "the state that it shares")
    for (box, name), port in fragment.ports.items():
        place = names.boxes[box], names.ports[box][name]
        image = names.junctions[port.junction]
        lies = place in facts.ports and (
            facts.ports[place] == image if port.power else ("port", *place) in facts.states[image]
        )
        if not lies:
            _refuse(f"port {box}.{name} of {side} at {place[0]}.{place[1]}", f"a port on {image}")


def _outer(facts: _Facts) -> set[tuple[str, Path]]:
    return {("outer", item[1]) for items in facts.states.values() for item in items if item[0] == "outer"}


def _remaining(facts: _Facts, own: frozenset[Item]) -> frozenset[frozenset[Item]]:
    return frozenset(rest for items in facts.states.values() if (rest := items - own))


def _without(table: Mapping[Any, Any], keys: Iterable[Any]) -> dict[Any, Any]:
    return {key: value for key, value in table.items() if key not in set(keys)}


def _require(before: object, after: object, what: str) -> None:
    if before != after:
        _refuse(f"{what} changed", "elements that the rule does not name to be unchanged")


def _refuse(found: str, expected: str) -> NoReturn:
    raise PatternError("derivation", found=found, expected=expected)
