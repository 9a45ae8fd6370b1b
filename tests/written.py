"""Scenes of text, which are read as their files are."""

from pathlib import Path
from tempfile import TemporaryDirectory

import ephs

__all__ = ["scene_of_text"]


def scene_of_text(text: str, **options: bool) -> ephs.Scene:
    """Return the scene of a file with this text."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "scene.toml"
        file.write_text(text, encoding="utf-8")
        return ephs.load(file, **options)
