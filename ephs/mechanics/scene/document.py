"""Scenes as JSON text: every number resolved, exact in a round trip. Solution files carry them.

Attributes are read by the types in their annotations.
"""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Annotated, Any, get_args, get_origin

import numpy as np

from ephs.mechanics.scene.custom import Element
from ephs.mechanics.scene.model import Scene, frozen
from ephs.mechanics.scene.registry import elements_from
from ephs.solve.posing.motion_law import HarmonicMotion, MotionLaw, PolynomialMotion, TabulatedMotion

_ANY_OF = {MotionLaw: (PolynomialMotion, HarmonicMotion, TabulatedMotion), "Scene": (Scene,)}
"""Annotation -> the classes that it stands for."""


def scene_to_text(scene: Scene) -> str:
    """The scene as JSON."""
    return json.dumps(_plain(scene))


def scene_from_text(text: str) -> Scene:
    """The scene of `scene_to_text`."""
    return _made((Scene,), json.loads(text))


@cache
def _kept(of: type[Any]) -> dict[str, tuple[Any, ...]]:
    """Attributes of a class that are kept -> the types that each may be."""
    return {field.name: _types(field.type) for field in fields(of) if field.init}


@cache
def _types(annotation: Any) -> tuple[Any, ...]:
    plain = annotation.__origin__ if get_origin(annotation) is Annotated else annotation
    found = get_args(plain) if isinstance(plain, UnionType) else (plain,)
    return tuple(each for kind in found for each in _ANY_OF.get(kind, (kind,)))


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


def _rows(value: Any) -> Any:
    """A value; an array of an older file as nested lists."""
    is_array = isinstance(value, Mapping) and value.keys() == {"shape", "values"}
    return np.reshape(value["values"], value["shape"]).tolist() if is_array else value


def _made(types: tuple[Any, ...], value: Any) -> Any:
    """A value of one of these types."""
    if PolynomialMotion in types and isinstance(value, int | float):  # of older files
        value = {"coefficients": [value]}
    if value is None or isinstance(value, str | float | int) or types[0] is Any:
        return value
    kind, inner = get_origin(types[0]) or types[0], get_args(types[0])
    if kind is np.ndarray:
        return frozen(np.array(value["values"], dtype=float).reshape(value["shape"]))
    if kind is tuple:
        return tuple(_made(_types(inner[0]), each) for each in value)
    if kind is Mapping:
        return {name: _made(_types(inner[1]), each) for name, each in value.items()}
    if not isinstance(value, Mapping):
        return value
    if issubclass(kind, Element):
        return kind.of_table(value["name"], {key: _rows(each) for key, each in value.items()})
    cls: Any = next((each for each in types if value.keys() <= _kept(each).keys()), kind)
    return cls(**{
        key: elements_from(each) if (cls, key) == (Scene, "elements") else _made(_kept(cls)[key], each)
        for key, each in value.items()
    })  # fmt: skip
