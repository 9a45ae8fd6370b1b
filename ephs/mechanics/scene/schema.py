"""The scene file's tables as pydantic models: the keys, their types, units and defaults.

One model a table; where keys are the attributes of an element, the model is made of the element. Values whose form
depends on another key (a number, or one per degree of freedom) are taken as numbers or lists here and brought to shape
by the joint that they are of.
"""

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, create_model

from ephs.mechanics.scene.bodies import BodyEntry, World
from ephs.mechanics.scene.element import NON_NEGATIVE, POSITIVE, Measured, NumberForm, part_of
from ephs.mechanics.scene.flexible import BeamEntry
from ephs.mechanics.scene.joints import JointEntry
from ephs.mechanics.scene.model import ELEMENTS, KINDS
from ephs.mechanics.scene.registry import REGISTERED
from ephs.mechanics.scene.rotations import Rotation
from ephs.mechanics.scene.schema_numbers import EntryTable, Flag, NonNegative, Number, Positive, Text, Vector, key
from ephs.mechanics.scene.thermal import ThermalNode


class AssemblyEntry(EntryTable):
    """``[assembly]``"""

    adjust: Flag = key(
        "replace an inconsistent initial state by the nearest consistent one, and report the change", False
    )
    inertia: Literal["strict", "warn", "nearest"] = key(
        '"warn" accepts a physically impossible inertia, "nearest" takes the nearest possible one', "strict"
    )


class PartEntry(EntryTable):
    """``[parts.NAME]``"""

    use: Text = key("another scene file or model, in the folder of this file, or below")
    position: Vector = key("position of the part's ground in this world, m", [0.0, 0.0, 0.0])
    rotation: Rotation = key("its orientation, [w, x, y, z] or a table", [1.0, 0.0, 0.0, 0.0])


_RANGES: Mapping[Any, Any] = {None: Number, POSITIVE: Positive, NON_NEGATIVE: NonNegative}


def _table_of(kind: type[Measured], title: str) -> Any:
    """The model of a table whose keys are an element's numbers that have a meaning."""
    keys: dict[str, Any] = {}
    for each in fields(kind):  # pyright: ignore[reportArgumentType] - all are dataclasses
        number, said = part_of(each.type, NumberForm), part_of(each.type, str)
        if number and said:
            form = _RANGES[number.least]
            if number.count:
                form = Annotated[list[form], Field(min_length=number.count, max_length=number.count)]
            default = each.default if each.default_factory is MISSING else each.default_factory().tolist()
            keys[each.name] = form, key(said, ... if default is MISSING else default)
    return create_model(f"{kind.__name__}Entry", __base__=EntryTable, __doc__=f"``[{title}]``", **keys)


WorldEntry: Any = _table_of(World, "world")
_TABLES: dict[str, tuple[type[EntryTable], str]] = {
    "bodies": (BodyEntry, "rigid bodies, and massless frames"),
    "joints": (JointEntry, "joints between two bodies, or a body and the ground"),
    "beams": (BeamEntry, "rods that bend, twist and stretch"),
    "thermal": (_table_of(ThermalNode, "thermal.NAME"), "thermal nodes: stores of heat"),
}
_SECTIONS = {name: (KINDS[name], KINDS[name].said) if name in KINDS else _TABLES[name] for name in ELEMENTS}
_SECTIONS["parts"] = PartEntry, "other scene files as subsystems"
SECTIONS: dict[str, type[EntryTable]] = {key: table for key, (table, _) in _SECTIONS.items()}
_Name: TypeAlias = Text | None
_FILE: dict[str, Any] = {
    "format": (Literal[1], key("version of the file format, always 1")),
    "name": (_Name, key("name of the scene; default: the file's name", None)),
    "world": (WorldEntry | None, key("gravity and the reference environment", None)),
    "assembly": (
        AssemblyEntry,
        key("treatment of inconsistent initial states and inertias", AssemblyEntry()),
    ),
}
for _key, (_table, _said) in _SECTIONS.items():
    _FILE[_key] = dict[str, _table], key(_said, default_factory=dict)
FILE_KEYS = tuple(_FILE)
"""Keys at the top of scene files, without registered sections."""


def scene_file() -> Any:
    """The model of a scene file, registered sections included."""
    own: dict[str, Any] = {
        section: (dict[str, of], key(of.said, default_factory=dict)) for section, of in REGISTERED.items()
    }
    return create_model("SceneFile", __base__=EntryTable, __doc__="A scene file.", **_FILE, **own)


def json_schema() -> dict[str, Any]:
    """The JSON schema of a scene file, for editors."""
    return scene_file().model_json_schema()
