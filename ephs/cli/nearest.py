"""Suggestions in messages of the command line; the operad's, loaded only where there is something to suggest."""

from collections.abc import Iterable

MODELS = (".toml", ".py", ".urdf", ".xml", ".sdf")
"""Suffixes of model files."""


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name nearest to a misspelled one, or None."""
    from ephs.operad.messages import nearest_name

    return nearest_name(name, known)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint at the nearest known name, as the end of a message; empty if none is near."""
    near = nearest(name, known)
    return f'; did you mean "{near}"?' if near else ""
