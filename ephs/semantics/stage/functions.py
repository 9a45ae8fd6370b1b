"""The elementary functions as a program, for callers from C: `ephs_sin` and so on, the bits of every staged program."""

from typing import Final

from ephs.semantics.stage.elementary import atan2, cos, exp, log, sin
from ephs.semantics.stage.entries import Entry
from ephs.semantics.stage.programs import Program
from ephs.semantics.stage.records import real

ELEMENTARY: Final = Program(
    "ephs",
    sin=Entry(sin, x=real()),
    cos=Entry(cos, x=real()),
    exp=Entry(exp, x=real()),
    log=Entry(log, x=real()),
    atan2=Entry(atan2, y=real(), x=real()),
)
