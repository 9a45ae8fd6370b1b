"""Patterns to and from Catlab: undirected wiring diagrams in the JSON of attributed C-sets.

A diagram is four tables, Box, Port, OuterPort and Junction, whose rows refer to each other by numbers from 1 on: the
serialisation of ACSets.jl, `generate_json_acset`, of the schema `SchTypedNamedRelationDiagram` of Catlab.jl. Diagrams
of its smaller schemas, without names or types, are read as well.
"""

import json
from collections.abc import Mapping
from typing import Any, cast

from ephs.operad.pattern import Pattern
from ephs.operad.quantities import Quantity
from ephs.operad.reading import Reader
from ephs.operad.text import quantity_text
from ephs.operad.translation import Translation, Wiring, box_name, lost_of

_READ = Reader("wiring diagram")
_COLUMNS = {
    "Box": {"name"},
    "Port": {"box", "junction", "port_type", "port_name"},
    "OuterPort": {"outer_junction", "outer_port_type", "outer_port_name"},
    "Junction": {"junction_type", "variable"},
}
_TYPES = ("Type", "Name", "VarName")
Row = Mapping[str, object]


def to_catlab(pattern: Pattern) -> Translation[str]:
    """The pattern as the JSON text of a typed relation diagram with names, which Catlab's `read_json_acset` reads.

    The types are quantities, in the words of `Pattern.to_text`.
    """
    junctions = {path: number for number, path in enumerate(pattern.junctions, 1)}
    types = {path: quantity_text(junction.quantity) for path, junction in pattern.junctions.items()}
    ports = [
        {"box": number, "junction": junctions[p.junction], "port_type": types[p.junction], "port_name": str(name)}
        for number, content in enumerate(pattern.boxes.values(), 1)
        for name, p in content.ports.items()
    ]
    outer = [
        {"outer_junction": junctions[path], "outer_port_type": types[path], "outer_port_name": str(path)}
        for path in pattern.interface
    ]
    tables: dict[str, list[dict[str, Any]]] = {
        "Box": [{"name": box_name(box)} for box in pattern.boxes],
        "Port": ports,
        "OuterPort": outer,
        "Junction": [{"junction_type": types[path], "variable": str(path)} for path in pattern.junctions],
    }
    document = {name: [{"_id": i} | row for i, row in enumerate(rows, 1)] for name, rows in tables.items()}
    text = json.dumps(document | {name: list[Any]() for name in _TYPES}, ensure_ascii=False, indent=1)
    return Translation(text + "\n", tuple(lost_of(pattern)))


def from_catlab(text: str | bytes, quantities: Mapping[str, Quantity] | Quantity | None = None) -> Translation[Pattern]:
    """Read a diagram.

    Parameters
    ----------
    quantities
        Type -> quantity, for types that are not the words of `Pattern.to_text`; or the quantity of all junctions.

    Raises
    ------
    PatternError
        For what is no such document, a type without quantity, a junction with two outer ports, or one with an outer
        port but no inner one, which no pattern has; the message says where.
    """
    lost: list[str] = []
    tables = _tables(_READ.json(text), lost)
    boxes, junctions = tables["Box"], tables["Junction"]
    kinds = [_attribute(f"Junction[{k}]", row, "junction_type") for k, row in enumerate(junctions)]
    ports: list[list[tuple[str, int]]] = [[] for _ in boxes]
    for k, row in enumerate(tables["Port"]):
        where = f"Port[{k}]"
        box, junction = _part(where, row, "box", len(boxes)), _part(where, row, "junction", len(junctions))
        _require_type(where, _attribute(where, row, "port_type"), kinds, junction)
        name = _attribute(where, row, "port_name")
        ports[box].append((f"port{len(ports[box]) + 1}" if name is None else name, junction))
    outer: list[tuple[str | None, int]] = []
    for k, row in enumerate(tables["OuterPort"]):
        where = f"OuterPort[{k}]"
        junction = _part(where, row, "outer_junction", len(junctions))
        _require_type(where, _attribute(where, row, "outer_port_type"), kinds, junction)
        outer.append((_attribute(where, row, "outer_port_name"), junction))
    names = [_attribute(f"Junction[{k}]", row, "variable") for k, row in enumerate(junctions)]
    called = [_attribute(f"Box[{k}]", row, "name") for k, row in enumerate(boxes)]
    diagram = Wiring(_READ.what, list(zip(kinds, names, strict=True)), list(zip(called, ports, strict=True)), outer)
    found = diagram.pattern(quantities)
    return Translation(found.result, (*lost, *found.lost))


def _tables(value: object, lost: list[str]) -> dict[str, list[Row]]:
    """The four tables, and the list of the parts without a counterpart."""
    document = dict(_READ.mapping("document", value))
    if missing := sorted(_COLUMNS.keys() - document.keys()):
        _READ.refuse("document", f"no table {missing[0]}", f"the tables {', '.join(_COLUMNS)}")
    tables: dict[str, list[Row]] = {}
    for name, rows in document.items():
        listed = [dict(_READ.mapping(f"{name}[{k}]", row)) for k, row in enumerate(_READ.list(name, rows))]
        for k, row in enumerate(listed):
            if row.get("_id", k + 1) != k + 1:
                _READ.refuse(f"{name}[{k}]._id", row["_id"], f"{k + 1}, the number of the row")
        if name in _COLUMNS:
            tables[name] = cast("list[Row]", listed)
            extra = sorted({column for row in listed for column in row} - _COLUMNS[name] - {"_id"})
            lost += [f"column {column} of table {name}" for column in extra]
        elif listed:
            lost.append(f"table {name}")
    return tables


def _part(where: str, row: Row, column: str, count: int) -> int:
    """A row of another table, from 0 on."""
    number = _READ.whole(f"{where}.{column}", row.get(column))
    if not 1 <= number <= count:
        _READ.refuse(f"{where}.{column}", number, f"a number from 1 to {count}")
    return number - 1


def _attribute(where: str, row: Row, column: str) -> str | None:
    value = row.get(column)
    return None if value is None else _READ.text(f"{where}.{column}", value)


def _require_type(where: str, kind: str | None, kinds: list[str | None], junction: int) -> None:
    if kind is not None and kind != kinds[junction]:
        _READ.refuse(where, f"the type {kind}", f"{kinds[junction]}, the type of junction {junction + 1}")
