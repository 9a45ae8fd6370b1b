"""Cache of pictures of patterns, by their content and by the drawing code."""

import hashlib
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

from ephs.semantics.stage.store import STORE
from ephs.show.diagrams.drawing import draw
from ephs.show.diagrams.graph import read

if TYPE_CHECKING:
    from ephs.semantics import System


def pattern_svg(system: "System") -> str:
    """The picture of a system's outermost pattern as the text of an SVG file."""
    name = f"{hashlib.sha256(_code() + repr(read(system, None)).encode()).hexdigest()}.svg"
    kept = STORE.read(name)
    if kept is not None:
        return kept.decode()
    made = draw(system).svg
    STORE.write(name, made.encode())
    return made


@cache
def _code() -> bytes:
    """Digest of the modules that draw, which invalidates pictures of other versions."""
    rooms = (files("ephs.show").joinpath(name) for name in ("diagrams", "shared"))
    sources = (file for room in rooms for file in sorted(room.iterdir(), key=lambda f: f.name))
    return hashlib.sha256(b"".join(file.read_bytes() for file in sources if file.name.endswith(".py"))).digest()
