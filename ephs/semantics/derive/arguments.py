"""The arguments that all discrete relations have, as memory of known or unknown size."""

from dataclasses import dataclass
from typing import final

from ephs.semantics.stage.memory import Vector


@final
@dataclass(frozen=True, slots=True)
class Arguments:
    """Arguments of a relation after the first, which are dimensions."""

    scal: Vector
    p: Vector
    x0: Vector
    v: Vector
    e: Vector
    lam: Vector
    f: Vector
    c: Vector
    jac: Vector
    work: Vector
