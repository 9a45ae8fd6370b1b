"""The flat route to a system's relation: one level, one matrix, all unknowns eliminated at once."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from ephs.operad import Path
from ephs.semantics.bundle import Array
from ephs.semantics.linear.sums import summed
from ephs.semantics.primitives import Primitive, Storage
from ephs.semantics.relations.base import BasePoint, StateClass, sorted_classes
from ephs.semantics.relations.linear import LinearRelation, linear_parts, power_ports
from ephs.semantics.subspace import Subspace
from ephs.semantics.system import System


def flat_classes(flat: System) -> tuple[StateClass, ...]:
    """The states of a flat system, read off the links of its pattern."""
    pattern = flat.pattern
    ports: dict[frozenset[Path], list[tuple[Path, Primitive, Path]]] = {}
    for box, primitive in flat.leaves():
        for port, wire in pattern.boxes[box].ports.items():
            ports.setdefault(pattern.state_class(wire.junction), []).append((box, primitive, port))
    found: list[StateClass] = []
    for junctions, on in ports.items():
        shown = sorted(path for path in junctions if pattern.junctions[path].exposed)
        stores = sorted(box / port for box, primitive, port in on if isinstance(primitive, Storage))
        readers = sorted(box / p for box, part, p in on if not isinstance(part, Storage) and p in part.reads)
        if shown or stores or readers:
            quantity = pattern.junctions[min(junctions)].quantity.in_frame(None)
            found.append(StateClass(quantity, tuple(shown), tuple(stores), tuple(readers)))
    return sorted_classes(found)


@final
@dataclass(frozen=True, slots=True)
class Flat:
    """The fibres of a flat system: one effort per power junction, flows with sum zero."""

    system: System

    def leaves(self) -> Iterator[tuple[Path, Primitive]]:
        """The components."""
        return self.system.leaves()

    def at(self, path: Path, point: BasePoint) -> LinearRelation:
        """The subspace over a point."""
        pattern, columns = self.system.pattern, _Columns()
        outer = power_ports(pattern.interface)
        efforts: dict[Path, range] = {}
        for box, primitive in self.system.leaves():
            for port, _, quantity in primitive.bundle.items():
                junction = pattern.boxes[box].ports[port].junction
                if junction not in efforts:
                    efforts[junction] = columns.take(quantity.space.dim)
        for port, dim in outer:
            if port not in efforts:
                efforts[port] = columns.take(dim)
        balance: list[tuple[range, range | list[int], Array]] = []  # rows (those of efforts), columns, entries
        rows: list[tuple[list[int], Array]] = []
        rates: dict[Path, range] = {}
        constants: list[tuple[list[int], Array]] = []  # efforts, their values
        flows = {port: columns.take(dim) for port, dim in outer}
        for box, primitive in self.system.leaves():
            wires = pattern.boxes[box].ports
            index = [i for port, _, _ in primitive.bundle.items() for i in efforts[wires[port].junction]]
            x, e = point.read(path / box, primitive), point.efforts.get(path / box)
            dynamic, constraint, effort = linear_parts(primitive, x, e, point.reference)
            if isinstance(primitive, Storage):
                constants.append((index, effort))
                for port, _, quantity in primitive.bundle.items():
                    rates[box / port] = columns.take(quantity.space.dim)
                    balance.append((efforts[wires[port].junction], rates[box / port], np.eye(quantity.space.dim)))
                continue
            rows.append((index, constraint))
            lam = columns.take(constraint.shape[0])
            for port, where, _ in primitive.bundle.items():
                mine = efforts[wires[port].junction]
                balance.append((mine, index, dynamic[where]))
                balance.append((mine, lam, constraint[:, where].T))
        balance += [(efforts[port], flows[port], -np.eye(dim)) for port, dim in outer]
        one = columns.take(1)[0]
        equations = [summed((sum(map(len, efforts.values())), one + 1), balance)]
        for at, entries in rows:
            equations.append(summed((entries.shape[0], one + 1), [(range(entries.shape[0]), at, entries)]))
        for at, values in constants:
            row = np.zeros((len(at), one + 1))
            row[range(len(at)), at] = 1.0
            row[:, one] = -values / point.unit
            equations.append(row)
        kept = [i for each in sorted(rates) for i in rates[each]]
        kept += [i for side in (flows, efforts) for port, _ in outer for i in side[port]]
        return LinearRelation(
            tuple((each, len(rates[each])) for each in sorted(rates)),
            outer,
            Subspace.from_kernel(np.vstack(equations)).project([*kept, one]),
            point.unit,
        )


@dataclass(slots=True)
class _Columns:
    """Numbers the unknowns."""

    size: int = 0

    def take(self, count: int) -> range:
        self.size += count
        return range(self.size - count, self.size)
