"""Calling a compiled function through its address from inside another compiled function."""

from typing import Any, cast

from llvmlite import ir  # pyright: ignore[reportMissingTypeStubs]
from numba import types
from numba.core import cgutils
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


@intrinsic
def _call_staged(typingctx: Any, address: Any, arguments: Any) -> Any:
    """Call the staged function at ``address``; arrays are handed over as their place and their shape. Returns int64.

    Nothing checks that arguments fit: addresses come from `ephs.semantics.stage.Program` only.
    """
    if any(isinstance(kind, types.Array) and kind.layout != "C" for kind in arguments):
        raise TypeError("arrays of staged functions are contiguous")
    signature = types.int64(address, arguments)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word, unpacked = ir.IntType(64), cast("Any", cgutils).unpack_tuple
        passed: list[Any] = []
        for kind, value in zip(signature.args[1].types, unpacked(builder, args[1]), strict=True):
            if isinstance(kind, types.Array):
                array = context.make_array(kind)(context, builder, value)
                passed += [builder.ptrtoint(array.data, word), *unpacked(builder, array.shape)]
            else:
                passed.append(value)
        pointer = ir.FunctionType(word, [word] * len(passed)).as_pointer()
        return builder.call(builder.inttoptr(args[0], pointer), passed)

    return signature, codegen


call_staged: Any = _call_staged
"""The same for type checkers, which do not know that numba gives the first argument."""
