"""Units of the states at ports, as linear equations between exponents of base units.

A port's state has a unit X; then its flow has X/s, and its effort J/X. So one unknown a port is enough.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias, final

from ephs.operad import Algebra, Interface, Path, Pattern, Quantity
from ephs.operad.names import PathLike
from ephs.operad.units import dimension
from ephs.semantics.algebra.elimination import Row, eliminated, reduced
from ephs.semantics.errors import SemanticsError

Unit: TypeAlias = Mapping[str, int | Fraction]
"""Exponents of base units, such as ``{"kg": 1, "m": 1, "s": -1}``."""
Powers: TypeAlias = Mapping[Path, int] | Mapping[str, int]
"""Port -> power of the unit of its state."""
BASE = ("kg", "m", "s", "A", "K", "mol")
"""Their order in texts; words of one's own come after them."""


@final
@dataclass(frozen=True, slots=True)
class Units:
    """Linear equations between the units at the ports of an interface.

    Parameters
    ----------
    interface
        The ports.
    equations
        In reduced form: ports, whose exponents are unknown vectors, and base units, whose coefficients are constants;
        the one equation 1 = 0 where they contradict each other.
    """

    interface: Interface
    equations: tuple[Row[tuple[int, Path | str]], ...]

    @staticmethod
    def of(
        interface: Interface, equations: Iterable[tuple[Mapping[Path, int] | Mapping[str, int], Unit]] = ()
    ) -> "Units":
        """Equations between ports with the units of their quantities.

        Parameters
        ----------
        equations
            (powers, unit): the product of the ports' state units to these powers is this unit.

        >>> from ephs.operad import Directory, PortType, Quantity, Space, quantity
        >>> level = Quantity("level", Space("real", 1, 1), 1)
        >>> tank = Directory({"l": PortType(level), "v": PortType(quantity.volume)})
        >>> Units.of(tank, [({"l": 1, "v": -1}, {"m": -2})]).unit("l")
        'm'
        """
        rows: list[dict[tuple[int, Path | str], Any]] = []
        for port, of in interface.items():
            unit = _unit(of.quantity)
            if unit is not None:
                rows.append({(0, port): 1} | _constants(unit))
        own = {str(name) for row in rows for rank, name in row if rank}
        words = (*BASE, *sorted(own.difference(BASE)))
        for powers, unit in equations:
            unknown = sorted(unit.keys() - set(words))
            if unknown:
                raise SemanticsError("units", unknown[0], found=unknown[0], expected=", ".join(words))
            rows.append({(0, Path.of(port)): power for port, power in powers.items()} | _constants(unit))
        return _made(interface, reduced(rows, _order))

    @property
    def consistent(self) -> bool:
        """Whether some choice of units fulfils all equations."""
        return self.equations != _CONTRADICTION

    def unit(self, port: PathLike) -> str | None:
        """The unit of the state at a port, None where it is open.

        Raises
        ------
        SemanticsError
            The equations contradict each other.
        """
        if not self.consistent:
            raise SemanticsError("units", port, found="equations that contradict each other", expected="units")
        for row in self.equations:
            (first, _), *rest = row
            if first == (0, Path.of(port)) and all(rank for (rank, _), _ in rest):
                return _text({str(name): -value for (_, name), value in rest})
        return None


_CONTRADICTION: tuple[Row[tuple[int, Path | str]], ...] = ((((1, "1"), Fraction(1)),),)


def _unit(quantity: Quantity) -> Unit | None:
    """The quantity's own unit, None where it has none: states such as poses have entries of several units."""
    return dict(dimension(quantity.unit)) if quantity.unit else None


def _constants(unit: Unit) -> dict[tuple[int, Path | str], Any]:
    return {(1, name): -power for name, power in unit.items()}


def _order(key: tuple[int, Path | str]) -> tuple[int, Any]:
    return key


def _made(interface: Interface, rows: list[dict[tuple[int, Path | str], Fraction]]) -> Units:
    if any(all(rank for rank, _ in row) for row in rows):
        return Units(interface, _CONTRADICTION)
    return Units(interface, tuple(tuple(sorted(row.items())) for row in rows))


def _text(unit: Mapping[str, Fraction]) -> str:
    names = (*BASE, *sorted(unit.keys() - set(BASE)))
    words = (name if unit[name] == 1 else f"{name}^{unit[name]}" for name in names if unit.get(name))
    return " ".join(words) or "1"


def _interface(element: object) -> Interface | None:
    return element.interface if isinstance(element, Units) else None


def _compose(pattern: Pattern, parts: Mapping[Path, Units]) -> Units:
    """Ports on a junction, and junctions that share a state, have one unit."""
    rows: list[dict[tuple[int, Any], Any]] = []
    for group in pattern.links:
        first, *others = sorted(group)
        rows += [{(0, ("", first)): 1, (0, ("", other)): -1} for other in others]
    rows += [{(0, path): 1, (0, ("", path)): -1} for path in pattern.interface]
    for box, part in parts.items():
        ports = pattern.boxes[box].ports
        for equation in part.equations:
            row: dict[tuple[int, Any], Fraction] = {}
            for (rank, name), value in equation:
                key = (rank, name) if rank else (0, ("", ports[name].junction))
                row[key] = row.get(key, Fraction(0)) + value
            rows.append(row)
    kept = {key for row in rows for key in row if key[0] or isinstance(key[1], Path)}
    return _made(pattern.interface, eliminated(rows, kept, _order))


units: Algebra[Units] = Algebra("units", _interface, _compose)
"""Interfaces with units: ports that meet have one; what follows for the outer ports is found by elimination over ℚ."""
