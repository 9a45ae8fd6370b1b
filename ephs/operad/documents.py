"""Patterns as documents: plain dictionaries and JSON, by the published schema `SCHEMA_FILE`.

A document is canonical: equal patterns have equal documents, in every process.
"""

import json
from collections.abc import Iterable, Mapping
from math import inf, isfinite
from pathlib import Path as FilePath
from typing import Any, cast

from ephs.operad.canonical import canonical
from ephs.operad.charges import WHOLE, Domain
from ephs.operad.errors import PatternError
from ephs.operad.messages import nearest_of
from ephs.operad.names import Path
from ephs.operad.parts import Box, Junction
from ephs.operad.pattern import Pattern
from ephs.operad.quantities import PortType, Quantity, Space, known_quantity, quantity_names, quantity_word
from ephs.operad.reading import Reader

FORMAT = 1
SCHEMA_FILE = FilePath(__file__).with_name("pattern.schema.json")
_READ = Reader("pattern")
_EXPOSED = {"power": True, "state": False}


def to_dict(pattern: Pattern) -> dict[str, Any]:
    """The pattern as nested dictionaries of text and numbers; see `Pattern.to_dict`."""
    return record_in_order(canonical(pattern))


def record_in_order(form: Pattern) -> dict[str, Any]:
    """The document of a pattern with junctions and boxes in their own order."""
    if form.is_identity:
        return {"format": FORMAT, "identity": {str(p): port_record(t) for p, t in form.interface.items()}}
    return {"format": FORMAT} | contents_record(form.junctions, form.boxes, form.links)


def contents_record(
    junctions: Mapping[Path, Junction], boxes: Mapping[Path, Box], links: Iterable[frozenset[Path]]
) -> dict[str, Any]:
    """Junctions, boxes and links as part of a document, in the order in which they are given."""
    nodes = {
        str(path): quantity_record(j.quantity) | ({"exposed": "power" if j.power else "state"} if j.exposed else {})
        for path, j in junctions.items()
    }
    wires = {str(b): {str(p): str(port) for p, port in box.ports.items()} for b, box in boxes.items()}
    groups = sorted([str(path) for path in sorted(group)] for group in links)
    return {"junctions": nodes, "boxes": wires} | ({"links": groups} if groups else {})


def to_json(pattern: Pattern) -> str:
    """The document as JSON text; see `Pattern.to_json`."""
    return json.dumps(to_dict(pattern), ensure_ascii=False, indent=1, allow_nan=False) + "\n"


def quantity_record(quantity: Quantity) -> dict[str, Any]:
    """A quantity as part of a document: its name with arguments, or its definition if it has no name."""
    frame = {} if quantity.frame is None else {"frame": quantity.frame}
    known = quantity_word(quantity)
    if known is None or known[0] == "species":
        return {"quantity": _described(quantity)} | frame
    word, arguments, parameters = known
    return {"quantity": word} | ({"pair": arguments[0]} if arguments else {}) | parameters | frame


def _described(quantity: Quantity) -> dict[str, Any]:
    space = quantity.space
    place = {"name": space.name, "dim": space.dim, "size": space.size, "parameters": dict(space.parameters)}
    carried = {name: list(row) for name, row in quantity.charges}
    said: dict[str, Any] = {"kind": quantity.kind, "space": place, "parity": quantity.parity}
    said |= {"domain": domain_record(quantity.domain)} if quantity.domain != WHOLE else {}
    return said | ({"charges": carried} if carried else {}) | ({"unit": quantity.unit} if quantity.unit else {})


def port_record(port: PortType) -> dict[str, Any]:
    """Type of a port, as part of a document."""
    return quantity_record(port.quantity) | ({} if port.power else {"exposed": "state"})


def from_json(text: str | bytes) -> Pattern:
    """Read a document; see `Pattern.from_json`."""
    return from_dict(cast("Mapping[str, object]", _READ.json(text)))


def from_dict(document: Mapping[str, object]) -> Pattern:
    """Read a document that is already parsed; see `Pattern.from_dict`."""
    found = _READ.record("document", document, {"format"}, {"junctions", "boxes", "links", "identity"})
    _READ.format(found, FORMAT)
    if "identity" in found:
        _READ.record("document", found, {"format", "identity"}, set())
        return Pattern.identity(
            [(name, port_from(f"identity.{name}", port)) for name, port in _READ.mapping("identity", found["identity"])]
        )
    _READ.record("document", found, {"format", "junctions", "boxes"}, {"links"})
    return Pattern(*contents_from(found))


