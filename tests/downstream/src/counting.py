"""Counts what patterns are made of; the sort of thing that one builds on a modelling library."""

from dataclasses import dataclass, replace

from ephs.operad import Algebra, AlgebraMap, Interface


@dataclass(frozen=True)
class Boxes:
    """How many boxes there are inside."""

    interface: Interface
    count: int


BOXES = Algebra(
    "boxes",
    lambda element: element.interface if isinstance(element, Boxes) else None,
    lambda pattern, parts: Boxes(pattern.interface, sum(part.count for part in parts.values())),
)
TWICE = AlgebraMap(BOXES, BOXES, lambda element: replace(element, count=2 * element.count), "twice")


def boxes(pattern) -> int:
    """How many boxes."""
    return len(pattern.boxes)


def power_ports(pattern) -> int:
    """How many inner power ports."""
    return sum(port.power for box in pattern.boxes.values() for port in box.ports.values())


def dissipators(system) -> int:
    """How many components destroy exergy, at all levels."""
    return sum(primitive.kind == "irreversible" for _, primitive in system.leaves())


def mass(scene) -> float:
    """The mass of all bodies in kg."""
    return sum(body.mass for _, body in scene.all_bodies())
