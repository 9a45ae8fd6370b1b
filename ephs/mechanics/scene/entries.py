"""From the parsed text to validated tables, all faults collected.

A table with a fault is still taken as far as it goes: the faulty keys fall back to a neutral value and are
remembered as spoiled, so that the checks after this one can look at the rest of the table.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar, final, get_args

from pydantic import ValidationError, WrapValidator

from ephs.mechanics.scene.checked import Checked
from ephs.mechanics.scene.custom import Element
from ephs.mechanics.scene.errors import Fault, did_you_mean, fault, listing, nearest_name, shown
from ephs.mechanics.scene.registry import REGISTERED
from ephs.mechanics.scene.rotations import FORMS
from ephs.mechanics.scene.schema import FILE_KEYS, SECTIONS, AssemblyEntry, WorldEntry
from ephs.mechanics.scene.schema_numbers import LARGEST, EntryTable
from ephs.mechanics.scene.sections import SectionEntry

LONGEST_NAME = 200
E = TypeVar("E", bound=EntryTable)

# Neutral values for required keys that are missing or faulty.
_NEUTRAL: dict[str, Any] = {
    "type": "free",
    "bodies": ["ground", "ground"],
    "capacity": 1.0,
    "temperature": 1.0,
    "use": "?",
    "section": SectionEntry(),
}

_EXPECTED: Mapping[str, tuple[str, str]] = {
    "float_type": ("type", "a number"),
    "int_type": ("type", "a whole number"),
    "string_type": ("type", "a text in quotes"),
    "string_too_short": ("range", "a text that is not empty"),
    "bool_type": ("type", "true or false"),
    "list_type": ("type", "a list"),
    "numbers": ("type", "a number or a list of numbers"),
    "limits": ("range", "[lower, upper], lower < upper, nan for none"),
    "ordered": ("range", "[lower, upper], lower ≤ upper"),
    "inertia_length": ("length", "3 or 6 numbers: xx yy zz [xy xz yz]"),
    "rotation": ("range", FORMS),
    "rotation_type": ("type", f"a unit quaternion [w, x, y, z], or a table with {FORMS}"),
    "points_length": ("length", "4 to {most} points"),
    "too_short": ("length", "{min_length} entries"),
    "too_long": ("length", "{max_length} entries"),
    "greater_than": ("range", "a number above {gt:g}"),
    "greater_than_equal": ("range", "a number not below {ge:g}"),
    "less_than_equal": ("range", "a number not above {le:g}"),
    "literal_error": ("range", "{expected}"),
}


@final
@dataclass(frozen=True, slots=True)
class Document:
    """A scene file's tables: ``sections[section][name]`` is a `Checked` table; ``world`` is None where the
    file has none."""

    name: str
    world: Any
    assembly: AssemblyEntry
    sections: Mapping[str, Mapping[str, Checked[Any]]]


def read_document(raw: Mapping[str, Any], default_name: str, faults: list[Fault]) -> Document:
    """Validate a parsed file table by table; append the faults."""
    known = [*FILE_KEYS, *REGISTERED]
    for key in raw:
        if key not in known:
            faults.append(_unknown_key(key, key, known))
    _check_format(raw, faults)
    name = raw.get("name", default_name)
    if not isinstance(name, str) or not name:
        faults.append(fault("type", "name", shown(name), what="a text in quotes"))
        name = default_name
    if not name.isprintable() or {"/", "\\"} & set(name) or name in (".", "..") or len(name) > LONGEST_NAME:
        faults.append(fault("scene name", "name", shown(name)))
        name = "scene"
    world = validate(WorldEntry, raw["world"], "world", faults).entry if "world" in raw else None
    assembly = validate(AssemblyEntry, raw.get("assembly", {}), "assembly", faults).entry
    return Document(
        name,
        world,
        assembly,
        {key: _section(of, raw.get(key, {}), key, faults) for key, of in (SECTIONS | REGISTERED).items()},
    )


def validate(model: type[E], raw: Any, key: str, faults: list[Fault]) -> Checked[E]:
    """Validate one table; append its faults, and return its valid entries."""
    if not isinstance(raw, Mapping):
        faults.append(fault("table", key, shown(raw)))
        raw, spoiled = {}, set(model.model_fields)
    else:
        spoiled = set[str]()
        try:
            return Checked(model.model_validate(raw), key, faults)
        except ValidationError as error:
            items = error.errors(include_url=False)
            misspelled = _misspelled(model, raw, items)
            for item in items:
                if item["type"] != "missing" or item["loc"][0] not in misspelled:
                    faults.append(_translate(model, key, item))
                spoiled.add(str(item["loc"][0]))
            spoiled |= misspelled
    sound = {k: v for k, v in raw.items() if k not in spoiled}
    if issubclass(model, Element):
        return Checked(model.model_construct(**sound), key, faults, frozenset(spoiled))
    required = {k for k, field in model.model_fields.items() if field.is_required()}
    neutral = {k: _NEUTRAL[k] for k in spoiled & required}
    return Checked(model.model_validate({**sound, **neutral}), key, faults, frozenset(spoiled))


def _check_format(raw: Mapping[str, Any], faults: list[Fault]) -> None:
    found = raw.get("format")
    if found is None or isinstance(found, bool) or found != 1:
        faults.append(fault("format", "format", "nothing" if found is None else shown(found)))


def _section(of: type[EntryTable], raw: Any, section: str, faults: list[Fault]) -> dict[str, Checked[Any]]:
    if not isinstance(raw, Mapping):
        faults.append(fault("table", f"{section}.NAME", shown(raw)))
        return {}
    return {name: validate(of, table, f"{section}.{name}", faults) for name, table in raw.items()}


def _translate(model: type[EntryTable], key: str, item: Any) -> Fault:
    """One of pydantic's errors in this project's words."""
    code, location, context = item["type"], item["loc"], item.get("ctx", {})
    path = key + "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    owner = model
    for part in location[:-1]:
        owner = _nested(owner, str(part)) if str(part) in owner.model_fields else owner
    if code == "extra_forbidden":
        return _unknown_key(path, str(location[-1]), list(owner.model_fields))
    if code == "missing":
        what = owner.model_fields[str(location[-1])].description or "a value"
        return fault("missing", path, "nothing", what=what)
    value = item["input"]
    found = shown(value)
    if code == "finite_number" or (isinstance(value, float) and not math.isfinite(value)):
        return fault("finite", path, found)
    if code == "large" or context.get("ge") == -LARGEST or context.get("le") == LARGEST:
        return fault("large", path, found, most=LARGEST)
    if code in ("model_type", "dict_type", "model_attributes_type"):
        return fault("table", path, found)
    if code in _EXPECTED:
        text, what = _EXPECTED[code]
        return fault(text, path, found, what=what.format_map(context))
    return fault("type", path, found, what=item["msg"])


def _misspelled(model: type[EntryTable], raw: Mapping[str, Any], items: Iterable[Any]) -> set[str]:
    """The keys that unknown ones were meant to be: one fault says it, and none that they are missing."""
    unknown = [str(item["loc"][0]) for item in items if item["type"] == "extra_forbidden" and len(item["loc"]) == 1]
    return {near for key in unknown if (near := nearest_name(key, model.model_fields)) is not None and near not in raw}


def _nested(model: type[EntryTable], key: str) -> type[EntryTable]:
    """The table at a key of a table; the table itself if there is none."""
    kinds: list[Any] = [model.model_fields[key].annotation, *model.model_fields[key].metadata]
    while kinds:
        kind = kinds.pop()
        if isinstance(kind, type) and issubclass(kind, EntryTable):
            return kind
        kinds += [kind.json_schema_input_type] if isinstance(kind, WrapValidator) else get_args(kind)
    return model


def _unknown_key(path: str, key: str, known: list[str]) -> Fault:
    hint = did_you_mean(key, known, "take it out")
    return fault("unknown key", path, "an unknown key", known=listing(known, 30), hint=hint)
