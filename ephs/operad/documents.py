"""Patterns as documents: plain dictionaries and JSON, by the published schema `SCHEMA_FILE`.

A document is canonical: equal patterns have equal documents, in every process.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any, NoReturn, cast

from ephs.operad.canonical import canonical
from ephs.operad.errors import PatternError
from ephs.operad.parts import Junction
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import PortType, Quantity, Space, known_quantity, quantity_word

__all__ = ["SCHEMA_FILE", "from_dict", "from_json", "quantity_from", "quantity_record", "to_dict", "to_json"]

FORMAT = 1
SCHEMA_FILE = FilePath(__file__).with_name("pattern.schema.json")
_EXPOSED = {"power": True, "state": False}


def to_dict(pattern: Pattern) -> dict[str, Any]:
    """The pattern as nested dictionaries of text and numbers; see `Pattern.to_dict`."""
    form = canonical(pattern)
    if form.is_identity:
        ports = {
            str(p): quantity_record(t.quantity) | ({} if t.power else {"exposed": "state"})
            for p, t in form.interface.items()
        }
        return {"format": FORMAT, "identity": ports}
    junctions = {
        str(path): quantity_record(j.quantity) | ({"exposed": "power" if j.power else "state"} if j.exposed else {})
        for path, j in form.junctions.items()
    }
    boxes = {str(b): {str(p): str(port) for p, port in box.ports.items()} for b, box in form.boxes.items()}
    links = sorted([str(path) for path in sorted(group)] for group in form.links)
    return {"format": FORMAT, "junctions": junctions, "boxes": boxes} | ({"links": links} if links else {})


def to_json(pattern: Pattern) -> str:
    """The document as JSON text; see `Pattern.to_json`."""
    return json.dumps(to_dict(pattern), ensure_ascii=False, indent=1, allow_nan=False) + "\n"


def quantity_record(quantity: Quantity) -> dict[str, Any]:
    """A quantity as part of a document: its name, with arguments; or all that it is, where it has none."""
    frame = {} if quantity.frame is None else {"frame": quantity.frame}
    known = quantity_word(quantity)
    if known is None:
        space = quantity.space
        described = {"name": space.name, "dim": space.dim, "size": space.size, "parameters": dict(space.parameters)}
        return {"quantity": {"kind": quantity.kind, "space": described, "parity": quantity.parity}} | frame
    word, arguments, parameters = known
    return {"quantity": word} | ({"pair": arguments[0]} if arguments else {}) | parameters | frame


def from_json(text: str | bytes) -> Pattern:
    """Read a document; see `Pattern.from_json`."""
    if not isinstance(text, str | bytes):  # pyright: ignore[reportUnnecessaryIsInstance]  # user input
        _refuse("document", type(text).__name__, "JSON text")
    try:
        found = json.loads(text, object_pairs_hook=_unique, parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        _refuse(f"line {error.lineno}, column {error.colno}", error.msg, "JSON")
    except (UnicodeDecodeError, RecursionError) as error:
        _refuse("document", type(error).__name__, "JSON text in UTF-8 of moderate depth")
    except PatternError:
        raise
    except ValueError as error:  # a number of too many digits
        _refuse("document", str(error), "JSON")
    return from_dict(found)


def from_dict(document: Mapping[str, object]) -> Pattern:
    """Read a document that is already parsed; see `Pattern.from_dict`."""
    found = _record("document", document, {"format"}, {"junctions", "boxes", "links", "identity"})
    if type(found["format"]) is not int or found["format"] != FORMAT:
        _refuse("format", found["format"], f"{FORMAT}")
    if "identity" in found:
        _record("document", found, {"format", "identity"}, set())
        return Pattern.identity(
            [(name, _port_type(f"identity.{name}", port)) for name, port in _mapping("identity", found["identity"])]
        )
    _record("document", found, {"format", "junctions", "boxes"}, {"links"})
    junctions = [(name, _junction(f"junctions.{name}", j)) for name, j in _mapping("junctions", found["junctions"])]
    boxes = [(name, dict(_wires(f"boxes.{name}", ports))) for name, ports in _mapping("boxes", found["boxes"])]
    return Pattern(junctions, boxes, _links(found.get("links", [])))


def quantity_from(where: str, record: Mapping[str, object]) -> Quantity:
    """Read the quantity in a document's record."""
    given, frame = record["quantity"], record.get("frame")
    if "frame" in record and not isinstance(frame, str):
        _refuse(f"{where}.frame", frame, "text")
    frame = frame if isinstance(frame, str) else None
    if isinstance(given, str):
        parameters = {name: _number(f"{where}.{name}", record[name]) for name in ("pitch",) if name in record}
        arguments = (_text(f"{where}.pair", record["pair"]),) if "pair" in record else ()
        found = known_quantity(given, arguments, **parameters)
        if found is None:
            _refuse(f"{where}.quantity", given, "the name of a quantity, with a pair where it has one")
        return found.in_frame(frame)
    if extra := sorted({"pair", "pitch"} & record.keys()):
        _refuse(where, f"key {extra[0]}", "none beside a quantity that is described")
    whole = _record(f"{where}.quantity", given, {"kind", "space", "parity"}, set())
    at = f"{where}.quantity.space"
    space = _record(at, whole["space"], {"name", "dim", "size"}, {"parameters"})
    values = _mapping(f"{at}.parameters", space.get("parameters", {}))
    parameters = tuple((name, _number(f"{at}.parameters.{name}", value)) for name, value in values)
    dim, size = (_whole(f"{at}.{name}", space[name]) for name in ("dim", "size"))
    place = Space(_text(f"{at}.name", space["name"]), dim, size, parameters)
    kind, parity = _text(f"{where}.quantity.kind", whole["kind"]), _whole(f"{where}.quantity.parity", whole["parity"])
    return Quantity(kind, place, parity, frame)


