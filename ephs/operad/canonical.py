"""Canonical representatives of equal patterns: sorted, with generated names."""

from itertools import count

from ephs.operad.directory import Directory
from ephs.operad.names import Path
from ephs.operad.normal import NormalForm, SharedState
from ephs.operad.parts import Junction, Port
from ephs.operad.pattern import Pattern


def canonical(pattern: Pattern) -> Pattern:
    """Canonical representative of the patterns equal to the given one; it depends on the normal form only.

    Paths are sorted. State ports lie on the least power-bearing junction of their class, else on its least outer port,
    else on a junction named ``state0``, ``state1``, … by the least of their ports.
    """
    if pattern.is_identity:
        return Pattern.identity(sorted(pattern.interface.items()))
    return from_normal(pattern.normal_form)


def from_normal(form: NormalForm) -> Pattern:
    """The canonical pattern of a normal form."""
    junctions = {path: Junction(j.quantity, j.exposed) for path, j in form.junctions.items()}
    wires: dict[Path, dict[Path, Port]] = {box: {} for box in sorted(form.boxes)}
    for path, junction in form.junctions.items():
        for box, name in junction.ports:
            wires[box][name] = Port(path, True)
    links: list[list[Path]] = []
    names = (Path((f"state{number}",)) for number in count())
    taken = {path[0] for path in (*form.boxes, *junctions)} | {p[0] for c in form.classes for p, _ in c.outer}
    for each in sorted(form.classes, key=rank):
        outer = sorted(each.outer, key=lambda item: item[0])
        for path, quantity in outer:
            junctions[path] = Junction(quantity, True, False)
        named = sorted(each.members) + [path for path, _ in outer if path not in each.members]
        if not named:
            named = [next(name for name in names if name[0] not in taken)]
            junctions[named[0]] = Junction(each.quantity)
        for box, name in each.ports:
            wires[box][name] = Port(named[0], False)
        if len(named) > 1:
            links.append(named)
    boxes = {box: Directory(sorted(ports.items())) for box, ports in wires.items()}
    return Pattern(sorted(junctions.items(), key=lambda item: item[0]), boxes, links)


def rank(each: SharedState) -> tuple[list[Path], list[Path], list[tuple[Path, Path]]]:
    """The place of a class among those of its pattern."""
    return sorted(each.members), sorted(path for path, _ in each.outer), sorted(each.ports)
