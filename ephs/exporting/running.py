"""Exported mechanisms running in this process: many instances with separate memory."""

import ctypes
from typing import Any, Final, final

import numpy as np

from ephs.exporting.module import Exported
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.stage.objects import compiled

_POINTER: Final = ctypes.c_void_p
_CALLS: Final[dict[str, tuple[Any, ...]]] = {
    "start": (None, _POINTER),
    "parameters": (None, _POINTER, _POINTER),
    "inputs": (None, _POINTER, _POINTER),
    "advance": (ctypes.c_int64, _POINTER, ctypes.c_double),
    "time": (ctypes.c_double, _POINTER),
    "outputs": (ctypes.c_int64, _POINTER, _POINTER),
    "accelerations": (ctypes.c_int64, _POINTER, _POINTER),
}
"""Results and arguments of the functions of an exported mechanism."""


@final
class Instances:
    """A number of instances of one mechanism.

    Parameters
    ----------
    made
        The mechanism.
    count
        How many. Different instances may be advanced by different threads at once.

    Attributes
    ----------
    inputs, outputs
        (count, ·) forces that act, and what was read last.
    """

    def __init__(self, made: Exported, count: int = 1) -> None:
        self.made, self.count = made, count
        self._library = compiled(made.text)
        self._memory = np.zeros((count, made.bytes // 8))
        self.inputs = np.tile([each.start for each in made.inputs], (count, 1)).reshape(count, -1)
        self.outputs = np.zeros((count, len(made.outputs)))
        self._calls = {
            name: ctypes.CFUNCTYPE(result, *arguments)(self._library.address(f"{made.name}_{name}"))
            for name, (result, *arguments) in _CALLS.items()
        }
        self._memories = [row.ctypes.data for row in self._memory]
        self._forces = [row.ctypes.data for row in self.inputs]
        self._values = [row.ctypes.data for row in self.outputs]
        for number in range(count):
            self.start(number)

    def start(self, number: int = 0, parameters: Array | None = None) -> None:
        """Begin at the initial state; ``parameters`` override the model's."""
        self._calls["start"](self._memories[number])
        if parameters is not None:
            given = np.ascontiguousarray(parameters, dtype=np.float64)
            self._calls["parameters"](self._memories[number], given.ctypes.data)
        self.inputs[number] = [each.start for each in self.made.inputs]

    def advance(self, until: float, number: int = 0) -> int:
        """Take steps to a time in s under `inputs`, and read the outputs; 0, or the status of a failed step."""
        memory = self._memories[number]
        self._calls["inputs"](memory, self._forces[number])
        return int(self._calls["advance"](memory, until)) or self.read(number)

    def read(self, number: int = 0) -> int:
        """Read the outputs; 0, or a status."""
        return int(self._calls["outputs"](self._memories[number], self._values[number]))

    def time(self, number: int = 0) -> float:
        """Time in s."""
        return float(self._calls["time"](self._memories[number]))

    def accelerations(self, number: int = 0) -> Array:
        """Accelerations of the joints of the spanning tree.

        Raises
        ------
        ArithmeticError
            They cannot be evaluated; with the status that the header explains.
        """
        values = np.zeros(self.made.accelerations)
        if status := int(self._calls["accelerations"](self._memories[number], values.ctypes.data)):
            raise ArithmeticError(status)
        return values
