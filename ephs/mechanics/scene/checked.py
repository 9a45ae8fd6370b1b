"""A validated table of a scene file, and the faults that are found in it."""

from dataclasses import dataclass, field
from functools import reduce
from typing import Generic, TypeVar, final

from ephs.mechanics.scene.errors import Fault, fault, shown
from ephs.mechanics.scene.schema_numbers import EntryTable

E = TypeVar("E", bound=EntryTable, covariant=True)
F = TypeVar("F", bound=EntryTable)


@final
@dataclass(frozen=True, slots=True)
class Checked(Generic[E]):
    """A table and its keys with faults.

    Attributes
    ----------
    key : of the table, as ``joints.pin``
    faults : takes those of the file
    """

    entry: E
    key: str
    faults: list[Fault] = field(default_factory=list)
    spoiled: frozenset[str] = frozenset()

    @property
    def name(self) -> str:
        """Name of the element."""
        return self.key.partition(".")[2]

    def sound(self, *keys: str) -> bool:
        """Whether none of these keys had a fault."""
        return self.spoiled.isdisjoint(keys)

    def fault(self, code: str, at: str = "", found: object = None, **values: object) -> None:
        """Append a fault at a key of the table, or at itself; what is found there is its value, unless it is given."""
        if found is None:
            found = shown(reduce(getattr, at.split("."), self.entry))
        self.faults.append(fault(code, f"{self.key}.{at}" if at else self.key, found, **values))

    def inner(self, key: str, entry: F) -> "Checked[F]":
        """A table in it."""
        return Checked(entry, f"{self.key}.{key}", self.faults)
