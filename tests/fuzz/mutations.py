"""One input from a seed and a number: a text, changed in its bytes, its tokens or its structure."""

import json
import re
import tomllib
from collections.abc import Callable, Iterator, MutableMapping
from copy import deepcopy
from functools import lru_cache
from random import Random
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.sax.saxutils import escape, quoteattr

from tests.fuzz.words import SPLINTERS, number, text, value

__all__ = ["KINDS", "mutated", "mutated_again"]

KINDS = {"toml": 0.28, "json": 0.32, "text": 0.16, "urdf": 0.08, "sdf": 0.08, "xml": 0.08}
"""How often a kind of input is drawn."""
MOST = 100_000
"""Bytes of an input: many small ones find more than few large ones."""
TOKENS = re.compile(rb"[A-Za-z_][\w.-]*|[-+]?[\d.]+(?:[eE][-+]?\d+)?|\s+|.", re.DOTALL)


def mutated(seed: int | str, count: int, texts: dict[str, list[str]]) -> tuple[str, bytes]:
    """The kind and the bytes of input ``count``; the same for the same seed."""
    random = Random(f"{seed}/{count}")
    kind = random.choices(list(KINDS), list(KINDS.values()))[0]
    return kind, _changed(kind, random.choice(texts[kind]), random.choice(texts[kind]), random)


def mutated_again(kind: str, data: bytes, texts: dict[str, list[str]], random: Random) -> bytes:
    """An input, changed once more."""
    try:
        return _changed(kind, data.decode(), random.choice(texts[kind]), random)
    except ValueError:  # no text, or no JSON any more
        return _flat(data, random.choice(texts[kind]).encode(), random)[:MOST]


def _changed(kind: str, source: str, other: str, random: Random) -> bytes:
    if kind != "text" and random.random() < 0.7:
        try:
            found = STRUCTURES[kind](source, other, random)
        except RecursionError:  # too deep to be written
            found = None
        found = None if found is not None and len(found) > MOST else found
    else:
        found = source.encode()
    if found is None or kind == "text" or random.random() < 0.3:
        found = _flat(found or source.encode(), other.encode(), random)
    return found[:MOST]


def _times(random: Random) -> range:
    """How many changes: mostly few, so that something of the input stays whole."""
    return range(random.choice((1, 1, 1, 1, 2, 2, 3, 8)))


# ---- bytes and tokens --------------------------------------------------------------------------------------------


def _flat(found: bytes, other: bytes, random: Random) -> bytes:
    if random.random() < 0.5:
        data = bytearray(found)
        for _ in _times(random):
            at = random.randint(0, len(data))
            match random.randint(0, 4):
                case 0 if data:
                    data[at % len(data)] = random.randint(0, 255)
                case 1 if data:
                    data[at % len(data)] ^= 1 << random.randint(0, 7)
                case 2:
                    data[at : at + random.randint(0, 30)] = random.choice(SPLINTERS)
                case 3:
                    end = at + random.randint(1, 200)
                    data[at:at] = data[at:end] * random.choice((1, 1, 2, 50))
                case _:
                    data[at:] = other[random.randint(0, len(other)) :]
        return bytes(data)
    tokens = TOKENS.findall(found) or [b""]
    others = TOKENS.findall(other) or [b""]
    for _ in _times(random):
        at, there = random.randrange(len(tokens)), random.randrange(len(tokens))
        match random.randint(0, 6):
            case 0:
                tokens[at] = random.choice(tokens)
            case 1:
                tokens[at], tokens[there] = tokens[there], tokens[at]
            case 2:
                tokens[at] = str(number(random)).encode()
            case 3:
                tokens[at] = random.choice(SPLINTERS)
            case 4:
                tokens[at] = random.choice(others)
            case 5:
                tokens.insert(at, random.choice(others))
            case _:
                del tokens[at : at + random.randint(1, 5)]
                tokens = tokens or [b""]
    return b"".join(tokens)


# ---- trees of tables and lists -----------------------------------------------------------------------------------


