"""Prescribed motions of a scene file, and their numbers by path."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from ephs.mechanics.scene.errors import Fault, fault, shown
from ephs.mechanics.scene.schema import MotionEntry
from ephs.solve.errors import OptionError
from ephs.solve.motion_law import HarmonicMotion, MotionLaw, PolynomialMotion, TabulatedMotion

STILL: Final = PolynomialMotion((0.0,))
_KEYS: Final[Mapping[str, tuple[str, ...]]] = {
    "rate": ("rate",),
    "polynomial": ("polynomial",),
    "harmonic": ("amplitude", "frequency", "phase"),
    "table": ("times", "displacements"),
}
"""Form of a motion -> its keys."""
_OPTIONAL: Final = {"phase"}
_MAKE: Final[Mapping[str, Callable[[Any], MotionLaw]]] = {
    "rate": lambda of: PolynomialMotion((of.rate,)),
    "polynomial": lambda of: PolynomialMotion(tuple(of.polynomial)),
    "harmonic": lambda of: HarmonicMotion(of.amplitude, of.frequency, of.phase or 0.0),
    "table": lambda of: TabulatedMotion(tuple(of.times), tuple(of.displacements)),
}


def law_of(entry: MotionEntry, key: str, faults: list[Fault]) -> MotionLaw:
    """The motion law of a table; rest, and a fault, if the table is invalid."""
    given = {name for keys in _KEYS.values() for name in keys if getattr(entry, name) is not None}
    forms = [form for form, keys in _KEYS.items() if given <= set(keys) and given >= set(keys) - _OPTIONAL]
    if not forms:
        faults.append(fault("motion form", key, ", ".join(sorted(given)) or "an empty table"))
        return STILL
    try:
        return _MAKE[forms[0]](entry)
    except OptionError as error:
        faults.append(fault("motion number", f"{key}.{error.key}", shown(error.found), expected=error.expected))
        return STILL


def law_from(data: Any) -> MotionLaw | None:
    """The motion law of the text of a scene: a number, of older files, is a constant rate."""
    if data is None or isinstance(data, int | float):
        return None if data is None else PolynomialMotion((float(data),))
    of: dict[str, Any] = data
    if "coefficients" in of:
        return PolynomialMotion(tuple(of["coefficients"]))
    return (
        HarmonicMotion(**of) if "amplitude" in of else TabulatedMotion(tuple(of["times"]), tuple(of["displacements"]))
    )


def first_rate(law: MotionLaw | None) -> float | None:
    """The rate of a motion law at the start; None without."""
    return None if law is None else law.rate(0.0)


def number_of_law(of: MotionLaw | None, key: str) -> float | None:
    """A number of a motion law by its name; None where it has none of that name."""
    return None if of is None else dict(of.numbers).get(key)


def changed(of: MotionLaw | None, key: str, value: float) -> MotionLaw:
    """The motion law with another number."""
    if key == "rate" or not isinstance(of, HarmonicMotion):
        return PolynomialMotion((value,))
    numbers = {**dict(of.numbers), key: value}
    return HarmonicMotion(numbers["amplitude"], numbers["frequency"], numbers["phase"])
