"""Nearest spelling of a word."""

from collections.abc import Iterable
from pathlib import Path

MODELS = (".toml", ".py", ".urdf", ".xml", ".sdf")
"""Suffixes of model files."""


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name nearest to a misspelled one, or None."""
    from difflib import get_close_matches

    return next(iter(get_close_matches(name, list(known), n=1, cutoff=0.6)), None)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint at the nearest known name, as the end of a message; empty if none is near."""
    near = nearest(name, known)
    return f'; did you mean "{near}"?' if near else ""


def beside(file: Path) -> str:
    """A hint at the file nearest to a misspelled path, in its folder or in scenes/."""
    folders = [folder for folder in (file.parent, Path("scenes")) if folder.is_dir()]
    models = {str(path): path.name for folder in folders for path in sorted(folder.iterdir()) if path.suffix in MODELS}
    name = nearest(file.name, models.values()) or nearest(f"{file.stem}.toml", models.values())
    return next((f'; did you mean "{path}"?' for path, found in models.items() if name and found == name), "")
