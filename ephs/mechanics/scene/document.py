"""Scenes as JSON text: every number resolved, exact in a round trip. Solution files carry them."""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

import numpy as np

from ephs.mechanics.scene.adjustment import Adjustment, Changed, Displacement
from ephs.mechanics.scene.attached import ATTACHED
from ephs.mechanics.scene.flexible import Beam, Load, Strain, Tendon
from ephs.mechanics.scene.model import Body, Joint, Marker, Scene, Spring, World, frozen
from ephs.mechanics.scene.motions import law_from
from ephs.mechanics.scene.surfaces import Contact, Surface
from ephs.mechanics.scene.thermal import Conduction, ThermalNode
from ephs.mechanics.shapes.dry import Dry
from ephs.mechanics.shapes.impact import Impact
from ephs.mechanics.shapes.law import Law

__all__ = ["scene_from_text", "scene_to_text"]

_ARRAYS = {
    World: {"gravity"},
    Body: {"inertia", "pose", "twist"},
    Joint: {"frame1", "frame2", "friction", "stiffness", "rest", "drive", "coordinate", "rate", "middle", "limits"},
    Spring: {"at1", "at2"},
    Marker: {"at"},
    Surface: {"frame"},
    Strain: {"stiffness", "rest"},
    Load: {"force", "moment"},
    Tendon: {"points"},
    **{kind: {key for key, of in kind.numbers.items() if of.shape(2)} for kind in ATTACHED.values()},
}
_PARTS = {
    "bodies": Body,
    "joints": Joint,
    "springs": Spring,
    "thermal": ThermalNode,
    "conduction": Conduction,
    "markers": Marker,
    "surfaces": Surface,
    "contacts": Contact,
    "beams": Beam,
    "loads": Load,
    "tendons": Tendon,
    **ATTACHED,
    "parts": Scene,
}


def scene_to_text(scene: Scene) -> str:
    """The scene as JSON."""
    return json.dumps(_plain(scene))


def scene_from_text(text: str) -> Scene:
    """The scene of `scene_to_text`."""
    return _scene(json.loads(text))


@cache
def _kept(of: type[Any]) -> tuple[str, ...]:
    return tuple(field.name for field in fields(of) if field.init)


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, str | float | int):
        return value
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


def _value(cls: Any, data: dict[str, Any]) -> Any:
    arrays = _ARRAYS.get(cls, set())
    return cls(**{key: _array(value) if key in arrays else value for key, value in data.items()})


def _law(given: dict[str, Any]) -> Law | Impact:
    return Law(**given) if "stiffness" in given else Impact(**given)


def _scene(data: dict[str, Any]) -> Scene:
    given = dict(data)
    for key, cls in _PARTS.items():
        entries: dict[str, Any] = given.get(key, {})  # older files lack some
        if cls is Body:
            entries = {name: entry | {"shapes": tuple(entry.get("shapes", ()))} for name, entry in entries.items()}
        if cls is Conduction:
            entries = {name: entry | {"between": tuple(entry["between"])} for name, entry in entries.items()}
        if cls in ATTACHED.values():
            entries = {
                name: {key: tuple(value) if key == "joints" else value for key, value in entry.items()}
                for name, entry in entries.items()
            }
        if cls is Joint:
            entries = {
                name: entry
                | ({"motion": law_from(entry["motion"])} if entry.get("motion") is not None else {})
                | ({"dry": Dry(**entry["dry"])} if entry.get("dry") else {})
                | ({"stop": _law(entry["stop"])} if entry.get("stop") else {})
                | ({"strain": _value(Strain, entry["strain"])} if entry.get("strain") else {})
                for name, entry in entries.items()
            }
        if cls is Contact:
            entries = {
                name: entry | {"surfaces": tuple(entry["surfaces"]), "law": _law(entry["law"])}
                for name, entry in entries.items()
            }
        if cls is Tendon:
            entries = {name: entry | {"bodies": tuple(entry["bodies"])} for name, entry in entries.items()}
        if cls is Beam:
            several = ("ends", "outline", "lengths")
            entries = {
                name: entry | {key: tuple(entry.get(key, ())) for key in several} for name, entry in entries.items()
            }
        make = _scene if cls is Scene else lambda entry, cls=cls: _value(cls, entry)
        given[key] = {name: make(entry) for name, entry in entries.items()}
    given["world"] = _value(World, given["world"])
    adjusted = given["adjusted"]
    if adjusted is not None:
        moved = tuple(Displacement(**entry) for entry in adjusted["moved"])
        changed = tuple(
            Changed(e["joint"], e["what"], tuple(e["given"]), tuple(e["taken"])) for e in adjusted.get("changed", ())
        )
        given["adjusted"] = Adjustment(adjusted["gap"], adjusted["slip"], moved, changed)
    return Scene(**given)
