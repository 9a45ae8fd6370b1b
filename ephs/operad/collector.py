"""A pause for the cyclic garbage collector, where many values are made and none of them is in a cycle."""

import gc
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def paused_collector() -> Generator[None, None, None]:
    """Without this, the collector traverses the growing result repeatedly: more than linear time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            if not gc.get_freeze_count():  # what was made is old at once; else all of it would be traversed now
                gc.freeze()
                gc.unfreeze()
            gc.enable()
