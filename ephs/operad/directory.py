"""Directories: prefix-free maps from paths to values, the monad by which names nest."""

from collections.abc import Callable, Collection, ItemsView, Iterable, Iterator, Mapping, ValuesView
from typing import TypeAlias, TypeVar, cast, final

from ephs.operad.errors import PatternError
from ephs.operad.names import ROOT, Path, PathLike, paths_text

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
S = TypeVar("S")

Entries: TypeAlias = Mapping[Path, T] | Mapping[str, T] | Iterable[tuple[PathLike, T]]
"""Source of a directory: a mapping, or pairs, from path or dotted name to value."""


@final
class Directory(Mapping[Path, T_co]):
    """A finite immutable map from paths to values in which no path is a prefix of another.

    It is a tree whose leaves carry values. Order is kept for printing, equality is up to order. Directories
    form a monad: ``unit`` puts a value at the root, ``flatten`` concatenates the paths of a directory of
    directories.

    Parameters
    ----------
    entries
        Mapping or pairs; keys are paths, dotted names or tuples of names. Where a key is wanted later, in
        ``[...]``, ``in`` and ``get``, all of these serve.
    what
        What the entries are, for messages.

    Raises
    ------
    PatternError
        If a path occurs twice, or is a prefix of another.

    Examples
    --------
    >>> d = Directory({"a.b": 1, "c": 2})
    >>> d["a.b"], "a" in d, d == Directory({"c": 2, "a.b": 1})
    (1, False, True)
    """

    __slots__ = ("_items",)
    _items: dict[Path, T_co]

    def __init__(self, entries: "Entries[T_co]" = (), *, what: str = "directory") -> None:
        pairs = cast("Iterable[tuple[PathLike, T_co]]", entries.items() if isinstance(entries, Mapping) else entries)
        items: dict[Path, T_co] = {}
        for key, value in pairs:
            path = Path.of(key)
            if path in items:
                raise PatternError("duplicate", found=str(path), expected="expected each path once", what=what)
            items[path] = value
        if clash := first_clash(items, items):
            found = f"{clash[0]} and {clash[1]}"
            raise PatternError("prefix", found=found, expected="expected prefix-free paths", what=what)
        object.__setattr__(self, "_items", items)

    @staticmethod
    def trusted(items: "dict[Path, S]") -> "Directory[S]":
        """Directory of items known to be prefix-free, without copying them."""
        directory = cast("Directory[S]", object.__new__(Directory))
        object.__setattr__(directory, "_items", items)
        return directory

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a directory cannot be changed: {name}")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"a directory cannot be changed: {name}")

    def __getitem__(self, key: PathLike) -> T_co:
        if isinstance(key, Path):
            return self._items[key]
        try:
            path = Path.of(key)
        except PatternError:
            raise KeyError(key) from None  # what cannot be a path is in no directory
        return self._items[path]

    def __contains__(self, key: object) -> bool:
        return key in self._items if isinstance(key, Path) else super().__contains__(key)

    def __iter__(self) -> Iterator[Path]:
        return iter(self._items)

    def items(self) -> ItemsView[Path, T_co]:
        """Paths and values; a view, as of a dictionary."""
        return self._items.items()

    def values(self) -> ValuesView[T_co]:
        """The values; a view, as of a dictionary."""
        return self._items.values()

    def __len__(self) -> int:
        return len(self._items)

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        return (
            self._items == cast("Directory[object]", other)._items if isinstance(other, Directory) else NotImplemented
        )

    def __hash__(self) -> int:
        return hash(frozenset(self._items.items()))

    def __reduce__(self) -> tuple[object, ...]:
        return (Directory, (tuple(self._items.items()),))

    @staticmethod
    def unit(value: S) -> "Directory[S]":
        """The value at the root path."""
        return Directory([(ROOT, value)])

    def flatten(self: "Directory[Directory[S]]") -> "Directory[S]":
        """The directory of all values, each at the concatenation of its two paths."""
        return Directory([(a / b, value) for a, inner in self.items() for b, value in inner.items()])

    def map(self, f: Callable[[T_co], S]) -> "Directory[S]":
        """Apply a function to every value."""
        return Directory.trusted({path: f(value) for path, value in self.items()})

    def filter(self, f: Callable[[T_co], bool]) -> "Directory[T_co]":
        """Keep the entries whose value fulfils the condition."""
        return Directory.trusted({path: value for path, value in self.items() if f(value)})

    def prefixed(self, prefix: PathLike) -> "Directory[T_co]":
        """Move all entries below a path."""
        return Directory([(Path.of(prefix) / path, value) for path, value in self.items()])

    def below(self, prefix: PathLike) -> "Directory[T_co]":
        """The entries at or below a path, named relative to it; empty if there are none."""
        top = Path.of(prefix)
        return Directory([(path.relative_to(top), value) for path, value in self.items() if top.is_prefix_of(path)])

    def zip(self, other: "Directory[S]") -> "Directory[tuple[T_co, S]]":
        """Pairs of the values of both, which must have the same paths.

        Raises
        ------
        PatternError
            If a path is in one of them only.
        """
        if apart := sorted(self.keys() ^ other.keys()):
            which = "second" if apart[0] in self else "first"
            expected = "expected the same paths in both"
            raise PatternError("apart", found=paths_text(apart), expected=expected, what=which)
        return Directory.trusted({path: (value, other[path]) for path, value in self.items()})

    def merge(self, other: "Directory[S]") -> "Directory[T_co | S]":
        """The entries of both, which must not clash."""
        pairs: list[tuple[PathLike, T_co | S]] = [*self.items(), *other.items()]
        return Directory(pairs)

    def to_nested(self) -> "dict[str, object]":
        """The same tree as plain nested dictionaries; a value at the root has the key ``"."``."""
        nested: dict[str, object] = {}
        for path, value in self.items():
            if not path:
                return {".": value}
            level = nested
            for name in path[:-1]:
                level = cast("dict[str, object]", level.setdefault(name, {}))
            level[path[-1]] = value
        return nested

    def __repr__(self) -> str:
        entries = ", ".join(f"{str(path)!r}: {value!r}" for path, value in self.items())
        return f"Directory({{{entries}}})"

    def __str__(self) -> str:
        return "\n".join(_tree(self.to_nested())) or "(empty)"


def first_clash(paths: Collection[Path], others: Collection[Path]) -> tuple[Path, Path] | None:
    """The least pair (path, continuation) of one of the paths and a proper continuation among the others."""
    prefixes: set[tuple[str, ...]] = set()
    for other in others:
        # Upwards until a prefix is known: each is met once, so the work is linear.
        for length in range(len(other) - 1, -1, -1):
            if (prefix := other[:length]) in prefixes:
                break
            prefixes.add(prefix)
    clashing = [path for path in paths if path in prefixes]
    if not clashing:
        return None
    path = min(clashing)
    return path, min(other for other in others if len(other) > len(path) and path.is_prefix_of(other))


def _tree(nested: Mapping[str, object], indent: str = "") -> Iterator[str]:
    for name, value in nested.items():
        if isinstance(value, dict):
            yield f"{indent}{name}"
            yield from _tree(cast("dict[str, object]", value), indent + "  ")
        else:
            yield f"{indent}{name}: {value}"
