"""Units as products of powers: written as in ``kg m²/s``, ``J/(mol K)``, compared by dimension.

The coherent units of the SI are known by their base units. Any other word is a base unit of its own, so that ``bit``
is equal to itself and to nothing else; prefixes are not taken apart.
"""

import re
from functools import cache
from types import MappingProxyType

from ephs.operad.errors import PatternError

Dimension = tuple[tuple[str, int], ...]
"""Base units with their powers, none of them zero, sorted by name."""

_SI: MappingProxyType[str, str] = MappingProxyType(
    {
        "rad": "1",
        "Hz": "1/s",
        "N": "kg m/s²",
        "J": "kg m²/s²",
        "W": "kg m²/s³",
        "Pa": "kg/(m s²)",
        "C": "A s",
        "V": "kg m²/(s³ A)",
        "Wb": "kg m²/(s² A)",
        "F": "s⁴ A²/(kg m²)",
        "H": "kg m²/(s² A²)",
        "Ω": "kg m²/(s³ A²)",
        "S": "s³ A²/(kg m²)",
        "T": "kg/(s² A)",
    }
)
_NAMED = ("N", "m/s", "A", "V", "W/K", "K", "Pa", "m³/s")
"""Customary units of flows and efforts by their dimension."""
_TOKEN = re.compile(r"\s*(?:([^\W\d⁰¹²³⁴⁵⁶⁷⁸⁹]+|1)(?:\^?(-?\d+)|([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?|([/()·*]))")
_PLAIN = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


@cache
def dimension(unit: str) -> Dimension:
    """Factors of a unit; none where it is empty or 1.

    Examples
    --------
    >>> dimension("N s") == dimension("kg m/s")
    True

    Raises
    ------
    PatternError
        The text is no product of powers.
    """
    powers: dict[str, int] = {}
    # of each open bracket: the sign before it; then the sign of the next factor
    text = unit.strip()
    signs, sign, at, wanted = [1], 1, 0, bool(text)
    while at < len(text):
        found = _TOKEN.match(text, at)
        if found is None:
            raise PatternError("unit", found=unit)
        at = found.end()
        word, digits, raised, mark = found.groups()
        if word:
            power = int(digits or (raised or "1").translate(_PLAIN))
            for base, of in dimension(_SI[word]) if word in _SI else ((word, 1),):
                if word != "1":
                    powers[base] = powers.get(base, 0) + signs[-1] * sign * power * of
            sign, wanted = 1, False
        elif mark == "/" and not wanted:
            sign, wanted = -1, True
        elif mark == "(":
            signs.append(signs[-1] * sign)
            sign, wanted = 1, True
        elif mark == ")" and len(signs) > 1 and not wanted:
            signs.pop()
        elif mark in ("·", "*") and not wanted:
            wanted = True
        else:
            raise PatternError("unit", found=unit)
    if len(signs) > 1 or wanted:
        raise PatternError("unit", found=unit)
    return tuple(sorted((base, power) for base, power in powers.items() if power))


def flow_unit(unit: str) -> str:
    """Unit of the rate of a quantity in the given unit."""
    return _named(f"{_factor(unit)}/s" if unit else "")


def effort_unit(unit: str) -> str:
    """Unit of the effort of a quantity in the given unit: watt per unit of flow."""
    return _named(f"J/{_factor(unit)}" if unit else "")


def _factor(unit: str) -> str:
    return f"({unit})" if re.search(r"[ /·*]", unit) else unit


def _named(unit: str) -> str:
    return next((name for name in _NAMED if dimension(name) == dimension(unit)), unit)
