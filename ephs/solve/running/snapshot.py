"""Present state of a run as plain data: entries of a journal, for resuming the run."""

from abc import ABC
from collections.abc import Mapping
from copy import copy
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar, TypeVar

Snapshot = Mapping[str, Any]
"""Numbers, texts, None, arrays, and lists and mappings of such."""
V = TypeVar("V")


class Resumable(ABC):
    """What goes on from a snapshot of those attributes that change; it has them by their names, without underscore."""

    changing: ClassVar[tuple[str, ...]]

    def snapshot(self) -> Snapshot:
        """Present state, for `restore`."""
        return {name.removeprefix("_"): getattr(self, name) for name in self.changing}

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        for name in self.changing:
            setattr(self, name, copy(snapshot[name.removeprefix("_")]))


def parts(value: Any) -> Any:
    """A state of a method, a dataclass of numbers and arrays, by its fields."""
    if is_dataclass(value):
        return {field.name: parts(getattr(value, field.name)) for field in fields(value)}
    return [parts(item) for item in value] if isinstance(value, tuple) else value


def like(template: V, found: Any) -> V:
    """Object of the class of ``template`` from its `parts`."""
    if is_dataclass(template):
        whole = {field.name: like(getattr(template, field.name), found[field.name]) for field in fields(template)}
        return type(template)(**whole)
    return tuple(found) if isinstance(template, tuple) else found  # pyright: ignore[reportReturnType]
