"""Saying what is compiled, while it is: the first run after an installation or a change waits for it."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

__all__ = ["compiling"]


@contextmanager
def compiling(say: Callable[[str], None]) -> Generator[None]:
    """Call say(name) with the name of each function whose compilation begins, and say("") when none is left."""
    event: Any = import_module("numba.core.event")

    class Listener(event.Listener):
        """Counts how deep compilations are nested: what a function calls is compiled on its way."""

        depth = 0

        def on_start(self, happened: Any) -> None:
            self.depth += 1
            say(happened.data["dispatcher"].py_func.__name__.strip("_"))

        def on_end(self, happened: Any) -> None:
            self.depth -= 1
            if self.depth == 0:
                say("")

    with event.install_listener("numba:compile", Listener()):
        yield
