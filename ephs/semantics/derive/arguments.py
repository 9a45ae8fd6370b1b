"""The arguments that all discrete relations have, as memory of known or unknown size."""

from dataclasses import dataclass
from typing import Any, final

from ephs.semantics.stage.kinds import Atom, Kind
from ephs.semantics.stage.memory import Integers, Vector

__all__ = ["Arguments", "pointer"]

ANY = 2**40
"""A size beyond all: that of memory whose size the program is not told."""


@final
@dataclass(frozen=True, slots=True)
class Arguments:
    """The arguments of a relation after the first, which are dimensions that it knows."""

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


def pointer(atom: Atom, size: int | None) -> Kind:
    """An argument that is the address of so many numbers."""

    def join(parts: list[Any]) -> Vector | Integers:
        kind = Vector if atom == "reals" else Integers
        return kind(parts[0], 0, ANY if size is None else size)

    def split(value: Any, _trail: object) -> tuple[Any, ...] | None:
        return (value,) if size is None or len(value) == size else None

    return Kind(f"an array of {'any number of' if size is None else size} numbers", (atom,), split, join)
