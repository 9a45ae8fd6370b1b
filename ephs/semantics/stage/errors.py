"""The one exception of this room and the texts that it carries."""

import sys
from pathlib import Path
from typing import Final, final

TEXTS: Final = {
    "branch": "{where}: a condition that is not known while staging decides {what}; write on.when(…) for statements, "
    "on.select(…) for values, on.both, on.either and on.negate for and, or and not.",
    "number": "{where}: {what} wants a known number, but this one is known only when the program runs; {advice}.",
    "equality": "{where}: real numbers are not compared for equality; compare with < or >, integers with on.same(…).",
    "operand": "{where}: {what} of {left} and {right}; both sides are real numbers of one evaluation, or both "
    "integers. An integer becomes real by on.real(…).",
    "stranger": "{where}: a number of {found} is used in {expected}; hand it over as an argument.",
    "index": "{where}: index {index} of {what}, expected 0 … {last}.",
    "shape": "{where}: field {field} has shape {expected}, found {found}.",
    "field": "{where}: {record} has no field {found}; its fields are {expected}.",
    "recursion": "{where}: the staged function {found} calls itself; write on.loop(…) or on.repeat(…).",
    "endless": "{where}: more than {limit} operations; is a Python loop without end, or unrolled over too much? "
    "Write on.loop(…).",
    "result": "{where}: returns {found}, expected None, a real number, an integer or a condition.",
    "parameters": "{where}: takes {expected}, found {found}.",
    "argument": "{where}: argument {argument} is {found}, expected {expected}.",
    "overlap": "{where}: arguments {argument} and {other} share memory; give arrays of their own.",
    "passive": "{where}: a number with a derivative is stored where derivatives are not kept; "
    "make that argument active.",
    "unknown": "{where}: has no argument {found}, expected some of {expected}.",
    "shared": "{where}: numbers that differ between members are stored in memory that they share.",
    "unrolled": "{where}: {what} is not known while unrolling; give the numbers that it depends on, or hand the array "
    "over as an argument.",
    "entries": "program {where}: found {found}, expected at least one function, each under a Python name.",
    "level": "{where}: an optimisation level is {found}, expected one of {expected}.",
    "machine": "{where}: LLVM refuses the program: {found}",
    "reached": "{where}: a function that is called by its address takes {expected}, found {found}.",
    "unreached": "{where}: a function is called by its address with {what}; only machine code and the float run can, "
    "with numbers and with memory of their own.",
    "undecided": "{where}: {what} depends on a condition that has no single answer {found}; write on.select(…).",
}
_HERE: Final = str(Path(__file__).parent)


@final
class StageError(TypeError):
    """A staged function, or a call of one, that cannot be staged.

    Parameters
    ----------
    fault
        The key of the text.
    **details
        What the text names. `where`, left out, is the line of the staged function that is running.
    """

    def __init__(self, fault: str, /, **details: object) -> None:
        details.setdefault("where", _place())
        super().__init__(TEXTS[fault].format(**details))
        self.fault: str = fault
        self.details: dict[str, object] = details

    def __reduce__(self) -> tuple[object, ...]:
        return (_rebuild, (self.fault, {name: str(value) for name, value in self.details.items()}))


def _rebuild(fault: str, details: dict[str, object]) -> StageError:
    return StageError(fault, **details)


def _place() -> str:
    """Name the innermost running function outside of this room, and its line."""
    frame = sys._getframe(1)  # pyright: ignore[reportPrivateUsage]
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_HERE):
        frame = frame.f_back
    return f"{frame.f_code.co_qualname}, {Path(frame.f_code.co_filename).name}:{frame.f_lineno}"
