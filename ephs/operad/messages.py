"""Texts of errors: tables of texts, abbreviations, and the nearest spelling of a name."""

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any, ClassVar

_NEAR_LETTERS, _NEAR_NAMES = 80, 500


class TextError(Exception):
    """An error with a text from the table of its class.

    Parameters
    ----------
    fault
        The key of the text.
    **details
        The values that the text names.
    """

    _texts: ClassVar[Mapping[str, str]]

    def __init__(self, fault: str, /, **details: object) -> None:
        super().__init__(self._texts[fault].format(**details))
        self.fault: str = fault
        self.details: dict[str, object] = details

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), self.fault, **self.details), ()


def legible(text: str, longest: int = 600, head: int = 200, tail: int = 60) -> str:
    """A text abbreviated in the middle where it is long, with control characters escaped."""
    if len(text) > longest:
        text = f"{text[:head]}… ({len(text)} characters) …{text[-tail:]}"
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def nearest_name(name: str, known: Iterable[str]) -> str | None:
    """The known name nearest to a misspelled one, if any is near; among many names none is looked for."""
    from difflib import get_close_matches

    names = [other for other in known if len(other) <= _NEAR_LETTERS]
    if len(name) > _NEAR_LETTERS or len(names) > _NEAR_NAMES:
        return None
    return next(iter(get_close_matches(name, names, n=1, cutoff=0.6)), None)


def nearest_of(found: object, known: Iterable[str]) -> str:
    """Suggestion of the known word nearest to a misspelled one, for the end of a message; empty if none is near."""
    near = nearest_name(str(found), known)
    return f"; did you mean {near!r}?" if near and near != str(found) else ""
