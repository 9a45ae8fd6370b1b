"""Present state of a run as plain data: entries of a journal, for resuming the run."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

Snapshot = Mapping[str, Any]
"""Numbers, texts, None, arrays, and lists and mappings of such."""
V = TypeVar("V")


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
