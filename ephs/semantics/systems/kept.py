"""Cache of results that depend on a frozen value, stored with the value."""

from collections.abc import Callable, Hashable
from threading import Lock
from typing import Any, TypeVar, cast, final

T = TypeVar("T")

MOST = 32
"""Number of results that one value keeps."""


@final
class Kept:
    """Cache slot of a frozen value; results that were not asked for longest are dropped first.

    Results are shared by all threads and never written to. They go with their owner: a value made from another one by
    `dataclasses.replace`, a deep copy, and what comes out of a pickle start with an empty slot.
    """

    __slots__ = ("_found", "_lock")

    def __init__(self) -> None:
        self._found: dict[Hashable, Any] = {}
        self._lock = Lock()

    def result(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the result of this key, computed if it is absent; exceptions are not cached."""
        with self._lock:
            if key in self._found:
                self._found[key] = found = self._found.pop(key)
                return cast("T", found)
        made = make()
        with self._lock:
            kept = self._found.setdefault(key, made)
            while len(self._found) > MOST:
                del self._found[next(iter(self._found))]
        return cast("T", kept)

    def __reduce__(self) -> tuple[type["Kept"], tuple[()]]:
        return (Kept, ())


def once(owner: Any, key: Hashable, make: Callable[[], T]) -> T:
    """Return the result for a frozen value with a slot ``_kept`` and a key, computed once."""
    return cast("Kept", owner._kept).result(key, make)
