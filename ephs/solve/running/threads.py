"""Linear algebra in one thread. With several, a library takes sums in another order, and the last digits are others."""

import sys
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from threading import Lock
from typing import Any, ParamSpec, TypeVar, final

Given = ParamSpec("Given")
Made = TypeVar("Made")


@final
class _Limit:
    """Number of active calls with one thread: the first sets it, the last restores the former number.

    Libraries are looked for again where modules were imported since, which may bring others; it takes a millisecond.
    """

    __slots__ = ("_before", "_calls", "_found", "_lock", "_modules")

    def __init__(self) -> None:
        self._calls, self._lock = 0, Lock()
        self._before: Any = None
        self._found: Any = None
        self._modules = 0

    def __enter__(self) -> None:
        with self._lock:
            if self._calls == 0:
                import_module("scipy.linalg")  # its own library has to be loaded before it can be limited
                controller = import_module("threadpoolctl").ThreadpoolController
                if len(sys.modules) != self._modules:
                    self._found, self._modules = controller(), len(sys.modules)
                _released()
                self._before = self._found.limit(limits=1, user_api="blas")
            self._calls += 1

    def __exit__(self, *_failure: object) -> None:
        with self._lock:
            self._calls -= 1
            if self._calls == 0:
                _released()
                self._before.restore_original_limits()
                _released()


def _released() -> None:
    """Let any thread set the number: threadpoolctl 3.8 ignores all but the first that did."""
    release = getattr(import_module("threadpoolctl").OpenBLASController, "clear_controlling_thread", None)
    if release is not None:
        release(force=True)


_LIMIT = _Limit()


def in_one_thread(function: Callable[Given, Made]) -> Callable[Given, Made]:
    """A function with linear algebra on one thread, for bitwise reproducible results."""

    @wraps(function)
    def limited(*arguments: Given.args, **keywords: Given.kwargs) -> Made:
        with _LIMIT:
            return function(*arguments, **keywords)

    return limited
