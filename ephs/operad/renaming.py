"""Renaming of boxes, junctions and ports: the symmetric group's action, for named inputs."""

from collections.abc import Iterable, Mapping
from typing import Any

from ephs.operad.directory import Directory
from ephs.operad.errors import PatternError
from ephs.operad.names import ROOT, Path, paths_text
from ephs.operad.parts import Port
from ephs.operad.pattern import Pattern


def rename(
    pattern: Pattern,
    boxes: Mapping[Any, Any],
    junctions: Mapping[Any, Any],
    ports: Mapping[Any, Mapping[Any, Any]],
) -> Pattern:
    """Simultaneous renaming, which allows swaps; see `Pattern.rename`."""
    if not (boxes or junctions or ports):
        return pattern
    if pattern.is_identity:
        return _renamed_identity(pattern, boxes, junctions, ports)
    new_box = _read("box", boxes, pattern.boxes)
    new_junction = _read("junction", junctions, pattern.junctions)
    old_ports = {Path.of(box): names for box, names in ports.items()}
    _require_known("box", old_ports, pattern.boxes)
    wired: list[tuple[Path, Directory[Port]]] = []
    for box, content in pattern.boxes.items():
        new_port = _read(f"port of box {box}", old_ports.get(box, {}), content.ports)
        moved = [(new_port[p], Port(new_junction[q.junction], q.power)) for p, q in content.ports.items()]
        wired.append((new_box[box], Directory(moved, what=f"ports of box {new_box[box]}")))
    # Pairs, not dictionaries: two names that become one must be seen.
    return Pattern(
        Directory([(new_junction[path], value) for path, value in pattern.junctions.items()], what="junctions"),
        Directory(wired, what="boxes"),
        [[new_junction[path] for path in group] for group in pattern.links],
    )


def _renamed_identity(
    pattern: Pattern, boxes: Mapping[Any, Any], junctions: Mapping[Any, Any], ports: Mapping[Any, Mapping[Any, Any]]
) -> Pattern:
    """Renaming of an identity pattern: one set of names for inner and outer ports."""
    inner: Mapping[Any, Any] = next((names for box, names in ports.items() if Path.of(box) == ROOT), junctions)
    new = _read("junction", junctions, pattern.junctions)
    same = _read("port of box .", inner, pattern.junctions) == new
    if not same or any(Path.of(box) != ROOT or Path.of(to) != ROOT for box, to in boxes.items()):
        found = ", ".join(str(name) for name in (*boxes, *junctions, *ports))
        raise PatternError("root-rename", box=".", found=found, expected="the same new names inside and outside")
    return Pattern.identity([(new[path], kind) for path, kind in pattern.interface.items()])


def _read(what: str, names: Mapping[Any, Any], known: Iterable[Path]) -> dict[Path, Path]:
    new = {path: path for path in known}
    given = {Path.of(old): Path.of(to) for old, to in names.items()}
    _require_known(what, given, new)
    return new | given


def _require_known(what: str, given: Iterable[Path], known: Iterable[Path]) -> None:
    if unknown := set(given) - set(known):
        raise PatternError("rename", found=paths_text(unknown), expected=paths_text(known), what=what)
