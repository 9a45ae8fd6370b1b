"""Paths: how boxes, junctions and ports are named, across all levels of nesting."""

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import TypeAlias, final

from ephs.operad.errors import PatternError

LONGEST_NAME = 200
MOST_NAMES = 500
KEPT = 1 << 13
"""Dotted names whose paths are kept: the states of large scenes are named again in each run."""


@final
class Path(tuple[str, ...]):
    """A finite sequence of names; the empty one is the root, and prints as ``.``.

    Paths form the free monoid on names: ``a / b`` concatenates, ``ROOT`` is neutral. They are ordered like
    tuples.

    >>> Path.parse("osc.pe") / "q"
    'osc.pe.q'
    >>> str(ROOT), ROOT / "a" == Path.parse("a")
    ('.', True)

    Raises
    ------
    PatternError
        For a name that is empty, longer than 200 letters, or has a dot, white space, something unprintable or a
        leading ``~``; for a path of more than 500 names.
    """

    __slots__ = ()

    def __new__(cls, names: Iterable[str] = ()) -> "Path":
        if isinstance(names, Path):
            return names
        if isinstance(names, str):
            raise PatternError("path", found=names, expected="a sequence of names; Path.parse reads dotted names")
        parts = tuple(names)
        if len(parts) > MOST_NAMES:
            start = ".".join(str(part)[:40] for part in parts[:3])
            raise PatternError("path", found=f"{start}…", expected=f"at most {MOST_NAMES} names, not {len(parts)}")
        for part in parts:
            _check(part)
        return _trusted(parts)

    @staticmethod
    def parse(text: str) -> "Path":
        """Read a dotted path; ``"."`` is the root."""
        return _parsed(text)

    @staticmethod
    def of(value: "PathLike") -> "Path":
        """A path from a path, a dotted name or a sequence of names."""
        if isinstance(value, Path):
            return value
        if isinstance(value, str):
            return Path.parse(value)
        if isinstance(value, Iterable):  # pyright: ignore[reportUnnecessaryIsInstance]  # user input
            return Path(value)
        raise PatternError("path", found=value, expected="a Path, a dotted name or a tuple of names")

    def __truediv__(self, other: "PathLike") -> "Path":
        return _trusted((*self, *(other if isinstance(other, Path) else Path.of(other))))

    def __rtruediv__(self, other: "PathLike") -> "Path":
        return Path.of(other) / self

    @property
    def parent(self) -> "Path":
        """The path without its last name; the root's is the root."""
        return _trusted(self[:-1])

    def is_prefix_of(self, other: "Path") -> bool:
        """Whether the other path is this one, or continues it."""
        return other[: len(self)] == tuple(self)

    def relative_to(self, prefix: "Path") -> "Path":
        """Remainder after the prefix: ``prefix / path.relative_to(prefix) == path``."""
        if not prefix.is_prefix_of(self):
            raise PatternError("path", found=str(self), expected=f"a path that starts with {prefix}")
        return _trusted(self[len(prefix) :])

    def moved(self, names: "Mapping[Path, Path]") -> "Path":
        """The path with its shortest prefix among the mapping's keys replaced."""
        for length in range(len(self) + 1):
            new = names.get(_trusted(self[:length]))
            if new is not None:
                return _trusted((*new, *self[length:]))
        return self

    def __str__(self) -> str:
        return ".".join(self) if self else "."

    def __repr__(self) -> str:
        return repr(str(self))

    def __format__(self, spec: str) -> str:
        return format(str(self), spec)


PathLike: TypeAlias = "Path | str | tuple[str, ...]"
"""A path, a dotted name, or a tuple of names."""


@lru_cache(maxsize=KEPT)
def _parsed(text: str) -> Path:
    return ROOT if text == "." else Path(text.split("."))


def _trusted(parts: tuple[str, ...]) -> Path:
    return tuple.__new__(Path, parts)  # pyright: ignore[reportUnknownMemberType]


def _check(name: object) -> None:
    if not isinstance(name, str):
        raise PatternError("name", found=name, expected="a name is text")
    if not name:
        raise PatternError("name", found=name, expected="a name has at least one letter")
    if len(name) > LONGEST_NAME:
        short = f"{name[:40]}…"
        raise PatternError("name", found=short, expected=f"a name has at most {LONGEST_NAME} letters, not {len(name)}")
    if "." in name or name.startswith("~") or " " in name or not name.isprintable():
        expected = "a name has no dot, no white space, nothing unprintable and no leading ~"
        raise PatternError("name", found=name, expected=expected)


def paths_text(paths: Iterable[Path]) -> str:
    """The paths of a message: sorted, dotted, ``none`` if there are none."""
    return ", ".join(str(path) for path in sorted(paths)) or "none"


ROOT = _trusted(())
