"""Whether a filling fits its box: interfaces compared port by port."""

from ephs.operad.errors import PatternError
from ephs.operad.names import Path
from ephs.operad.quantities import Interface, interface_text


def interfaces_match(wanted: Interface, given: Interface) -> bool:
    """Whether ports have the same names and kinds, and quantities that match."""
    return wanted == given or (wanted.keys() == given.keys() and not _differing(wanted, given))


def require_interface(box: Path, wanted: Interface, given: Interface) -> None:
    """Refuse a filling whose interface differs from that of its box.

    Raises
    ------
    PatternError
        It names the box, the first port, and both interfaces.
    """
    if interfaces_match(wanted, given):
        return
    found, expected = interface_text(given), interface_text(wanted)
    first = min(wanted.keys() ^ given.keys() or _differing(wanted, given))
    faults = [f"missing {port}: {wanted[port]}" for port in sorted(wanted.keys() - given.keys())]
    faults += [f"extra {port}: {given[port]}" for port in sorted(given.keys() - wanted.keys())]
    faults += [
        f"differing {port}: found {given[port]}, expected {wanted[port]}" for port in sorted(_differing(wanted, given))
    ]
    raise PatternError("interface", box=box, port=first, found=found, expected=expected, ports="; ".join(faults))


def _differing(wanted: Interface, given: Interface) -> list[Path]:
    return [
        port
        for port in wanted.keys() & given.keys()
        if wanted[port].power != given[port].power or not wanted[port].quantity.matches(given[port].quantity)
    ]