def _places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Every (holder, key) below a table or a list."""
    waiting = [tree]
    while waiting:
        holder = waiting.pop()
        if isinstance(holder, dict | list):
            keys = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
            for key in keys:
                yield holder, key
                waiting.append(holder[key])


def _rebuilt(tree: Any, other: Any, random: Random) -> Any:
    for _ in _times(random):
        places, others = list(_places(tree)), list(_places(other))
        if not places:
            return value(random)
        holder, key = random.choice(places)
        second, there = random.choice(places)
        old = holder[key]
        match random.randint(0, 13):
            case 0:
                del holder[key]
            case 1 | 2:
                holder[key] = value(random)
            case 3 | 4:
                holder[key] = _near(old, random)
            case 5:
                holder[key], second[there] = deepcopy(second[there]), deepcopy(old)
            case 6:
                holder[key] = deepcopy(second[there])
            case 7 if others:
                place, name = random.choice(others)
                holder[key] = deepcopy(place[name])
            case 8 if isinstance(holder, dict):
                _renamed(holder, key, text(random) if random.random() < 0.5 else str(there))
            case 9 if isinstance(holder, dict):
                holder[text(random) if random.random() < 0.5 else str(there)] = deepcopy(old)
            case 10:
                for _ in range(random.choice((1, 1, 2, 20, 80))):
                    holder[key] = [holder[key]] if random.random() < 0.5 else {"a": holder[key]}
            case 11 if isinstance(old, list):
                holder[key] = (old * random.choice((2, 3, 100)))[: random.choice((1, 2, 4, 5, 7, 200))]
            case 12 if isinstance(old, dict):
                for count in range(random.choice((2, 2, 5, 20))):
                    holder[f"{key}{count}" if isinstance(holder, dict) else key] = deepcopy(old)
            case _:
                names = [k for place, k in places if isinstance(k, str) and isinstance(place[k], dict)]
                holder[key] = random.choice(names) if names else text(random)
    return tree


def _near(old: Any, random: Random) -> Any:
    """A value of the same type."""
    if isinstance(old, bool) or old is None:
        return random.choice((True, False))
    if isinstance(old, int | float):
        return random.choice((-old, 2 * old, old / 3 if abs(old) < 1e300 else 1.0, number(random), number(random)))
    if isinstance(old, str):
        return random.choice((text(random), old + text(random), old[:-1], old.upper()))
    if isinstance(old, list):
        return random.choice((old[::-1], old[:-1], old + old[-1:], [], [number(random) for _ in old]))
    return random.choice(({}, dict(list(old.items())[:-1]), {"position": [number(random) for _ in range(3)]}))


def _renamed(holder: MutableMapping[Any, Any], key: Any, new: str) -> None:
    entries = [(new if name == key else name, entry) for name, entry in holder.items()]
    holder.clear()
    holder.update(entries)


def toml(tree: Any) -> str:
    """Tables as TOML, those below the first level within the line; what is no table or no TOML, as it comes."""
    if not isinstance(tree, dict):
        return f"format = {_inline(tree)}\n"
    return "".join(f"{_quoted(key)} = {_inline(entry)}\n" for key, entry in tree.items())


def _inline(entry: Any) -> str:
    if isinstance(entry, dict):
        return "{ " + ", ".join(f"{_quoted(key)} = {_inline(inner)}" for key, inner in entry.items()) + " }"
    if isinstance(entry, list):
        return "[" + ", ".join(map(_inline, entry)) + "]"
    if isinstance(entry, bool):
        return "true" if entry else "false"
    return _quoted(entry) if isinstance(entry, str) else _digits(entry)


def _quoted(word: Any) -> str:
    return json.dumps(str(word), ensure_ascii=False).replace("\x7f", "\\u007f")


def _digits(entry: Any) -> str:
    return repr(entry) if isinstance(entry, float) or abs(entry) < 10**300 else "1" + "0" * 400


@lru_cache(maxsize=500)
def _toml_tree(source: str) -> Any:
    return tomllib.loads(source)


def _of_toml(source: str, other: str, random: Random) -> bytes | None:
    try:
        tree, second = deepcopy(_toml_tree(source)), _toml_tree(other)
    except tomllib.TOMLDecodeError:
        return None
    return toml(_rebuilt(tree, second, random)).encode("utf-8", "surrogatepass")


def _of_json(source: str, other: str, random: Random) -> bytes | None:
    tree = _rebuilt(json.loads(source), json.loads(other), random)
    return json.dumps(tree, ensure_ascii=False).encode("utf-8", "surrogatepass")


# ---- XML ---------------------------------------------------------------------------------------------------------


def _of_xml(source: str, other: str, random: Random) -> bytes | None:
    try:
        tree, second = (_xml_tree(ElementTree.fromstring(each)) for each in (source, other))
    except ElementTree.ParseError:
        return None
    return _xml(_rebuilt(tree, second, random)).encode("utf-8", "surrogatepass")


def _xml_tree(element: Element) -> dict[str, Any]:
    """Tag, text, attributes, and the elements in it; texts and attributes as lists of words and numbers."""
    words = {"text": element.text or "", **element.attrib}
    entries = {name: [_read(word) for word in text.split()] for name, text in words.items()}
    return {"tag": element.tag, "in": list(map(_xml_tree, element)), **entries}


def _read(word: str) -> Any:
    try:
        return json.loads(word)
    except ValueError:
        return word


def _xml(tree: Any, tag: str = "a") -> str:
    """What is in lists and tables, where no element belongs, as elements; all else as texts."""
    tree = tree if isinstance(tree, dict) else {"in" if isinstance(tree, list) else "text": tree}
    inner, entries = tree.get("in"), [(key, tree[key]) for key in tree if key not in ("tag", "in", "text")]
    content = escape(_words(tree.get("text", ""))) + "".join(map(_xml, inner if isinstance(inner, list) else ()))
    content += "".join(_xml(entry, _words(key)) for key, entry in entries if isinstance(entry, dict))
    given = "".join(f" {key}={quoteattr(_words(entry))}" for key, entry in entries if not isinstance(entry, dict))
    tag = _words(tree.get("tag", tag))
    return f"<{tag}{given}>{content}</{tag}>"


def _words(entry: Any) -> str:
    """Texts and numbers after each other; XML has no control characters."""
    found = " ".join(map(str, entry)) if isinstance(entry, list) else str(entry)
    return re.sub(r"[\x00-\x08\x0b\x0c\x0e-\x1f]", "", found)


STRUCTURES: dict[str, Callable[[str, str, Random], bytes | None]] = {
    "toml": _of_toml,
    "json": _of_json,
    "urdf": _of_xml,
    "sdf": _of_xml,
    "xml": _of_xml,
}
