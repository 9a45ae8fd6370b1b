"""Kernels as plain Python: what the compiled ones call by address is found by address here, too.

``NUMBA_DISABLE_JIT=1`` leaves kernels uncompiled. Two things remain that only compiled code can do, to have an address
and to be called through it; `install` gives both to plain functions.
"""

import ctypes
from collections.abc import Callable
from importlib import import_module
from typing import Any

WORD, NUMBER = ctypes.POINTER(ctypes.c_int64), ctypes.POINTER(ctypes.c_double)
PROTOTYPE = ctypes.CFUNCTYPE(ctypes.c_int64, WORD, *[NUMBER] * 10)


class Addresses:
    """Plain functions by the addresses that they were given."""

    def __init__(self) -> None:
        self.functions: dict[int, Callable[..., Any]] = {}
        self.kept: list[Any] = []  # a callback that is freed leaves its address behind

    def cfunc_kernel(self, _signature: Any, *_more: Any) -> Callable[[Callable[..., Any]], Any]:
        """In place of `ephs.semantics.spaces.jit.cfunc_kernel`."""

        def decorate(function: Callable[..., Any]) -> Any:
            callback = PROTOTYPE(lambda *pointers: int(function(*pointers)))
            address = ctypes.cast(callback, ctypes.c_void_p).value
            assert address is not None
            self.functions[address] = function
            self.kept.append(callback)
            return type("Addressed", (), {"address": address})

        return decorate

    def call_kernel(self, address: Any, dims: int, *arrays: int) -> int:
        """In place of `ephs.semantics.calling.call_kernel`: addresses of arrays in, a status out."""
        pointers = ctypes.cast(dims, WORD), *(ctypes.cast(array, NUMBER) for array in arrays)
        function = self.functions.get(int(address)) or PROTOTYPE(int(address))
        return int(function(*pointers))

    def call_staged(self, address: Any, arguments: tuple[Any, ...]) -> int:
        """In place of `ephs.semantics.calling.call_staged`: arrays by their place and shape."""
        parts = [
            part
            for value in arguments
            for part in ([value.ctypes.data, *value.shape] if hasattr(value, "ctypes") else [int(value)])
        ]
        return int(ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * len(parts))(int(address))(*parts))


def install() -> None:
    """Make all kernels callable that are loaded from now on. Their arithmetic is IEEE's, without warnings."""
    import numpy as np

    addresses = Addresses()
    jit: Any = import_module("ephs.semantics.spaces.jit")
    assert not jit.compiling(), "set NUMBA_DISABLE_JIT=1"
    jit.cfunc_kernel = addresses.cfunc_kernel
    calling: Any = import_module("ephs.semantics.calling")
    calling.call_kernel = addresses.call_kernel
    calling.call_staged = addresses.call_staged
    np.seterr(all="ignore")
