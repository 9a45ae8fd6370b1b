"""XML text to elements, without external files or expansion; numbers in attributes and texts."""

import math
import re
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from ephs.mechanics.scene.errors import Fault, fault
from ephs.mechanics.scene.schema_numbers import LARGEST
from ephs.mechanics.scene.text import file_text

MOST_MB = 100
MOST_LEVELS = 200
_DECLARATION = re.compile(r"<!\s*(DOCTYPE|ENTITY)", re.IGNORECASE)


def read_tree(path: Path, faults: list[Fault], key: str = "") -> Element | None:
    """The root element of a file; None where there were faults.

    Document types and entities are refused before the parser runs: they can make a small file large, and name others.
    """
    text = file_text(path, faults, key, MOST_MB)
    if text is None:
        return None
    if declared := _DECLARATION.search(text):
        line = text.count("\n", 0, declared.start()) + 1
        faults.append(fault("entities", _at(key, f"line {line}"), f"<!{declared[1]}"))
        return None
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        line, column = error.position
        faults.append(fault("xml", _at(key, f"line {line}, column {column + 1}"), str(error).partition(":")[0]))
        return None
    except ValueError as error:  # an encoding that Python does not have
        faults.append(fault("xml", key, str(error)))
        return None
    if _too_deep(root):
        faults.append(fault("deep", key, f"elements nested deeper than {MOST_LEVELS} levels", most=MOST_LEVELS))
        return None
    return root


def numbers(text: str | None, count: int, key: str, faults: list[Fault], default: Iterable[float] = ()) -> list[float]:
    """``count`` finite numbers of a text; the default where there is none, with a fault where that is missing too."""
    given = list(default)
    if text is None or not text.strip():
        if given:
            return given
        faults.append(fault("value", key, "nothing", what=_counted(count)))
        return [0.0] * count
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        found = []
    if len(found) != count or not all(map(math.isfinite, found)):
        shown = text.strip() if len(text) <= 60 else text.strip()[:57] + "…"
        faults.append(fault("value", key, f'"{shown}"', what=_counted(count)))
        return given or [0.0] * count
    if max(map(abs, found)) > LARGEST:
        faults.append(fault("large", key, f"{max(found, key=abs):g}", most=LARGEST))
        return given or [0.0] * count
    return [0.0 if abs(number) < 1.0 / LARGEST else number for number in found]


def vector(
    element: Element | None, name: str, key: str, faults: list[Fault], default: Iterable[float] = (0.0, 0.0, 0.0)
) -> list[float]:
    """Three numbers in an attribute of an element, which may be missing."""
    return numbers(None if element is None else element.get(name), 3, f"{key}.{name}", faults, default)


def _counted(count: int) -> str:
    return "a finite number" if count == 1 else f"{count} finite numbers"


def _at(key: str, place: str) -> str:
    return f"{key}, {place}" if key else place


def _too_deep(root: Element) -> bool:
    level = [root]
    for _ in range(MOST_LEVELS):
        level = [child for element in level for child in element]
        if not level:
            return False
    return True
