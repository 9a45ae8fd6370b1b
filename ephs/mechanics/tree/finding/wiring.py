"""Incidence of a flat system: which ports lie on each junction, what is stored there, what is read."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

from ephs.operad import Path
from ephs.semantics.descriptor.descriptor import ComponentSlot, Descriptor, StateSlot
from ephs.semantics.primitives.primitives import Storage


@final
@dataclass(frozen=True, slots=True, eq=False)
class Incidence:
    """Incidence of the components of a flat system; components and junctions have the numbers of its descriptor.

    Parameters
    ----------
    ports
        (components,) ports of each, each with its junction.
    on
        (junctions,) the components with a port there, each with the port.
    outer
        Junction -> the outer port that it is.
    """

    components: tuple[ComponentSlot, ...]
    ports: tuple[dict[str, int], ...]
    on: tuple[list[tuple[int, str]], ...]
    outer: dict[int, Path]

    @staticmethod
    def of(descriptor: Descriptor) -> "Incidence":
        """The incidence of a descriptor's system."""
        n, wires = descriptor.numbering, iter(descriptor.numbering.wires.tolist())
        names = [tuple(map(str, primitive.bundle.ports)) for primitive in n.primitives]
        ports = tuple({port: next(wires) for port in names[i]} for i in n.primitive.tolist())
        on: tuple[list[tuple[int, str]], ...] = tuple([] for _ in range(n.junctions.size))
        for number, own in enumerate(ports):
            for port, junction in own.items():
                on[junction].append((number, port))
        outer = [slot.path for slot in descriptor.outer]
        return Incidence(descriptor.components, ports, on, dict(zip(n.outer.tolist(), outer, strict=True)))

    def stored(self, junction: int) -> tuple[int, StateSlot] | None:
        """The storage on a junction with its state there; None where nothing is stored."""
        for number, port in self.on[junction]:
            slot = self.components[number]
            if isinstance(slot.primitive, Storage):
                return number, slot.reads[list(slot.primitive.bundle.ports).index(Path.of(port))]
        return None

    def neighbours(self, junction: int, besides: int) -> Iterator[tuple[int, str]]:
        """The components on a junction with their ports there, but for one component."""
        return ((number, port) for number, port in self.on[junction] if number != besides)
