"""Laws and the equations that they form, as values."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import eq
from typing import Any, cast, final

from ephs.operad.names import Path


@final
@dataclass(frozen=True, slots=True)
class Equation:
    """The two sides of a law, and the arguments of both.

    Printed, it shows both sides as trees; where they differ also the expression that makes it anew.

    Parameters
    ----------
    same
        What decides: equality of data, or an algebra's own equality or order.
    """

    left: Any
    right: Any
    law: str = ""
    inputs: tuple[object, ...] = ()
    same: Callable[[Any, Any], bool] = eq

    @property
    def holds(self) -> bool:
        """Whether the sides are equal."""
        return bool(self.same(self.left, self.right))

    @property
    def replay(self) -> str:
        """A Python expression that reproduces the equation after ``from ephs.operad import *``, with its algebras."""
        return f"law({self.law!r})({', '.join(map(_written, self.inputs))})"

    def __str__(self) -> str:
        left, right = (str(side).replace("\n", "\n  ") for side in (self.left, self.right))
        text = f"left\n  {left}\n{'=' if self.holds else '≠'} right\n  {right}"
        return text if self.holds or not self.law else f"{self.law}\n{text}\nagain by\n  {self.replay}"


@final
@dataclass(frozen=True, slots=True)
class Law:
    """A law: name, statement, domain, and the functions that form both sides.

    Parameters
    ----------
    name, statement
        For people.
    inputs
        What the equation is formed of, in order: ``"f"``, ``"g"``, ``"h"`` patterns, ``"a"``, ``"b"``,
        ``"c"`` names of boxes, ``"fillings"`` box -> pattern, ``"boxes"``, ``"junctions"``, ``"ports"`` old
        name -> new name. Laws of algebras also speak of an ``"algebra"``, ``"elements"`` of it by box, a ``"map"``,
        and of a pattern equal to f that lists its parts in another order, ``"again"``.
    equation
        Called with the inputs; gives the `Equation`.
    """

    name: str
    statement: str
    inputs: tuple[str, ...]
    equation: Callable[..., Equation]

    def __call__(self, *inputs: object) -> Equation:
        """Form both sides."""
        return replace(self.equation(*inputs), law=self.name, inputs=inputs)


def _written(value: object) -> str:
    """A value as Python writes it, with paths by what makes them."""
    match value:
        case Path():
            return f"Path.parse({str(value)!r})"
        case dict():
            entries = cast("dict[object, object]", value).items()
            return "{" + ", ".join(f"{_written(key)}: {_written(of)}" for key, of in entries) + "}"
        case _:
            return repr(value)
