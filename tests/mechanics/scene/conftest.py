"""Scene files written on the spot."""

from collections.abc import Callable
from pathlib import Path

import pytest

from ephs.mechanics.scene.load import load
from ephs.mechanics.scene.model import Scene


@pytest.fixture
def scene(tmp_path: Path) -> Callable[..., Scene]:
    """Load a scene from text; other files that it uses by name."""

    def from_text(text: str, adjust: bool = False, **files: str) -> Scene:
        for name, content in files.items():
            (tmp_path / f"{name}.toml").write_text(content, encoding="utf-8")
        path = tmp_path / "scene.toml"
        path.write_text(text if "format" in text else "format = 1\n" + text, encoding="utf-8")
        return load(path, adjust=adjust)

    return from_text
