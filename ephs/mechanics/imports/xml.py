"""XML text to elements, without external files or expansion; numbers in attributes and texts."""

import math
import re
from collections.abc import Iterable
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from ephs.mechanics.imports.draft import UNLIMITED
from ephs.mechanics.imports.file_element import FileElement
from ephs.mechanics.scene.errors import Fault, fault
from ephs.mechanics.scene.schema_numbers import LARGEST
from ephs.mechanics.scene.text import file_text

MOST_MB = 100
MOST_LEVELS = 200
_LEFT_OUT = re.compile(r"<!\[CDATA\[.*?\]\]>|<!--.*?-->|<\?xml\s.*?\?>", re.DOTALL)
_DECLARATION = re.compile(r"<!\s*(DOCTYPE|ENTITY)", re.IGNORECASE)


def read_tree(path: Path, faults: list[Fault], key: str = "") -> Element | None:
    """The root element of a file; None where there were faults.

    Document types and entities are refused before the parser runs: they can make a small file large, and name others.
    Comments with two hyphens, prefixes without a declaration, and declarations of XML that are not first are read, as
    by the parsers of MuJoCo, sdformat and urdfdom.
    """
    text = file_text(path, faults, key, MOST_MB)
    if text is None:
        return None
    text = _LEFT_OUT.sub(_blank, text)
    if declared := _DECLARATION.search(text):
        line = text.count("\n", 0, declared.start()) + 1
        faults.append(fault("entities", _key_place(key, f"line {line}"), f"<!{declared[1]}"))
        return None
    try:
        root = _parsed(text)
    except expat.ExpatError as error:
        place = f"line {error.lineno}, column {error.offset + 1}"
        faults.append(fault("xml", _key_place(key, place), expat.ErrorString(error.code)))
        return None
    if _too_deep(root):
        faults.append(fault("deep", key, f"elements nested deeper than {MOST_LEVELS} levels", most=MOST_LEVELS))
        return None
    return root


def _parsed(text: str) -> Element:
    """The root of a text; names keep their prefixes."""
    builder = TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    parser.Parse(text, True)
    return builder.close()


def _blank(found: re.Match[str]) -> str:
    """Nothing but the ends of lines of a comment or a declaration; a section of characters as it is."""
    return found[0] if found[0].startswith("<![") else "\n" * found[0].count("\n") or " "


def numbers(text: str | None, count: int, key: str, faults: list[Fault], default: Iterable[float] = ()) -> list[float]:
    """``count`` finite numbers of a text; the default where there is none, with a fault where that is missing too."""
    given = list(default)
    if text is None or not text.strip():
        if given:
            return given
        faults.append(fault("value", key, "nothing", what=_counted(count)))
        return [0.0] * count
    try:
        found = [_number(word) for word in text.split()]
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


def bound(text: str | None, key: str, faults: list[Fault], default: float) -> float:
    """A limit: a number, infinite from `UNLIMITED` on; the default where there is none."""
    try:
        found = _number(text) if text and text.strip() else default
    except ValueError:
        found = math.nan
    if math.isnan(found):
        return numbers(text, 1, key, faults)[0]
    return math.copysign(math.inf, found) if abs(found) >= UNLIMITED else found


def vector(
    element: FileElement | None, name: str, key: str, faults: list[Fault], default: Iterable[float] = (0.0, 0.0, 0.0)
) -> list[float]:
    """Three numbers in an attribute of an element, which may be missing."""
    return numbers(None if element is None else element.get(name), 3, f"{key}.{name}", faults, default)


def _number(word: str) -> float:
    """A number; none where only Python's own parser takes it: ``1_0``, and digits of other scripts."""
    return math.nan if "_" in word or not word.isascii() else float(word)


def _counted(count: int) -> str:
    return "a finite number" if count == 1 else f"{count} finite numbers"


def _key_place(key: str, place: str) -> str:
    return f"{key}, {place}" if key else place


def _too_deep(root: Element) -> bool:
    level = [root]
    for _ in range(MOST_LEVELS):
        level = [child for element in level for child in element]
        if not level:
            return False
    return True
