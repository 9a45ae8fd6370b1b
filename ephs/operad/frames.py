"""Frames: each state has one at most, that of all ports that have the state.

A frame says in which frame a port's vectors are given. It decides nothing about which interfaces match, since "no
frame" matches A and B, which do not match each other: substitution would not be associative. Instead a state has the
set of the frames of its ports. Gluing unites the sets, and a pattern or a system where a state has two is refused. As
unions do not depend on the order, all bracketings of a composite are defined and equal, or none is.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from itertools import chain

from ephs.operad.directory import Directory
from ephs.operad.errors import PatternError
from ephs.operad.links import closure
from ephs.operad.names import Path
from ephs.operad.parts import Box, Junction
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import Interface, Quantity
from ephs.operad.wellformed import box_of


def united_frames(junctions: Mapping[Path, Junction], classes: Mapping[Path, frozenset[Path]]) -> dict[Path, Junction]:
    """The junctions that get a frame from another one of their state.

    Parameters
    ----------
    classes
        The class of each linked junction.

    Raises
    ------
    PatternError
        A state has two frames.
    """
    gained: dict[Path, Junction] = {}
    for members in set(classes.values()):
        frames = {path: frame for path in members if (frame := junctions[path].quantity.frame) is not None}
        if not frames:
            continue
        first = min(frames)
        if others := [path for path in frames if frames[path] != frames[first]]:
            raise _two_frames(first, frames[first], min(others), frames[min(others)])
        gained |= {path: _in_frame(junctions[path], frames[first]) for path in members - frames.keys()}
    return gained


def in_united_frames(
    junctions: Directory[Junction], boxes: Directory[Box], classes: Mapping[Path, frozenset[Path]]
) -> tuple[Directory[Junction], Directory[Box]]:
    """Junctions and boxes, all of one state in its frame; errors as of `united_frames`."""
    gained = united_frames(junctions, classes)
    if not gained:
        return junctions, boxes
    junctions = Directory.trusted({**junctions, **gained})
    return junctions, Directory.trusted(retyped(boxes, junctions, gained))


def _two_frames(one: Path, frame: str, other: Path, another: str, box: Path | None = None) -> PatternError:
    """The error of a state with two frames; the second is that of a box where one is named."""
    where = f"box {box}, port {other}" if box is not None else f"junction {other}"
    found = f"frame {frame} at junction {one}, frame {another} at {where}"
    return PatternError("frames", box=box, junction=one, found=found, expected="one frame")


def _in_frame(junction: Junction, frame: str) -> Junction:
    """The junction with its quantity in a frame."""
    return replace(junction, quantity=junction.quantity.in_frame(frame))


def met(junctions: dict[Path, Junction], at: Path, quantity: Quantity, box: Path, port: Path) -> bool:
    """Unite the frame of a port with that of the junction on which it is; whether the junction gained one.

    Raises
    ------
    PatternError
        They have two.
    """
    mine, frame = junctions[at].quantity.frame, quantity.frame
    if frame is None or frame == mine:
        return False
    if mine is not None:
        raise _two_frames(at, mine, port, frame, box)
    junctions[at] = _in_frame(junctions[at], frame)
    return True


def retyped(boxes: Mapping[Path, Box], junctions: Mapping[Path, Junction], gained: Collection[Path]) -> dict[Path, Box]:
    """The boxes with their interfaces as junctions have become that gained a frame."""
    new = frozenset(gained)
    return {
        path: box_of(box.ports, junctions) if any(port.junction in new for port in box.ports.values()) else box
        for path, box in boxes.items()
    }


def in_frames_of(
    pattern: Pattern,
    interfaces: Mapping[Path, Interface],
    groups: Callable[[], Iterable[Iterable[Path]]] = tuple,
) -> Pattern:
    """The pattern in the frames of what fills its boxes.

    Parameters
    ----------
    interfaces
        Those of the fillings, by box.
    groups
        Gives the junctions that share their state since a filling has one state at several ports; called where there
        are frames.

    Raises
    ------
    PatternError
        A state has two frames.
    """
    kinds = chain(pattern.junctions.values(), *(each.values() for each in interfaces.values()))
    if all(each.quantity.frame is None for each in kinds):
        return pattern
    junctions, changed = dict(pattern.junctions), False
    for box, interface in interfaces.items():
        for port, wire in pattern.boxes[box].ports.items():
            changed |= met(junctions, wire.junction, interface[port].quantity, box, port)
    united = united_frames(junctions, closure([*pattern.links, *groups()]))
    return with_junctions(pattern, junctions | united) if changed or united else pattern


def with_junctions(pattern: Pattern, junctions: Mapping[Path, Junction]) -> Pattern:
    """The pattern with junctions in other frames."""
    if pattern.is_identity:
        kinds = {path: replace(kind, quantity=junctions[path].quantity) for path, kind in pattern.interface.items()}
        return Pattern.identity(kinds)
    return Pattern(junctions, pattern.boxes, pattern.links)