def _junction(where: str, value: object) -> Junction:
    record = _record(where, value, {"quantity"}, {"pair", "pitch", "frame", "exposed"})
    exposed = record.get("exposed")
    if "exposed" in record and (not isinstance(exposed, str) or exposed not in _EXPOSED):
        _refuse(f"{where}.exposed", exposed, '"power" or "state"')
    return Junction(quantity_from(where, record), exposed is not None, _EXPOSED.get(str(exposed), True))


def _port_type(where: str, value: object) -> PortType:
    junction = _junction(where, value)
    return PortType(junction.quantity, junction.power)


def _wires(where: str, value: object) -> list[tuple[str, str]]:
    return [(name, _text(f"{where}.{name}", wire)) for name, wire in _mapping(where, value)]


def _links(value: object) -> list[list[str]]:
    return [
        [_text(f"links[{i}][{k}]", name) for k, name in enumerate(_list(f"links[{i}]", group))]
        for i, group in enumerate(_list("links", value))
    ]


def _record(where: str, value: object, needed: set[str], allowed: set[str]) -> dict[str, object]:
    found = dict(_mapping(where, value))
    if missing := sorted(needed - found.keys()):
        _refuse(where, f"no key {missing[0]}", f"the keys {', '.join(sorted(needed))}")
    if extra := sorted(found.keys() - needed - allowed):
        _refuse(where, f"key {extra[0]}", f"only {', '.join(sorted(needed | allowed))}")
    return found


def _mapping(where: str, value: object) -> list[tuple[str, object]]:
    if not isinstance(value, Mapping):
        _refuse(where, value, "an object")
    pairs = list(cast("Mapping[object, object]", value).items())
    for key, _ in pairs:
        if not isinstance(key, str):
            _refuse(where, key, "keys that are text")
    return cast("list[tuple[str, object]]", pairs)


def _list(where: str, value: object) -> Sequence[object]:
    if not isinstance(value, list | tuple):
        _refuse(where, value, "a list")
    return cast("Sequence[object]", value)


def _text(where: str, value: object) -> str:
    return value if isinstance(value, str) else _refuse(where, value, "text")


def _whole(where: str, value: object) -> int:
    return value if type(value) is int else _refuse(where, value, "a whole number")


def _number(where: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        _refuse(where, value, "a number")
    try:
        return float(value)
    except OverflowError:
        _refuse(where, "a whole number of too many digits", "a number")


def _unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        again = next(name for name in found if names.count(name) > 1)
        _refuse("document", f"the key {again} twice in one object", "each key once")
    return found


def _no_constant(name: str) -> NoReturn:
    _refuse("document", name, "finite numbers")


def _refuse(where: str, found: object, expected: str) -> NoReturn:
    shown = found if isinstance(found, str) else repr(found)
    raise PatternError("json", where=where, found=shown, expected=expected)
