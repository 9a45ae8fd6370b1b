"""Nearest spelling of a word."""

from collections.abc import Iterable

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
