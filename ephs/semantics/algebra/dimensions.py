"""Units of the states at ports, as linear equations between exponents of base units.

A port's state has a unit X; then its flow has X/s, and its effort J/X. So one unknown a port is enough.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias, final

from ephs.operad import ROOT, Algebra, Interface, Path, Pattern, Quantity
from ephs.operad.names import PathLike
from ephs.operad.units import dimension
from ephs.semantics.algebra.interfaces import interface_of
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.meaning import LinearRelation, glued
from ephs.semantics.meaning.fields import Rational
from ephs.semantics.meaning.functor import Theory
from ephs.semantics.meaning.variables import ONE, RelationVariable

Unit: TypeAlias = Mapping[str, int | Fraction]
"""Exponents of base units, such as ``{"kg": 1, "m": 1, "s": -1}``."""
Powers: TypeAlias = Mapping[Path, int] | Mapping[str, int]
"""Port -> power of the unit of its state."""
BASE = ("kg", "m", "s", "A", "K", "mol")
"""Their order in texts; words of one's own come after them."""
RATIONAL = Rational()
SAME = Theory((), ("unit",), states=True)
"""Ports that show one state have one unit."""


@final
@dataclass(frozen=True, slots=True)
class Units:
    """Linear equations between the units at the ports of an interface.

    Parameters
    ----------
    interface
        The ports.
    equations
        In reduced form: outer variables are the exponents at ports, unknown vectors; those with a name for good are
        base units, whose coefficients are constants. The one equation 1 = 0 where they contradict each other.
    """

    interface: Interface
    equations: tuple[tuple[tuple[RelationVariable, Fraction], ...], ...]

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
        rows: list[dict[RelationVariable, int | Fraction]] = []
        for port, of in interface.items():
            unit = _unit(of.quantity)
            if unit is not None:
                rows.append({_unit_of(port): 1} | _constants(unit))
        own = {str(v.port) for row in rows for v in row if v.role == "own"}
        words = (*BASE, *sorted(own.difference(BASE)))
        for powers, unit in equations:
            unknown = sorted(unit.keys() - set(words))
            if unknown:
                raise SemanticsError("units", unknown[0], found=unknown[0], expected=", ".join(words))
            rows.append({_unit_of(Path.of(port)): power for port, power in powers.items()} | _constants(unit))
        return _made(interface, LinearRelation.among(RATIONAL, map(RATIONAL.exact, rows)))

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
            if first == _unit_of(Path.of(port)) and all(v.role == "own" for v, _ in rest):
                return _text({str(v.port): -value for v, value in rest})
        return None


_CONTRADICTION = (((ONE, Fraction(1)),),)


def _unit(quantity: Quantity) -> Unit | None:
    """The quantity's own unit, None where it has none: states such as poses have entries of several units."""
    return dict(dimension(quantity.unit)) if quantity.unit else None


def _unit_of(port: Path) -> RelationVariable:
    return RelationVariable("outer", "unit", ROOT, port, 0)


def _constants(unit: Unit) -> dict[RelationVariable, int | Fraction]:
    return {RelationVariable("own", "unit", ROOT, Path((name,)), 0): -power for name, power in unit.items()}


def _made(interface: Interface, relation: LinearRelation) -> Units:
    rows = relation.canonical
    if any(all(v.role == "own" for v in row) for row in rows):
        return Units(interface, _CONTRADICTION)
    return Units(interface, tuple(tuple(row.items()) for row in rows))


def _text(unit: Mapping[str, Fraction]) -> str:
    names = (*BASE, *sorted(unit.keys() - set(BASE)))
    words = (name if unit[name] == 1 else f"{name}^{unit[name]}" for name in names if unit.get(name))
    return " ".join(words) or "1"


def _compose(pattern: Pattern, parts: Mapping[Path, Units]) -> Units:
    relations = {box: LinearRelation.among(RATIONAL, map(dict, part.equations)) for box, part in parts.items()}
    return _made(pattern.interface, glued(RATIONAL, pattern, relations, SAME))


units: Algebra[Units] = Algebra("units", interface_of(Units), _compose)
"""Interfaces with units: ports that meet have one; what follows for the outer ports is found by elimination over ℚ."""
