"""Prescribed motions of a scene file, and their numbers by path."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.errors import shown
from ephs.mechanics.scene.schema_numbers import EntryTable, Number, Series, key
from ephs.solve.posing.errors import OptionError
from ephs.solve.posing.motion_law import HarmonicMotion, MotionLaw, PolynomialMotion, TabulatedMotion


class MotionEntry(EntryTable):
    """A prescribed motion: the change of the coordinate from its initial value, in one of four forms."""

    rate: Number | None = key("constant rate of the single degree of freedom, rad/s or m/s", None)
    polynomial: Series | None = key(
        "coefficients c₁, c₂, … of c₁ t + c₂ t² + …; rad/s, rad/s², … or m/s, m/s², …", None
    )
    amplitude: Number | None = key("amplitude A of the harmonic A sin(2π f t + φ), rad or m", None)
    frequency: Number | None = key("frequency f of the harmonic, Hz", None)
    phase: Number | None = key("phase φ of the harmonic, rad; default: 0", None)
    times: Series | None = key("ascending times of a table, s; a spline of fifth order, at rest before and after", None)
    displacements: Series | None = key("displacements at these times, rad or m", None)


STILL: Final = PolynomialMotion((0.0,))
_FORMS: Final[tuple[tuple[str, Callable[..., MotionLaw]], ...]] = (
    ("rate", lambda rate: PolynomialMotion((rate,))),
    ("polynomial", lambda polynomial: PolynomialMotion(tuple(polynomial))),
    ("amplitude frequency", HarmonicMotion),
    ("amplitude frequency phase", HarmonicMotion),
    ("times displacements", lambda times, displacements: TabulatedMotion(tuple(times), tuple(displacements))),
)
"""Keys of a motion, and what they make."""


def law_of(table: Checked[MotionEntry]) -> MotionLaw:
    """The motion law of a table; rest, and a fault, if the table is invalid."""
    given = {name: value for name, value in table.entry if value is not None}
    make = next((make for keys, make in _FORMS if {*keys.split()} == given.keys()), None)
    if make is None:
        table.fault("motion form", found=", ".join(sorted(given)) or "an empty table")
        return STILL
    try:
        return make(**given)
    except OptionError as error:
        table.fault("motion number", error.key, shown(error.found), expected=error.expected)
        return STILL


def changed(of: MotionLaw | None, key: str, value: float) -> MotionLaw:
    """The motion law with another one of its `numbers`; a constant rate has no others."""
    return replace(of, **{key: value}) if isinstance(of, HarmonicMotion) else PolynomialMotion((value,))
