"""Recording: a plain Python function of numbers, called with recorded values, leaves a tape.

What branches on its arguments, or turns them into floats, cannot be recorded; the message names the line.
"""

import math
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np

from ephs.semantics.derive.tape import Recorder, Tape, quarter


@final
class Untraceable(TypeError):
    """A function that needs the values of its arguments.

    Parameters
    ----------
    line
        Where, as "function, file:line"; empty where it is not known.
    """

    def __init__(self, why: str, line: str = "") -> None:
        super().__init__(f"{line}: {why}" if line else why)
        self.why: str = why
        self.line: str = line


@final
@dataclass(frozen=True, slots=True)
class Recording:
    """A function's tape, and the numbers that met its arguments in the order in which they did."""

    tape: Tape
    parameters: tuple[float, ...]


def record(function: Callable[..., Any], arguments: Mapping[str, int | None]) -> Recording:
    """Call a function with recorded values.

    Parameters
    ----------
    arguments
        Name -> how many numbers a vector has, None for a number.

    Raises
    ------
    Untraceable
        The function needs numbers, or does not return real ones.
    """
    recorder = Recorder()
    given: dict[str, Any] = {}
    count = 0
    for name, size in arguments.items():
        entries = [_input(recorder, count + i) for i in range(1 if size is None else size)]
        count += len(entries)
        given[name] = entries[0] if size is None else _array(entries)
    try:
        out = np.asarray(_recordable(function)(**given), dtype=object)
    except Untraceable as error:
        raise Untraceable(error.why, error.line or _line(error)) from error
    except Exception as error:  # a user's function may raise anything for arguments that are not numbers
        raise Untraceable(str(error) or type(error).__name__, _line(error)) from error
    if any(isinstance(entry, (str, bytes, complex)) for entry in out.flat):
        raise Untraceable(f"the function returns {out.flat[0]!r}, which is no real number", _defined(function))
    outputs = tuple(_place(entry, recorder) for entry in out.flat)
    tape = Tape(tuple(recorder.operations), outputs, out.shape, count, len(recorder.parameters))
    return Recording(tape, tuple(recorder.parameters))


def _input(recorder: Recorder, number: int) -> "Recorded":
    return Recorded(recorder.place("input", (), float(number)), recorder)


def _array(entries: list["Recorded"]) -> Any:
    out = np.empty(len(entries), dtype=object)
    out[:] = entries
    return out


def _defined(function: Callable[..., Any]) -> str:
    code = getattr(function, "__code__", None)
    return f"{code.co_qualname}, {Path(code.co_filename).name}:{code.co_firstlineno}" if code is not None else ""


def _line(error: BaseException) -> str:
    """Innermost line of the called function outside this file and NumPy."""
    found, entry = "", error.__traceback__
    while entry is not None:
        code = entry.tb_frame.f_code
        if code.co_filename != __file__ and not code.co_filename.startswith(_NUMPY):
            found = f"{code.co_qualname}, {Path(code.co_filename).name}:{entry.tb_lineno}"
        entry = entry.tb_next
    return found


_NUMPY: Final = str(Path(np.__file__).parent)


def _place(value: Any, recorder: Recorder) -> int:
    """Position of a value on the tape; a number becomes a parameter, but 0 and ±1."""
    if isinstance(value, Recorded):
        if value.recorder is not recorder:
            raise Untraceable("a recorded value is used in another function")
        return value.place
    if isinstance(value, np.ndarray):
        raise Untraceable("an array where a number is expected")
    if isinstance(value, complex):
        raise Untraceable(f"{value!r} is no real number")
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise Untraceable(f"{value!r} is not a number") from error
    return recorder.number(number)


