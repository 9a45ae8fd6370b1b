"""Whether fillings fit the boxes of a pattern."""

from collections.abc import Mapping
from typing import Protocol

from ephs.operad import ROOT, Interface, Path, Pattern
from ephs.operad.matching import interfaces_match
from ephs.semantics.bundles.errors import SemanticsError


class _Fitting(Protocol):
    @property
    def interface(self) -> Interface: ...


def require_fillings(pattern: Pattern, fillings: Mapping[Path, _Fitting]) -> None:
    """Refuse fillings unless each box has one with its interface.

    Raises
    ------
    SemanticsError
        A box without filling, a filling without box, or an interface that does not match.
    """
    boxes, given = set(pattern.boxes), set(fillings)
    if boxes != given:
        raise SemanticsError("fillings", ROOT, expected=_names(boxes), found=_names(given))
    for box, filling in fillings.items():
        wanted = pattern.boxes[box].interface
        if not interfaces_match(wanted, filling.interface):
            found, expected = interface_in_words(filling.interface), interface_in_words(wanted)
            raise SemanticsError("interface", box, found=found, expected=expected)


def interface_in_words(interface: Interface) -> str:
    """Ports with their kinds and spaces, sorted."""
    ports = (f"{'' if t.power else '~'}{p}: {t.quantity.kind} on {t.quantity.space.name}" for p, t in interface.items())
    return "{" + ", ".join(sorted(ports)) + "}"


def _names(paths: set[Path]) -> str:
    return ", ".join(sorted(map(str, paths))) or "none"
