"""Incidence of a flat system: which ports lie on each junction, what is stored there, what is read."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.operad import Path
from ephs.semantics.descriptor.descriptor import ComponentSlot, Descriptor, StateSlot
from ephs.semantics.descriptor.numbering import starts
from ephs.semantics.primitives.primitives import Storage


@final
@dataclass(frozen=True, slots=True, eq=False)
class Incidence:
    """Incidence of the components of a flat system; components and junctions have the numbers of its descriptor.

    Parameters
    ----------
    names
        (components,) ports of each.
    wires, first
        Junctions of all ports, one component after the other, and where those of each begin.
    owners, begin
        Components with each port on a junction, one junction after the other, and where those of each begin.
    outer
        Junction -> the outer port that it is.
    """

    components: tuple[ComponentSlot, ...]
    names: tuple[tuple[str, ...], ...]
    wires: list[int]
    first: list[int]
    owners: list[tuple[int, str]]
    begin: list[int]
    outer: dict[int, Path]

    @staticmethod
    def of(descriptor: Descriptor) -> "Incidence":
        """The incidence of a descriptor's system."""
        n, components = descriptor.numbering, descriptor.components
        each = [tuple(map(str, primitive.bundle.ports)) for primitive in n.primitives]
        names = tuple(each[i] for i in n.primitive.tolist())
        count = np.array([len(ports) for ports in each], dtype=np.int64)[n.primitive]
        every = [(number, port) for number, ports in enumerate(names) for port in ports]
        owners = [every[i] for i in np.argsort(n.wires, kind="stable").tolist()]
        begin = np.append(0, np.cumsum(np.bincount(n.wires, minlength=n.junctions.size))).tolist()
        outer = [slot.path for slot in descriptor.outer]
        return Incidence(
            components, names, n.wires.tolist(), starts(count).tolist(), owners, begin,
            dict(zip(n.outer.tolist(), outer, strict=True)),
        )  # fmt: skip

    def ports(self, number: int) -> dict[str, int]:
        """Ports of a component, each with its junction."""
        names, at = self.names[number], self.first[number]
        return dict(zip(names, self.wires[at : at + len(names)], strict=True))

    def on(self, junction: int) -> list[tuple[int, str]]:
        """The components with a port on a junction, each with the port."""
        return self.owners[self.begin[junction] : self.begin[junction + 1]]

    def stored(self, junction: int) -> tuple[int, StateSlot] | None:
        """The storage on a junction with its state there; None where nothing is stored."""
        for number, port in self.on(junction):
            slot = self.components[number]
            if isinstance(slot.primitive, Storage):
                return number, slot.reads[list(slot.primitive.bundle.ports).index(Path.of(port))]
        return None

    def neighbours(self, junction: int, besides: int) -> Iterator[tuple[int, str]]:
        """The components on a junction with their ports there, but for one component."""
        return ((number, port) for number, port in self.on(junction) if number != besides)
