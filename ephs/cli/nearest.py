"""Nearest spelling of a word."""

from collections.abc import Iterable
from pathlib import Path

__all__ = ["beside", "did_you_mean", "nearest"]

MODELS = (".toml", ".py", ".urdf", ".xml", ".sdf")
"""Endings of files that hold a model."""


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that a misspelled one is nearest to, None where none is near."""
    from difflib import get_close_matches

    return next(iter(get_close_matches(name, list(known), n=1, cutoff=0.6)), None)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint at the nearest known name, to end a message with; nothing where none is near."""
    near = nearest(name, known)
    return f'; did you mean "{near}"?' if near else ""


def beside(file: Path) -> str:
    """A hint at the file that a misspelled path is nearest to, in its folder or in scenes/."""
    folders = [folder for folder in (file.parent, Path("scenes")) if folder.is_dir()]
    models = {str(path): path.name for folder in folders for path in sorted(folder.iterdir()) if path.suffix in MODELS}
    name = nearest(file.name, models.values()) or nearest(f"{file.stem}.toml", models.values())
    return next((f'; did you mean "{path}"?' for path, found in models.items() if name and found == name), "")