def contents_from(
    found: Mapping[str, object], where: str = ""
) -> tuple[list[tuple[str, Junction]], list[tuple[str, dict[str, str]]], list[list[str]]]:
    """Read junctions, boxes and links, as a `Pattern` takes them; `where` prefixes the places in messages."""
    junctions, boxes = (_READ.mapping(f"{where}{key}", found[key]) for key in ("junctions", "boxes"))
    return (
        [(name, _junction(f"{where}junctions.{name}", junction)) for name, junction in junctions],
        [(name, dict(_wires(f"{where}boxes.{name}", ports))) for name, ports in boxes],
        _links(f"{where}links", found.get("links", [])),
    )


def pattern_within(reader: Reader, where: str, value: object) -> Pattern:
    """Read a pattern that is part of another document."""
    try:
        return from_dict(cast("Mapping[str, object]", value))
    except PatternError as error:
        reader.refuse(where, str(error), "a pattern")


def quantity_from(where: str, record: Mapping[str, object]) -> Quantity:
    """Read the quantity in a document's record."""
    given, frame = record["quantity"], record.get("frame")
    if "frame" in record and not isinstance(frame, str):
        _READ.refuse(f"{where}.frame", frame, "text")
    frame = frame if isinstance(frame, str) else None
    if isinstance(given, str):
        parameters = {name: _READ.number(f"{where}.{name}", record[name]) for name in ("pitch",) if name in record}
        arguments = (_READ.text(f"{where}.pair", record["pair"]),) if "pair" in record else ()
        found = known_quantity(given, arguments, **parameters)
        if found is None:
            near = nearest_of(given, quantity_names())
            _READ.refuse(f"{where}.quantity", given, f"the name of a quantity, with a pair where it has one{near}")
        return found.in_frame(frame)
    if extra := sorted({"pair", "pitch"} & record.keys()):
        _READ.refuse(where, f"key {extra[0]}", "none beside a quantity that is described")
    whole = _READ.record(f"{where}.quantity", given, {"kind", "space", "parity"}, {"domain", "charges", "unit"})
    at = f"{where}.quantity.space"
    space = _READ.record(at, whole["space"], {"name", "dim", "size"}, {"parameters"})
    values = _READ.mapping(f"{at}.parameters", space.get("parameters", {}))
    parameters = tuple((name, _READ.number(f"{at}.parameters.{name}", value)) for name, value in values)
    dim, size = (_READ.whole(f"{at}.{name}", space[name]) for name in ("dim", "size"))
    place = Space(_READ.text(f"{at}.name", space["name"]), dim, size, parameters)
    kind, parity = (
        _READ.text(f"{where}.quantity.kind", whole["kind"]),
        _READ.whole(f"{where}.quantity.parity", whole["parity"]),
    )
    unit = _READ.text(f"{where}.quantity.unit", whole.get("unit", ""))
    domain = domain_from(f"{where}.quantity.domain", whole["domain"]) if "domain" in whole else WHOLE
    at = f"{where}.quantity.charges"
    charges = tuple((name, _row(f"{at}.{name}", row)) for name, row in _READ.mapping(at, whole.get("charges", {})))
    return Quantity(kind, place, parity, frame, domain, charges, unit)


def domain_record(domain: Domain) -> list[float | None]:
    """The two ends of a domain for JSON: null where unbounded."""
    return [end if isfinite(end) else None for end in domain]


def domain_from(where: str, value: object) -> Domain:
    """Read the two ends of a domain; the inverse of `domain_record`.

    Raises
    ------
    PatternError
        They are not two numbers, with its place.
    """
    ends = _READ.list(where, value)
    if len(ends) != 2:
        _READ.refuse(where, value, "two numbers, null where there is no end")
    low, high = (None if end is None else _READ.number(where, end) for end in ends)
    return (-inf if low is None else low, inf if high is None else high)


def _row(where: str, value: object) -> tuple[float, ...]:
    return tuple(_READ.number(where, number) for number in _READ.list(where, value))


def _junction(where: str, value: object) -> Junction:
    record = _READ.record(where, value, {"quantity"}, {"pair", "pitch", "frame", "exposed"})
    exposed = record.get("exposed")
    if "exposed" in record and (not isinstance(exposed, str) or exposed not in _EXPOSED):
        _READ.refuse(f"{where}.exposed", exposed, '"power" or "state"')
    return Junction(quantity_from(where, record), exposed is not None, _EXPOSED.get(str(exposed), True))


def port_from(where: str, value: object) -> PortType:
    """Read a port; the inverse of `port_record`."""
    junction = _junction(where, value)
    return PortType(junction.quantity, junction.power)


def _wires(where: str, value: object) -> list[tuple[str, str]]:
    return [(name, _READ.text(f"{where}.{name}", wire)) for name, wire in _READ.mapping(where, value)]


def _links(where: str, value: object) -> list[list[str]]:
    return [
        [_READ.text(f"{where}[{i}][{k}]", name) for k, name in enumerate(_READ.list(f"{where}[{i}]", group))]
        for i, group in enumerate(_READ.list(where, value))
    ]
