"""Diagnostics of patterns that are well-formed but probably mistaken."""

from dataclasses import dataclass
from types import MappingProxyType
from typing import final

from ephs.operad.names import Path, paths_text
from ephs.operad.normal import powered
from ephs.operad.pattern import Pattern

_TEXTS: MappingProxyType[str, str] = MappingProxyType(
    {
        "open-circuit": "outer port {paths} bears power, but only state ports meet it inside: no flow can"
        " pass; expose it as a state port with power=False",
        "linked-balances": "the junctions {paths} share their state but each has its own effort and balance"
        " of flows; to join them expose the inner one as a power port",
    }
)


@final
@dataclass(frozen=True, slots=True)
class Diagnostic:
    """A remark on a pattern: its kind, ``"open-circuit"`` or ``"linked-balances"``, and junctions."""

    kind: str
    junctions: tuple[Path, ...]

    def __str__(self) -> str:
        return _TEXTS[self.kind].format(paths=paths_text(self.junctions))


def diagnose(pattern: Pattern) -> list[Diagnostic]:
    """All remarks on a pattern, sorted."""
    wired = {port.junction for box in pattern.boxes.values() for port in box.ports.values() if port.power}
    open_ports = [p for p, j in pattern.junctions.items() if j.exposed and j.power and p not in wired]
    bearing = powered(pattern.junctions, pattern.boxes)
    balances = [tuple(sorted(members & bearing)) for members in pattern.links]
    remarks = [Diagnostic("open-circuit", (path,)) for path in sorted(open_ports)]
    return remarks + [Diagnostic("linked-balances", paths) for paths in sorted(balances) if len(paths) > 1]
