"""Elements and attributes of URDF and SDF that their readers do not know, each named by its path."""

from collections.abc import Iterator, Mapping
from xml.etree.ElementTree import Element

from ephs.mechanics.imports.draft import UNLIMITED, Draft

Known = Mapping[str, tuple[str, ...]]
"""Paths below an element -> values without an effect; an empty tuple where a reader knows all that is there."""


def note_unknown(element: Element, known: Known, draft: Draft, kind: str, name: str) -> None:
    """Record what an element of a kind says beyond what its reader knows."""
    for path in _unknown(element, known, ""):
        draft.leave(f"{path} of {kind}", name)


def _unknown(element: Element, known: Known, path: str) -> Iterator[str]:
    for key, value in element.items():
        if path + key not in known or _differs(value, known[path + key]):
            yield path + key
    for child in element:
        here = f"{path}{child.tag.rpartition('}')[2]}"  # without its namespace
        if here in known:
            if _differs(" ".join([*child.attrib.values(), child.text or ""]), known[here]):
                yield here
        elif any(other.startswith(f"{here}/") for other in known):
            yield from _unknown(child, known, f"{here}/")
        else:
            yield here


def _differs(text: str, plain: tuple[str, ...]) -> bool:
    return bool(plain) and _words(text) not in [_words(each) for each in plain]


def _words(text: str) -> list[float | str]:
    return [_number(word) for word in text.lower().split()]


def _number(word: str) -> float | str:
    """A number of a word, if it is one; large ones are infinite."""
    try:
        found = {"true": 1.0, "false": 0.0}[word] if word in ("true", "false") else float(word)
    except ValueError:
        return word
    return found if abs(found) < UNLIMITED else found * float("inf")
