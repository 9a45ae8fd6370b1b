"""The scene file's reference as Markdown tables, made of the schema that reads the files."""

import json
from collections.abc import Mapping
from typing import Any

from ephs.mechanics.scene.schema import json_schema

TOP = "the file"
"""Name of the table of the keys at the top of a file."""

_PLURAL = {"number": "numbers", "string": "texts"}


def scene_tables() -> dict[str, str]:
    """Every table of a scene file: its name, such as ``[bodies.NAME]`` or ``frame`` -> its keys, in Markdown.

    Tables follow the order in which the file's keys are declared; those that stand inside others come after them.
    """
    schema = json_schema()
    found: dict[str, str] = {TOP: _table(schema, schema)}
    _inner(schema, schema, found)
    return found


def _inner(part: Mapping[str, Any], schema: Mapping[str, Any], found: dict[str, str]) -> None:
    """Add the tables to which a table's keys refer."""
    for value in part["properties"].values():
        for name in _references(value):
            entry = schema["$defs"][name]
            if _title(entry) not in found:
                found[_title(entry)] = _table(entry, schema)
                _inner(entry, schema, found)


def _references(value: Mapping[str, Any]) -> list[str]:
    """The names of definitions in a property."""
    own = [value["$ref"].rpartition("/")[2]] if "$ref" in value else []
    nested = [*value.get("anyOf", ()), *(value[key] for key in ("items", "additionalProperties") if key in value)]
    return own + [name for part in nested if isinstance(part, Mapping) for name in _references(part)]


def _title(entry: Mapping[str, Any]) -> str:
    """A table's heading from its class, such as ``[joints.NAME]``, or the name of a nested table, such as frame."""
    said = entry["description"].splitlines()[0].strip("`")
    return said if said.startswith("[") else entry["title"].removesuffix("Entry").lower()


def _table(entry: Mapping[str, Any], schema: Mapping[str, Any]) -> str:
    rows = ["| key | type | default | meaning |", "| --- | --- | --- | --- |"]
    needed = entry.get("required", ())
    for key, value in entry["properties"].items():
        default = "required" if key in needed else _default(value)
        rows.append(f"| `{key}` | {_type(value, schema)} | {default} | {value.get('description', '')} |")
    return "\n".join(rows)


def _default(value: Mapping[str, Any]) -> str:
    given = value.get("default")
    return "" if given is None or isinstance(given, dict) else f"`{json.dumps(given)}`"


def _type(value: Mapping[str, Any], schema: Mapping[str, Any]) -> str:
    """A property's type in words."""
    if "anyOf" in value:
        return " or ".join(_type(each, schema) for each in value["anyOf"] if each.get("type") != "null")
    if "$ref" in value:
        return "table " + _title(schema["$defs"][value["$ref"].rpartition("/")[2]])
    if "const" in value or "enum" in value:
        return " or ".join(f"`{json.dumps(each)}`" for each in value.get("enum", [value.get("const")]))
    match value["type"]:
        case "array":
            return _array(value, schema)
        case "object" if value.get("maxProperties") == 0:
            return "an empty table"
        case "object":
            return _type(value["additionalProperties"], schema).replace("table", "tables", 1)
        case "number":
            bounds = {"minimum": "≥", "exclusiveMinimum": ">"}
            return " ".join(["number", *(f"{sign} {value[key]:g}" for key, sign in bounds.items() if key in value)])
        case "boolean":
            return "`true` or `false`"
        case "string":
            return "text"
        case other:
            return str(other)


def _array(value: Mapping[str, Any], schema: Mapping[str, Any]) -> str:
    """A list type in words: length and type of items."""
    item = value["items"]
    plural = _PLURAL.get(item.get("type", ""))
    if plural is None:
        return "rows of numbers" if item.get("type") == "array" else f"list of {_type(item, schema)}"
    plural += _type(item, schema).removeprefix("number") if item.get("type") == "number" else ""
    least, most = value.get("minItems"), value.get("maxItems")
    if least is None or most is None:
        return f"list of {plural}"
    return f"{least} {plural}" if least == most else f"{least} to {most} {plural}"