def _operation(name: str, *, swapped: bool = False) -> Any:
    def method(self: "Recorded", other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented  # the array takes its entries one by one
        there = _place(other, self.recorder)
        return self.applied(name, *((there, self.place) if swapped else (self.place, there)))

    return method


def _function(name: str) -> Any:
    def method(self: "Recorded") -> "Recorded":
        return self.applied(name, self.place)

    return method


@final
class Recorded:
    """A value on a tape; it answers to operators and, by method, to NumPy's functions."""

    __slots__ = ("place", "recorder")

    def __init__(self, place: int, recorder: Recorder) -> None:
        self.place, self.recorder = place, recorder

    def applied(self, name: str, *places: int, number: Any = 0.0) -> "Recorded":
        """The result of an operation."""
        return Recorded(self.recorder.place(name, places, number), self.recorder)

    __add__ = _operation("+")
    __radd__ = _operation("+", swapped=True)
    __sub__ = _operation("-")
    __rsub__ = _operation("-", swapped=True)
    __mul__ = _operation("*")
    __rmul__ = _operation("*", swapped=True)
    __truediv__ = _operation("/")
    __rtruediv__ = _operation("/", swapped=True)

    def __pow__(self, other: Any) -> "Recorded":
        exponent = quarter(other)
        if exponent is not None:
            return self.applied("power", self.place, number=exponent)
        return self.applied("exponential", self.place, _place(other, self.recorder))

    def __rpow__(self, other: Any) -> "Recorded":
        return self.applied("exponential", _place(other, self.recorder), self.place)

    def __pos__(self) -> "Recorded":
        return self

    __neg__ = _function("negative")
    __abs__ = fabs = absolute = _function("absolute")
    # the names under which NumPy's functions look for methods of objects
    sin, cos, tan = (_function(name) for name in ("sin", "cos", "tan"))
    arcsin, arccos, arctan = (_function(name) for name in ("asin", "acos", "atan"))
    sinh, cosh, tanh = (_function(name) for name in ("sinh", "cosh", "tanh"))
    arcsinh, arccosh, arctanh = (_function(name) for name in ("asinh", "acosh", "atanh"))
    sqrt, exp, log, expm1, log1p = (_function(name) for name in ("sqrt", "exp", "log", "expm1", "log1p"))
    sign, sinhc = (_function(name) for name in ("sign", "sinhc"))
    turn_ratio, turn_curve = (_function(name) for name in ("turn_ratio", "turn_curve"))
    turn_curve_slope = _function("turn_curve_slope")

    def square(self) -> "Recorded":
        """The square, as NumPy's function of this name."""
        return self.applied("power", self.place, number=2.0)

    def conjugate(self) -> "Recorded":
        """The value itself, which is real."""
        return self

    def arctan2(self, other: Any) -> "Recorded":
        """The angle of a point, as NumPy's function of this name."""
        return self.applied("atan2", self.place, _place(other, self.recorder))

    def choose(self, one: Any, other: Any) -> "Recorded":
        """The first where this is positive, else the other."""
        return self.applied("choose", self.place, _place(one, self.recorder), _place(other, self.recorder))

    def squared_turn(self, x: Any, y: Any, z: Any) -> "Recorded":
        """The squared angle of the rotation with this quaternion."""
        return self.applied("squared turn", self.place, *(_place(each, self.recorder) for each in (x, y, z)))

    def root(self, function: Callable[..., Any], low: Any, high: Any, given: Sequence[Any]) -> "Recorded":
        """The root of an increasing function between two ends; the function takes the unknown and the given numbers."""

        def called(x: Any, more: Sequence[Any]) -> Any:
            return function(x, *more)

        found = record(called, {"x": None, "more": len(given)})
        numbers = (low, high, *given, *found.parameters)
        return self.applied("root", *(_place(each, self.recorder) for each in numbers), number=found.tape)

    def hypot(self, other: Any) -> "Recorded":
        """The length of a vector, as NumPy's function of this name."""
        there = self.recorder.place("power", (_place(other, self.recorder),), 2.0)
        total = self.recorder.place("+", (self.square().place, there))
        return self.applied("sqrt", total)

    def _refuse(self, *_: Any) -> Any:
        raise Untraceable("the function needs the value of an argument")

    __bool__ = __float__ = __int__ = __complex__ = __index__ = _refuse
    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _refuse
    __hash__ = object.__hash__

    def __repr__(self) -> str:
        return f"Recorded({self.place})"


def _mathematics() -> dict[str, Any]:
    """Functions of `math` that pass recorded values on, by name."""
    renamed = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "asinh": "arcsinh", "acosh": "arccosh"}
    renamed |= {"atanh": "arctanh", "pow": "power"}
    same = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "expm1", "log1p", "fabs", "hypot")
    out = {name: getattr(np, renamed.get(name, name)) for name in (*same, *renamed)}
    out["atan2"] = np.arctan2
    return out


_BY_IDENTITY = {id(getattr(math, name)): replacement for name, replacement in _mathematics().items()}
_MODULE = types.SimpleNamespace(**{**vars(math), **_mathematics()})
DEPTH = 8
"""Depth of functions to which `math` is looked for."""


def _recordable(function: Callable[..., Any], depth: int = 0) -> Callable[..., Any]:
    """The function, and those it calls, with functions of `math` replaced by ones that take recorded values too."""
    if not isinstance(function, types.FunctionType) or depth > DEPTH:
        return function
    names = {n: function.__globals__[n] for n in function.__code__.co_names if n in function.__globals__}
    used = {n: new for n, old in names.items() if (new := _replaced(old, depth)) is not old}
    cells = function.__closure__ or ()
    closed = [_replaced(cell.cell_contents, depth) if filled(cell) else None for cell in cells]
    same = all(not filled(cell) or new is cell.cell_contents for cell, new in zip(cells, closed, strict=True))
    if not used and same:
        return function
    closure = tuple(types.CellType(new) if filled(cell) else cell for cell, new in zip(cells, closed, strict=True))
    namespace = {**function.__globals__, **used}
    copy = types.FunctionType(function.__code__, namespace, function.__name__, function.__defaults__, closure)
    copy.__kwdefaults__ = function.__kwdefaults__
    return copy


def _replaced(value: Any, depth: int) -> Any:
    if value is math:
        return _MODULE
    if isinstance(value, types.BuiltinFunctionType):
        return _BY_IDENTITY.get(id(value), value)
    return _recordable(value, depth + 1) if isinstance(value, types.FunctionType) else value


def codes_of(code: types.CodeType) -> Iterator[types.CodeType]:
    """A code, and those of the functions that are written inside it."""
    yield code
    for part in code.co_consts:
        if isinstance(part, types.CodeType):
            yield from codes_of(part)


def values_read(function: types.FunctionType) -> dict[str, Any]:
    """By name, the globals that a function names, and the variables that it closes over, as far as they exist."""
    names = {name: None for code in codes_of(function.__code__) for name in code.co_names}
    found = {name: function.__globals__[name] for name in names if name in function.__globals__}
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    return found | {name: cell.cell_contents for name, cell in cells if filled(cell)}


def filled(cell: types.CellType) -> bool:
    """Whether a variable that a function closes over has its value yet."""
    try:
        _ = cell.cell_contents
    except ValueError:
        return False
    return True
