"""Calling a compiled function through its address from inside another compiled function."""

from typing import Any

from llvmlite import ir  # pyright: ignore[reportMissingTypeStubs]
from numba import types
from numba.extending import intrinsic


@intrinsic
def call_kernel(
    typingctx: Any,
    address: Any,
    dims: Any,
    a: Any,
    b: Any,
    c: Any,
    d: Any,
    e: Any,
    f: Any,
    g: Any,
    h: Any,
    i: Any,
    j: Any,
) -> Any:
    """Call the function at ``address``, whose eleven arguments are the addresses of arrays; returns its int64.

    The signature is that of `ephs.semantics.kernel_table`. Nothing checks it: addresses come from there only.
    """
    signature = types.int64(*[types.intp] * 12)

    def codegen(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        word = ir.IntType(64)
        pointer = ir.FunctionType(word, [word] * 11).as_pointer()
        return builder.call(builder.inttoptr(args[0], pointer), args[1:])

    return signature, codegen
