"""Incidence of a flat system: which ports lie on each junction, what is stored there, what is read."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

from ephs.operad import Path
from ephs.semantics.descriptor import ComponentSlot, Descriptor, StateSlot
from ephs.semantics.primitives import Storage

__all__ = ["Wiring"]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Wiring:
    """Incidence of the components of a flat system; components and junctions have the numbers of its descriptor.

    Parameters
    ----------
    ports
        (components,) port -> junction.
    on
        Junction -> the components with a port there, each with the port.
    outer
        Junction -> the outer port that it is.
    """

    components: tuple[ComponentSlot, ...]
    ports: tuple[dict[str, int], ...]
    on: dict[int, list[tuple[int, str]]]
    outer: dict[int, Path]

    @staticmethod
    def of(descriptor: Descriptor) -> "Wiring":
        """The incidence of a descriptor's system."""
        components, wires = descriptor.components, iter(descriptor.numbering.wires.tolist())
        ports: list[dict[str, int]] = []
        on: dict[int, list[tuple[int, str]]] = {}
        known: dict[int, tuple[str, ...]] = {}
        for number, slot in enumerate(components):
            names = known.get(id(slot.primitive))
            if names is None:
                names = known[id(slot.primitive)] = tuple(map(str, slot.primitive.bundle.ports))
            mine = {port: next(wires) for port in names}
            ports.append(mine)
            for port, junction in mine.items():
                on.setdefault(junction, []).append((number, port))
        outer = [slot.path for slot in descriptor.outer]
        return Wiring(components, tuple(ports), on, dict(zip(descriptor.numbering.outer.tolist(), outer, strict=True)))

    def stored(self, junction: int) -> tuple[int, StateSlot] | None:
        """The storage on a junction with its state there; None where nothing is stored."""
        for number, port in self.on.get(junction, []):
            slot = self.components[number]
            if isinstance(slot.primitive, Storage):
                return number, slot.reads[list(slot.primitive.bundle.ports).index(Path.of(port))]
        return None

    def neighbours(self, junction: int, besides: int) -> Iterator[tuple[int, str]]:
        """The components on a junction with their ports there, but for one component."""
        return ((number, port) for number, port in self.on.get(junction, []) if number != besides)
