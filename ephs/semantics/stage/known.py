"""Disk cache of staging, keyed by a function's closure and the digest of the package's sources.

A function of this package is its place in the sources and what it closes over; so a result is kept under these, and
holds as long as no source changes. What closes over anything else, such as a user's function, is staged anew.
"""

import dataclasses
import hashlib
import json
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from enum import Enum
from functools import cache, partial
from pathlib import Path
from types import CodeType, FunctionType, MethodType
from typing import Any, Final, Protocol, TypeVar, cast, final, runtime_checkable

import numpy as np

from ephs.semantics.stage.store import STORE

T = TypeVar("T")
PACKAGE: Final = __name__.partition(".")[0]
ROOT: Final = Path(__file__).resolve().parents[2]


@runtime_checkable
class Made(Protocol):
    """An object of this package that is determined by its class and by `made_of`."""

    @property
    def made_of(self) -> object:
        """Arguments that it was made from."""
        ...


@final
class _Foreign(Exception):
    """A value that the sources of this package do not determine."""


def known(of: object, make: Callable[[], T]) -> T:
    """Return the cached text of a value, else make and store it.

    Parameters
    ----------
    of
        What the result is made of, besides the sources of this package.
    make
        Makes the result: lists and mappings (by texts) of texts and numbers. It is also called where `of` holds
        something foreign, or the disk fails.
    """
    try:
        told = _Teller().tell(of)
    except (_Foreign, RecursionError):
        return make()
    name = hashlib.sha256("\0".join([sources(ROOT), sys.version, np.__version__, told]).encode()).hexdigest()[:32]
    content = STORE.read(f"{name}.json")
    if content is not None:
        with suppress(ValueError):
            return cast("T", json.loads(content))
    made = make()
    STORE.write(f"{name}.json", json.dumps(made).encode())
    return made


@cache
def sources(root: Path) -> str:
    """Return the digest of all Python files below a folder, names and contents; a file is read once in a process."""
    digest = hashlib.sha256()
    for file in sorted(root.rglob("*.py")):
        digest.update(f"{file.relative_to(root).as_posix()}\0".encode())
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


@final
class _Teller:
    """Serialiser of values as text. Repeated values are referred to by number, which also ends cycles."""

    def __init__(self) -> None:
        self._numbers: dict[int, int] = {}
        self._alive: list[object] = []

    def tell(self, value: object) -> str:
        """Return a text that differs where two values do.

        Raises
        ------
        _Foreign
            The value is not made of plain values, and of functions and classes of this package.
        """
        match value:
            case Enum():
                return f"{self._place(type(value))}.{value.name}"
            case None | bool() | int() | str() | bytes():
                return repr(value)
            case float():
                return float(value).hex()
            case _:
                pass
        if (number := self._numbers.get(id(value))) is not None:
            return f"#{number}"
        self._numbers[id(value)] = len(self._numbers)
        self._alive.append(value)
        return self._compound(value)

    def _compound(self, value: object) -> str:
        match value:
            case tuple():
                return f"tuple({self._all(cast('tuple[object, ...]', value))})"
            case list():
                return f"list({self._all(cast('list[object]', value))})"
            case Mapping():
                pairs = cast("Mapping[object, object]", value).items()
                return f"{{{self._all([part for pair in pairs for part in pair])}}}"
            case np.ndarray() if not value.dtype.hasobject:
                array = cast("np.ndarray[Any, Any]", value)
                return f"array({array.dtype.str},{array.shape},{hashlib.sha256(array.tobytes()).hexdigest()})"
            case FunctionType():
                try:
                    cells = [cell.cell_contents for cell in value.__closure__ or ()]
                except ValueError:  # its closure variables do not exist yet
                    raise _Foreign from None
                code = value.__code__  # of functions of one place in the sources, such as two in one line
                at = f"{code.co_firstlineno}:{code_digest(code)}"
                return f"{self._place(value)}@{at}({self._all([cells, value.__defaults__, value.__kwdefaults__])})"
            case partial():
                made = cast("partial[object]", value)
                return f"partial({self._all([made.func, made.args, made.keywords])})"
            case MethodType():
                return f"method({self._all([value.__func__, value.__self__])})"
            case type():
                return self._class(value)
            case _:
                pass
        kind = type(value)
        if isinstance(value, Made):
            return f"{self._place(kind)}({self.tell(value.made_of)})"
        if not dataclasses.is_dataclass(value):
            raise _Foreign
        # Equal values give equal results, so fields excluded from comparison are excluded here.
        equal = cast("Any", kind).__dataclass_params__.eq
        parts = [getattr(value, field.name) for field in dataclasses.fields(value) if field.compare or not equal]
        return f"{self._place(kind)}({self._all(parts)})"

    def _all(self, values: "tuple[object, ...] | list[object]") -> str:
        return ",".join([self.tell(value) for value in values])

    def _class(self, value: type) -> str:
        """Serialise a class by its qualified name in a module of this package or of Python."""
        if value.__module__ != "builtins":
            found: object = sys.modules.get(value.__module__)
            for part in value.__qualname__.split("."):
                found = getattr(found, part, None)
            if found is not value:
                raise _Foreign
            return self._place(value)
        return value.__qualname__

    def _place(self, value: "type | FunctionType") -> str:
        module = str(value.__module__)  # functions that text was made into have none
        if module.partition(".")[0] != PACKAGE:
            raise _Foreign
        return f"{module}:{value.__qualname__}"


def code_digest(code: CodeType) -> str:
    """Return a key that differs where two codes do, wherever they are written."""
    parts = [code.co_code.hex(), *code.co_names, *code.co_freevars, *map(_constant, code.co_consts)]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


def _constant(value: object) -> str:
    if isinstance(value, CodeType):
        return code_digest(value)
    return repr(sorted(map(repr, cast("frozenset[object]", value))) if isinstance(value, frozenset) else value)
