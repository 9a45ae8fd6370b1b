"""Identity of users' functions: their code, and the values that it reads and does not write.

Two functions of one identity give the same numbers, unless they read what changes: files, lists, attributes of objects.
"""

import dis
import hashlib
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import partial
from types import FunctionType, MethodType
from typing import Any, Final

import numpy as np

from ephs.semantics.derive.recording import codes_of, values_read
from ephs.semantics.stage.known import PACKAGE, code_digest

_WRITES: Final = ("STORE_DEREF", "STORE_GLOBAL", "DELETE_DEREF", "DELETE_GLOBAL")


def function_digest(function: object) -> str:
    """Digest of a callable: of what it computes, and not of where it is written or of what it has counted."""
    made = hashlib.blake2b(digest_size=8)
    for text in _told(function, set()):
        made.update(f"{text}\0".encode())
    return made.hexdigest()


def _told(value: object, seen: set[int]) -> Iterator[str]:
    """Texts that differ where two values do, of values that do not change; of others their class."""
    yield type(value).__qualname__
    if id(value) in seen:
        return
    match value:
        case None | bool() | int() | float() | complex() | str() | bytes() | np.generic():
            yield repr(value)
        case np.ndarray():
            yield f"{value.dtype} {value.shape} {hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()}"
        case tuple():
            for part in value:
                yield from _told(part, seen)
        case FunctionType():
            seen.add(id(value))
            yield from _of_function(value, seen)
        case partial():
            yield from _told((value.func, value.args, *sorted(value.keywords.items())), seen)
        case MethodType():
            yield from _told((value.__func__, value.__self__), seen)
        case type():
            yield f"{value.__module__}.{value.__qualname__}"
        case _:
            seen.add(id(value))
            kind: Any = type(value)
            yield str(getattr(value, "__qualname__", ""))
            if is_dataclass(value) and kind.__dataclass_params__.frozen:
                for each in fields(value):
                    yield from _told(getattr(value, each.name), seen)
            if callable(value) and isinstance(kind.__call__, FunctionType):
                yield from _told(kind.__call__, seen)


def _of_function(function: FunctionType, seen: set[int]) -> Iterator[str]:
    """Its code and defaults, and what it closes over; of globals, functions of its own module and plain values."""
    instructions = [each for code in codes_of(function.__code__) for each in dis.get_instructions(code)]
    written = {each.argval for each in instructions if each.opname in _WRITES}
    changes = any(each.opname == "STORE_SUBSCR" for each in instructions)
    module, closed = function.__module__, function.__code__.co_freevars
    ours = module.partition(".")[0] == PACKAGE  # whose version is told
    yield code_digest(function.__code__)
    for name, found in sorted(values_read(function).items()):
        own = name in closed or not (ours or (isinstance(found, FunctionType | type) and found.__module__ != module))
        if own and name not in written and not (changes and isinstance(found, np.ndarray)):
            yield name
            yield from _told(found, seen)
    yield from _told((function.__defaults__, *sorted((function.__kwdefaults__ or {}).items())), seen)
