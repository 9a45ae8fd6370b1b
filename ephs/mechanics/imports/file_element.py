"""Elements of URDF and SDF that record what is read of them, so that all the rest can be named."""

from collections.abc import Iterator, Mapping
from typing import final
from xml.etree.ElementTree import Element

from ephs.mechanics.imports.draft import UNLIMITED, Draft

Plain = Mapping[str, tuple[str, ...]]
"""Paths below an element -> values without an effect on motion; an empty tuple where no value has one."""
_DECLARED = "xmlns"


@final
class FileElement:
    """An element of a file. Attributes, texts and children count as read when they are asked for.

    Attributes
    ----------
    tag
        Its name, with its prefix if it has one.
    """

    __slots__ = ("_attributes", "_children", "_kind", "_name", "_passed", "_plain", "_seen", "_text", "tag")

    def __init__(self, element: Element) -> None:
        self.tag = element.tag
        self._attributes = {k: v for k, v in element.attrib.items() if k.partition(":")[0] != _DECLARED}
        self._text = element.text
        self._children = [FileElement(child) for child in element]
        self._seen: set[str] = set()  # names of attributes, and "" for the text
        self._kind = self._name = ""
        self._plain: Plain = {}
        self._passed: bool | None = None  # None: not read; False: read; True: passed by

    def get(self, name: str) -> str | None:
        """An attribute."""
        self._seen.add(name)
        return self._attributes.get(name)

    @property
    def text(self) -> str | None:
        """The text before the first child."""
        self._seen.add("")
        return self._text

    def has(self, *tags: str) -> bool:
        """Whether a child has one of these tags, or an attribute this name; it does not count as read."""
        return any(child.tag in tags for child in self._children) or any(tag in self._attributes for tag in tags)

    def findall(self, path: str) -> list["FileElement"]:
        """The children with a tag, or those that a path of tags leads to; ``*`` stands for any tag."""
        tag, _, rest = path.partition("/")
        found = [child for child in self._children if tag in (child.tag, "*")]
        for child in found:
            child._passed = child._passed or False
        return [below for child in found for below in child.findall(rest)] if rest else found

    def find(self, path: str) -> "FileElement | None":
        """The first of them; the others do not count as read."""
        tag, _, rest = path.partition("/")
        for child in self._children:
            if child.tag == tag:
                child._passed = child._passed or False
                return child.find(rest) if rest else child
        return None

    def findtext(self, path: str) -> str | None:
        """The text of the first of them; "" where it has none."""
        found = self.find(path)
        return None if found is None else (found.text or "")

    def peek(self, path: str) -> str:
        """The text of the first of them, "" without one; it does not count as read."""
        tag, _, rest = path.partition("/")
        for child in self._children:
            if child.tag == tag:
                return child.peek(rest) if rest else child._text or ""
        return ""

    def value(self, word: str) -> str | None:
        """The text of a child, or else an attribute of its name, which SDF 1.0 has in its place."""
        found = self.findtext(word)
        return self.get(word) if found is None else found

    def named(self, kind: str, name: str, plain: Plain) -> None:
        """Begin paths here: what is not read is that of an element of a kind, with a name."""
        self._kind, self._name, self._plain = kind, name, plain

    def pass_by(self, *tags: str) -> None:
        """Let children with these tags, or all of the element, be: they have no effect, or a note of their own."""
        for child in self._children:
            if child.tag in tags:
                child._passed = True
        self._passed = self._passed if tags else True

    def pass_by_all_but(self, *tags: str) -> None:
        """Let attributes, and children with other tags, be."""
        self._seen |= set(self._attributes)
        self.pass_by(*{child.tag for child in self._children}.difference(tags))

    def everything(self) -> Iterator["FileElement"]:
        """The element and all below it; they do not count as read."""
        yield self
        for child in self._children:
            yield from child.everything()

    def leave_unread(self, draft: Draft) -> None:
        """Record all that has an effect but was not read, by its path."""
        for path, kind, name in self._unread("", self):
            draft.leave(f"{path} of {kind}", name)

    def _unread(self, path: str, owner: "FileElement") -> Iterator[tuple[str, str, str]]:
        kind, name, plain = owner._kind, owner._name, owner._plain
        for key, value in self._attributes.items():
            if key not in self._seen and _tells(value, plain.get(path + key)):
                yield path + key, kind, name
        if path and (self._text or "").strip() and "" not in self._seen and not self._children:
            yield path.removesuffix("/"), kind, name
        for child in self._children:
            here = path + child.tag
            if child._passed:
                continue
            if child._kind:
                yield from child._unread("", child)
            elif child._passed is None and here in plain:
                if _tells(" ".join([*child._attributes.values(), child._text or ""]), plain[here]):
                    yield here, kind, name
            elif child._passed is None and not any(other.startswith(f"{here}/") for other in plain):
                yield here, kind, name
            else:
                yield from child._unread(f"{here}/", owner)


def _tells(text: str, plain: tuple[str, ...] | None) -> bool:
    """Whether a value has an effect."""
    return plain is None or (bool(plain) and _words(text) not in [_words(each) for each in plain])


def _words(text: str) -> list[float | str]:
    return [_number(word) for word in text.lower().split()]


def _number(word: str) -> float | str:
    """A number of a word, if it is one; large ones are infinite."""
    try:
        found = {"true": 1.0, "false": 0.0}[word] if word in ("true", "false") else float(word)
    except ValueError:
        return word
    return found if abs(found) < UNLIMITED else found * float("inf")
