"""Exported mechanisms in the memory of this process."""

import ctypes
from functools import lru_cache

import numpy as np

from ephs.semantics.stage.llvm import compile_text, load

POINTER = ctypes.c_void_p


@lru_cache(maxsize=4)
def library_of(text):
    """The machine code of a module, which keeps no state of its own: runs of one text share it."""
    return load(compile_text(text))


class Run:
    """An exported mechanism in the memory of this process."""

    def __init__(self, made) -> None:
        self.made, self.library = made, library_of(made.text)
        self.memory = np.zeros(made.bytes // 8)
        self.call("start", None)

    def call(self, name, result=ctypes.c_int64, *arguments):
        kinds = [ctypes.c_double if isinstance(each, float) else POINTER for each in arguments]
        function = ctypes.CFUNCTYPE(result, POINTER, *kinds)(self.library.address(f"{self.made.name}_{name}"))
        values = [each if isinstance(each, float) else each.ctypes.data for each in arguments]
        return function(self.memory.ctypes.data, *values)

    def outputs(self):
        values = np.zeros(len(self.made.outputs))
        assert self.call("outputs", ctypes.c_int64, values) == 0
        return dict(zip((each.name for each in self.made.outputs), values, strict=True))
