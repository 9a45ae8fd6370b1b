"""Scenes as JSON text: every number resolved, exact in a round trip. Solution files carry them."""

import json
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Annotated, Any, get_args, get_origin

import numpy as np

from ephs.mechanics.scene.adjustment import Adjustment, Changed, Displacement
from ephs.mechanics.scene.custom import Element
from ephs.mechanics.scene.flexible import Strain
from ephs.mechanics.scene.model import ELEMENTS, IDENTITY_POSE, Scene, World, frozen
from ephs.mechanics.scene.motions import law_from
from ephs.mechanics.scene.registry import elements_from
from ephs.mechanics.shapes.dry import Dry
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import ConstitutiveLaw


def scene_to_text(scene: Scene) -> str:
    """The scene as JSON."""
    return json.dumps(_plain(scene))


def scene_from_text(text: str) -> Scene:
    """The scene of `scene_to_text`."""
    return _scene(json.loads(text))


@cache
def _kept(of: type[Any]) -> dict[str, set[Any]]:
    """Attributes of a class that are kept -> the types that each may be, without their parameters."""
    return {field.name: _types(field.type) for field in fields(of) if field.init}


def _types(annotation: Any) -> set[Any]:
    plain = annotation.__origin__ if get_origin(annotation) is Annotated else annotation
    return {get_origin(each) or each for each in (get_args(plain) if isinstance(plain, UnionType) else (plain,))}


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, str | float | int):
        return value
    if isinstance(value, Element):
        return {"name": value.name} | value.model_dump()
    if isinstance(value, np.ndarray):
        return {
            "shape": value.shape,
            "values": value.ravel().tolist(),
        }  # (0, 0) would be lost in nested lists
    if is_dataclass(value):
        return {name: _plain(getattr(value, name)) for name in _kept(type(value))}
    if isinstance(value, Mapping):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value


def _array(value: Any) -> Any:
    return None if value is None else frozen(np.array(value["values"], dtype=float).reshape(value["shape"]))


def _rows(value: Any) -> Any:
    """A value; an array of an older file as nested lists."""
    is_array = isinstance(value, Mapping) and value.keys() == {"shape", "values"}
    return np.reshape(value["values"], value["shape"]).tolist() if is_array else value


def _value(cls: Any, data: dict[str, Any]) -> Any:
    """A value, with its arrays and the laws in it."""
    if issubclass(cls, Element):
        return cls.of_table(data["name"], {key: _rows(value) for key, value in data.items()})

    def made(key: str, value: Any) -> Any:
        if np.ndarray in types[key]:
            return _array(value)
        if tuple in types[key]:
            return tuple(value)
        return _INSIDE[key](value) if value is not None and key in _INSIDE else value

    types = _kept(cls)
    return cls(**{key: made(key, value) for key, value in data.items()})


def _law(given: dict[str, Any]) -> ConstitutiveLaw | Impact:
    return ConstitutiveLaw(**given) if "stiffness" in given else Impact(**given)


_INSIDE: Mapping[str, Callable[[Any], Any]] = {
    "motion": law_from,
    "dry": lambda of: Dry(**of),
    "stop": _law,
    "strain": lambda of: _value(Strain, of),
}


def _scene(data: dict[str, Any]) -> Scene:
    given = dict(data)
    for key, cls in ELEMENTS.items():  # older files lack some
        given[key] = {name: _value(cls, entry) for name, entry in given.get(key, {}).items()}
    given["parts"] = {name: _scene(part) for name, part in given.get("parts", {}).items()}
    given["world"] = _value(World, given["world"])
    given["elements"] = elements_from(given.get("elements", {}))
    given["origin"] = _array(given["origin"]) if "origin" in given else IDENTITY_POSE
    adjusted = given["adjusted"]
    if adjusted is not None:
        moved = tuple(Displacement(**entry) for entry in adjusted["moved"])
        changed = tuple(
            Changed(e["joint"], e["what"], tuple(e["given"]), tuple(e["taken"])) for e in adjusted.get("changed", ())
        )
        given["adjusted"] = Adjustment(adjusted["gap"], adjusted["slip"], moved, changed)
    return Scene(**given)
