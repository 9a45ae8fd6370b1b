"""Conditions on a match for a rule to apply there: a morphism that meets the gluing condition."""

from typing import NoReturn

from ephs.operad.errors import PatternError
from ephs.operad.isomorphism import Renaming
from ephs.operad.names import Path
from examples.rewriting.elements import Elements
from examples.rewriting.rules import Rule


def require_morphism(rule: Rule, match: Renaming, host: Elements) -> None:
    """Raise an error unless the map embeds the left side in the pattern.

    Raises
    ------
    PatternError
        A name without image, or one whose image is of another kind, lies elsewhere, or has another quantity.
    """
    left, ports, reads = rule.left, host.ports(), host.state_at()
    for path, junction in left.junctions.items():
        image = _image(rule, f"junction {path}", match.junctions.get(path), host.state_of)
        if path in rule.powered and image not in host.junctions:
            _refuse(rule, f"junction {path} at {image}, which carries no power", "a junction with power")
        found = host.junctions[image][0] if path in rule.powered else host.states[host.state_of[image]].quantity
        if not found.matches(junction.quantity):
            _refuse(rule, f"junction {path} at {image}: {found}", str(junction.quantity))
    for path, group in left.classes.items():
        for other in group:
            one, two = match.junctions[path], match.junctions[other]
            if host.state_of[one] != host.state_of[two]:
                _refuse(rule, f"junctions {path} and {other} at {one} and {two}", "junctions that share a state")
    for box in left.boxes:
        _image(rule, f"box {box}", match.boxes.get(box), host.boxes)
    for (box, name), port in left.ports.items():
        there = match.boxes[box]
        image = _image(rule, f"port {box}.{name}", match.ports.get(box, {}).get(name), ports[there])
        wanted = match.junctions[port.junction]
        if ports[there][image] != port.power:
            _refuse(rule, f"port {box}.{name} at {there}.{image}", "a power port" if port.power else "a state port")
        if (host.power[there, image] if port.power else reads[there, image]) != (
            wanted if port.power else host.state_of[wanted]
        ):
            _refuse(rule, f"port {box}.{name} at {there}.{image}", f"a port on {wanted}")


def require_gluing(rule: Rule, match: Renaming, host: Elements) -> None:
    """Refuse a match where removal would leave dangling ports.

    Raises
    ------
    PatternError
        Two names have one image and one of them goes (identification), or what goes has something on it that the left
        side does not name (dangling).
    """
    left, kept = rule.left, rule.interface
    places = {(box, name): (match.boxes[box], match.ports[box][name]) for box, name in left.ports}
    classes = set(left.classes.values())
    _require_apart(rule, "box", {b: match.boxes[b] for b in left.boxes}, set(kept.boxes))
    _require_apart(
        rule, "port", {".".join(map(str, p)): at for p, at in places.items()}, {f"{b}.{p}" for b, p in kept.ports}
    )
    powered = {path: match.junctions[path] for path in left.junctions if path in rule.powered}
    _require_apart(rule, "junction", powered, set(kept.junctions))
    states = {min(group): host.state_of[match.junctions[min(group)]] for group in classes}
    _require_apart(rule, "state", states, {min(group) for group in classes if group & kept.junctions.keys()})
    images = set(places.values())
    for box in left.boxes.keys() - kept.boxes.keys():
        there = match.boxes[box]
        for name in sorted(host.ports()[there]):
            if (there, name) not in images:
                _loose(rule, f"box {there} goes, its port {name} is not on the left side")
    gone = {image for path, image in powered.items() if path not in kept.junctions}
    for path in sorted(gone):
        outer = {name for state in host.states for name, _ in state.outer}
        if host.junctions[path][1] or path in outer:
            _loose(rule, f"junction {path} goes, which is exposed")
        for place, at in sorted(host.power.items()):
            if at == path and place not in images:
                _loose(rule, f"junction {path} goes, port {place[0]}.{place[1]} on it is not on the left side")
    for group in classes:
        if group & kept.junctions.keys():
            continue
        state = host.states[host.state_of[match.junctions[min(group)]]]
        rest = {str(path) for path in state.members - gone} | {str(path) for path, _ in state.outer}
        rest |= {f"{box}.{name}" for box, name in state.ports - images}
        if rest:
            _loose(rule, f"the state of {match.junctions[min(group)]} goes, which {min(rest)} has, too")


def _require_apart(
    rule: Rule,
    what: str,
    images: "dict[Path, Path] | dict[Path, int] | dict[str, tuple[Path, Path]]",
    kept: "set[Path] | set[str]",
) -> None:
    seen: dict[object, object] = {}
    for name, image in images.items():
        other = seen.setdefault(image, name)
        if other != name and not (name in kept and other in kept):
            found = f"{what} {other} and {what} {name} at one place"
            raise PatternError(
                "identification", what=rule.name, found=found, expected="two places, since one of them is removed"
            )


def _image(rule: Rule, what: str, image: Path | None, known: "dict[Path, int] | set[Path] | dict[Path, bool]") -> Path:
    if image is None or image not in known:
        _refuse(rule, f"{what} at {image}", "a name of its kind in the pattern")
    return image


def _refuse(rule: Rule, found: str, expected: str) -> NoReturn:
    raise PatternError("match", what=rule.name, found=found, expected=expected)


def _loose(rule: Rule, found: str) -> NoReturn:
    raise PatternError("dangling", what=rule.name, found=found, expected="only elements that the left side names")
