"""Systems as documents: plain dictionaries and JSON, by the published schema `SCHEMA_FILE`; read without running code.

The parts are a list, the system itself is the last. A system names the parts in its boxes by their numbers, all smaller
than its own: what fills many boxes is written once, and nothing can contain itself.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path as FilePath
from typing import Any, cast

from ephs.operad import ROOT, Directory, Path, Pattern
from ephs.operad.documents import pattern_within, record_in_order
from ephs.operad.documents import to_dict as pattern_record
from ephs.operad.names import MOST_NAMES
from ephs.operad.reading import Reader
from ephs.semantics.bundles.errors import SemanticsError
from ephs.semantics.documents.primitives import primitive_from, primitive_record
from ephs.semantics.systems.system import Filling, System

FORMAT = 1
SCHEMA_FILE = FilePath(__file__).parents[1] / "system.schema.json"
LARGEST = 10_000_000
"""Limit on the number of primitives of a system, reused parts counted at each use."""
_READ = Reader("system")


def to_dict(system: System, proofs: bool = False) -> dict[str, Any]:
    """The system as nested dictionaries of text and numbers; see `System.to_dict`."""
    return _record(system, pattern_record, sorted, proofs)


def to_dict_in_order(system: System) -> dict[str, Any]:
    """The same with junctions and boxes in their own order: what is read back is computed in the same order, too."""
    return _record(system, record_in_order, list)


def _record(
    system: System,
    pattern_of: Callable[[Pattern], dict[str, Any]],
    arranged: Callable[[Any], list[tuple[Path, Filling]]],
    proofs: bool = False,
) -> dict[str, Any]:
    parts: list[dict[str, Any]] = []
    known: dict[str, int] = {}
    numbers: dict[int, int] = {}
    pending: list[tuple[Path, Filling]] = [(ROOT, system)]
    while pending:
        path, filling = pending[-1]
        if isinstance(filling, System):
            inner = arranged(filling.fillings.items())
            if waiting := [(path / box, part) for box, part in reversed(inner) if id(part) not in numbers]:
                pending += waiting
                continue
            places = {str(box): numbers[id(part)] for box, part in inner}
            entry: dict[str, Any] = {"pattern": pattern_of(filling.pattern), "fillings": places}
        else:
            entry = {} if id(filling) in numbers else primitive_record(path, filling, proofs)
        pending.pop()
        if id(filling) in numbers:
            continue
        key = json.dumps(entry, ensure_ascii=False, allow_nan=False)
        numbers[id(filling)] = number = known.setdefault(key, len(parts))
        if number == len(parts):
            parts.append(entry)
    return {"format": FORMAT, "parts": parts}


def to_json(system: System, proofs: bool = False) -> str:
    """The document as JSON text, a line for each part; see `System.to_json`."""
    parts = (json.dumps(part, ensure_ascii=False, allow_nan=False) for part in to_dict(system, proofs)["parts"])
    return f'{{"format": {FORMAT}, "parts": [\n' + ",\n".join(parts) + "\n]}\n"


def from_json(text: str | bytes) -> System:
    """Read a document; see `System.from_json`."""
    return from_dict(cast("Mapping[str, object]", _READ.json(text)))


def from_dict(document: Mapping[str, object]) -> System:
    """Read a document that is already parsed; see `System.from_dict`."""
    found = _READ.record("document", document, {"format", "parts"}, set())
    _READ.format(found, FORMAT)
    made: list[Filling] = []
    sizes: list[tuple[int, int]] = []
    for i, entry in enumerate(_READ.list("parts", found["parts"])):
        where = f"parts[{i}]"
        if "pattern" not in dict(_READ.mapping(where, entry)):
            made.append(primitive_from(_READ, where, entry))
            sizes.append((0, 1))
            continue
        system, size = _system(where, entry, made, sizes)
        made.append(system)
        sizes.append(size)
    last = made[-1] if made else None
    if not isinstance(last, System):
        _READ.refuse(
            "parts", "no system" if last is None else f"the primitive {last.name}", "a system as the last part"
        )
    return last


def _system(
    where: str, value: object, made: list[Filling], sizes: list[tuple[int, int]]
) -> tuple[System, tuple[int, int]]:
    """A system from finished parts; its levels and primitives."""
    found = _READ.record(where, value, {"pattern", "fillings"}, set())
    pattern = pattern_within(_READ, f"{where}.pattern", found["pattern"])
    fillings: dict[Path, Filling] = {}
    levels, count = 1, 0
    for box, number in _READ.mapping(f"{where}.fillings", found["fillings"]):
        at = f"{where}.fillings.{box}"
        index = _READ.whole(at, number)
        if not 0 <= index < len(made):
            _READ.refuse(at, index, f"the number of an earlier part, 0 to {len(made) - 1}")
        fillings[Path.of(box)] = made[index]
        levels, count = max(levels, sizes[index][0] + 1), count + sizes[index][1]
    if levels > MOST_NAMES or count > LARGEST:
        _READ.refuse(where, f"{levels} levels and {count} primitives", f"at most {MOST_NAMES} and {LARGEST}")
    try:
        return System(pattern, Directory(fillings)), (levels, count)
    except SemanticsError as error:
        _READ.refuse(f"{where}.fillings", str(error), "a part that fits for each box")
