"""Units in words, such as ``N m s/rad``, as dimensions."""

import re
from collections.abc import Mapping
from functools import lru_cache
from itertools import zip_longest
from typing import Final

from ephs.mechanics.scene.element import NumberForm

_SYMBOLS: Final[Mapping[str, tuple[int, ...]]] = {
    "1": (0, 0, 0, 0),
    "rad": (0, 0, 0, 0),
    "K": (0, 0, 0, 0),
    "C": (0, 0, 0, 0),
    "m": (1, 0, 0, 0),
    "kg": (0, 1, 0, 0),
    "s": (0, 0, 1, 0),
    "Hz": (0, 0, -1, 0),
    "A": (0, 0, -1, 0),
    "N": (1, 1, -2, 0),
    "J": (2, 1, -2, 0),
    "V": (2, 1, -2, 0),
    "W": (2, 1, -3, 0),
    "Pa": (-1, 1, -2, 0),
    "Ω": (2, 1, -1, 0),
    "Wb": (2, 1, -1, 0),
    "H": (2, 1, 0, 0),
    "F": (-2, -1, 2, 0),
    "q": (0, 0, 0, 1),
    "qᵢ": (0, 0, 0, 0, 1),
}
"""Symbol -> exponents of length, mass, time, of the coordinate of the joint that a table names first, of each joint's.

Temperatures, charges and angles are the same in all units.
"""
_FACTOR = re.compile(r"([^\W\d⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+|1)(⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]+)?$")
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


@lru_cache(maxsize=256)
def dimension(unit: str) -> NumberForm:
    """The dimension of a unit: symbols with blanks between, powers as ², one solidus before a symbol or a parenthesis.

    Raises
    ------
    ValueError
        It is not such a text.
    """
    above, _, below = unit.partition("/")
    if below.startswith("(") and below.endswith(")"):
        below = below[1:-1]
    elif len(below.split()) > 1:
        raise ValueError(f'"{unit}": write several symbols after the solidus in parentheses')
    total = [0] * 5
    for sign, part in ((1, above), (-1, below)):
        for factor in part.split():
            found = _FACTOR.match(factor)
            if found is None or found[1] not in _SYMBOLS:
                raise ValueError(f'"{factor}" in "{unit}": the known symbols are {", ".join(_SYMBOLS)}')
            power = sign * int((found[2] or "1").translate(_RAISED))
            total = [x + power * y for x, y in zip_longest(total, _SYMBOLS[found[1]], fillvalue=0)]
    length, mass, time, first, others = total
    return NumberForm(
        energy=mass,
        length=length - 2 * mass,
        time=time + 2 * mass,
        first=first,
        others=others,
        each=0 if others else -1,
    )


def written(unit: str) -> str:
    """A unit for a page: that of a coordinate is of an angle or a length."""
    if re.search(r"\bq\b", unit) is None:
        return "" if unit == "1" else unit
    return " or ".join(re.sub(r"\bq\b", of, unit) for of in ("rad", "m"))
